#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "io/ensemble_output.hpp"

namespace pendula::cli {

/// Exit statuses of the program.
enum ExitStatus {
  done = 0,
  failed = 1,       ///< the computation failed; results up to there are kept
  wrong_input = 2,  ///< file, key, value, command or option
  unfinished = 3,   ///< members of an ensemble are missing; --resume goes on
};

/// The look of a film, in the words of the package that draws it.
struct FilmOptions {
  double fps = 30;                                                ///< frames a second
  double speed = 1;                                               ///< of the motion, relative to real time
  double size = 640;                                              ///< of the picture, in pixels
  double from = 0, to = std::numeric_limits<double>::infinity();  ///< which part of the motion  [s]
};

struct SimulateOptions {
  std::string command;                 ///< as typed, for files
  std::string scenario;                ///< the file; empty if a run is resumed
  std::optional<std::string> resume;   ///< run file to resume
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::optional<std::string> output;   ///< trajectory file, CSV or HDF5 by its ending; "-" is standard output
  std::optional<std::string> events;   ///< CSV file of events
  std::optional<std::string> view;     ///< page of the run
  std::optional<std::string> video;    ///< film of the run
  FilmOptions film;
  int copies = 0;       ///< further runs in the page and the film, from other starts
  double apart = 1e-9;  ///< distance of neighbouring starts, in the first coordinate
  bool json = false;    ///< summary as JSON
  bool quiet = false;   ///< no summary and no progress; warnings, errors and the JSON object remain
};

/// Runs a scenario. The trajectory goes to the file, the summary to standard output (to standard error if standard
/// output is the file), progress and warnings to standard error. Throws io::InputError.
ExitStatus simulate(const SimulateOptions& options);

struct CheckOptions {
  std::optional<std::string> model;  ///< a model file, a built-in model, or a scenario with [system]
  std::optional<std::string> space;
  std::optional<int> links;
};

/// The self-test of this build, or of one model: a table of kernels, orders, energies on standard output. Throws
/// io::InputError if no kernel is chosen.
ExitStatus check(const CheckOptions& options);

struct BuildOptions {
  std::string model;         ///< a model file, or a built-in model
  std::optional<int> links;  ///< if the model has links
};

/// Makes the kernel of a model, unless it exists, and prints its file. Throws io::InputError.
ExitStatus build(const BuildOptions& options);

struct DescribeOptions {
  std::string model;         ///< a model file, or a built-in model
  std::optional<int> links;  ///< if the model has links
  bool json = false;
};

/// Prints coordinates, parameters, inputs and points of a model. Throws io::InputError.
ExitStatus describe(const DescribeOptions& options);

/// Prints a list of the built-in models. Throws io::InputError.
ExitStatus models(bool json);

/// Writes NAME.py, a model to start from. Throws io::InputError if it cannot be written.
ExitStatus new_model(const std::string& name);

struct PlotOptions {
  std::vector<std::string> runs;  ///< files of trajectories, of events, or of Lyapunov exponents
  std::string output;             ///< .svg, .png or .pdf
  std::string show;               ///< panels, separated by commas; empty for all
  std::string coordinates;        ///< names, separated by commas; empty for a few
  std::string phase;              ///< two names for the axes of phase portraits; empty for a coordinate and its rate
  std::string event;              ///< of sections: the one event to show; empty for all
  std::optional<double> from, to;
  bool wrapped = false;  ///< angles within one turn
};

/// Draws runs by the Python package pendula_plot; its errors go to standard error.
ExitStatus plot(const PlotOptions& options);

struct MapOptions {
  std::string file;     ///< of an ensemble
  std::string key;      ///< a quantity that is kept for every member
  std::string output;   ///< .svg, .png or .pdf
  std::string scale;    ///< "log" or "linear"; if empty, the numbers decide
  std::string contour;  ///< `key=value`, a contour line; empty for none
};

/// Draws an ensemble over its axes, by pendula_plot.
ExitStatus map(const MapOptions& options);

/// Whether a film of that name can be made here; if not, prints why to standard error.
ExitStatus check_film(const std::string& output);

/// Makes a film of run files, all in one picture.
ExitStatus film(const std::vector<std::string>& runs, const std::string& output, const FilmOptions& film);

/// Makes a page of striking cases, with films, in a folder.
ExitStatus gallery(const std::string& folder);

struct LabOptions {
  std::string scenario;                ///< the file, or a model's; or a built-in model; empty for a double pendulum
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::optional<int> links;            ///< of a model file that has links
  std::string output;                  ///< the page
};

/// Writes a page in which the motion is computed. Throws io::InputError.
ExitStatus lab(const LabOptions& options);

struct ExportOptions {
  std::string what;                    ///< a model file, a built-in model, a chain as planar:3, or a scenario
  std::vector<std::string> overrides;  ///< `key.path=value`, of a scenario
  std::optional<int> links;            ///< of a model that has links
  std::string language;                ///< "c", "casadi" or "fmu"
  std::string output;                  ///< the folder for files, or the file of an FMU
  std::string name;                    ///< prefix of names; empty for the model's name
  std::optional<int> stages;           ///< of the Gauss step; else those of the scenario, or 2
  bool is_float = false;               ///< numbers are float
};

/// Writes a system as the source of another program; prints the names of the files. Throws io::InputError.
ExitStatus export_system(const ExportOptions& options);

struct LyapunovOptions {
  std::string scenario;                ///< the file
  std::vector<std::string> overrides;  ///< `key.path=value`
  int count = 0;                       ///< leading exponents; 0 for all
  std::optional<std::string> output;   ///< CSV of their convergence
  bool json = false;
};

/// Runs a scenario and prints its Lyapunov exponents. Throws io::InputError.
ExitStatus lyapunov(const LyapunovOptions& options);

struct LinearizeOptions {
  std::string scenario;                ///< the file
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string at = "start";            ///< or "equilibrium"
  std::string step;                    ///< of the discrete system, "0.01" or "10 ms"; empty: the continuous one
  bool json = false;
};

/// Prints the linearisation at a scenario's start, or at an equilibrium near it. Throws io::InputError.
ExitStatus linearize(const LinearizeOptions& options);

struct EnsembleOptions {
  std::string command;                 ///< as typed, for the file
  std::string scenario;                ///< the file
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string output;                  ///< HDF5 file
  int threads = 0;  ///< of each process; 0 for the number of cores, or one if there are several ranks
  std::optional<io::Shard> shard;
  bool resume = false;  ///< continues with the journals beside the output
  bool json = false;
  bool quiet = false;

  bool tells_progress() const { return !json && !quiet; }
};

/// Runs the members of a scenario with [ensemble], and prints a summary. Throws io::InputError.
ExitStatus ensemble(const EnsembleOptions& options);

/// Prints a list of the fixed-n kernels of this build.
ExitStatus kernels();

}  // namespace pendula::cli
