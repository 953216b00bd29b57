#pragma once

#include <optional>
#include <string>
#include <vector>

namespace pendula::cli {

/// How the program ends.
enum ExitStatus {
  done = 0,
  failed = 1,       ///< the computation failed; what was computed is kept
  wrong_input = 2,  ///< file, key, value, command or option
  unfinished = 3,   ///< members of an ensemble are missing; what is there is kept, and --resume goes on
};

struct SimulateOptions {
  std::string command;                 ///< as it was typed, for files to tell
  std::string scenario;                ///< the file; empty where a run goes on
  std::optional<std::string> resume;   ///< run file that it goes on with
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::optional<std::string> output;   ///< trajectory file, CSV or HDF5 by its ending; "-" is standard output
  std::optional<std::string> events;   ///< file for its events, CSV
  std::optional<std::string> view;     ///< page to look at the run
  std::optional<std::string> video;    ///< film of the run
  int copies = 0;                      ///< further runs in the page, from starts that differ
  double apart = 1e-9;                 ///< by this, in the first coordinate, from one to the next
  bool json = false;                   ///< summary as JSON
  bool quiet = false;                  ///< no summary and no progress; warnings, errors and the JSON object remain
};

/// Runs a scenario: trajectory to the file, summary to standard output (or to standard error where that is the file),
/// progress and warnings to standard error.
/// Throws io::InputError.
ExitStatus simulate(const SimulateOptions& options);

struct CheckOptions {
  std::optional<std::string> model;  ///< a model file, a built-in model, or a scenario with [system]
  std::optional<std::string> space;
  std::optional<int> links;
};

/// The self-test of this build, or of one model: kernels, order, energy; a table to standard output. Throws
/// io::InputError where no kernel is chosen.
ExitStatus check(const CheckOptions& options);

struct BuildOptions {
  std::string model;         ///< a model file, or a built-in model
  std::optional<int> links;  ///< where the model has some
};

/// Makes the kernel of a model, or finds it made; says where it is on standard output. Throws io::InputError.
ExitStatus build(const BuildOptions& options);

struct DescribeOptions {
  std::string model;         ///< a model file, or a built-in model
  std::optional<int> links;  ///< where the model has some
  bool json = false;
};

/// Tells on standard output what a model has: coordinates, parameters, inputs, points. Throws io::InputError.
ExitStatus describe(const DescribeOptions& options);

/// Lists the built-in models on standard output. Throws io::InputError.
ExitStatus models(bool json);

/// Writes NAME.py, a model to start from. Throws io::InputError where that cannot be.
ExitStatus new_model(const std::string& name);

struct PlotOptions {
  std::vector<std::string> runs;  ///< files of trajectories, of events, or of Lyapunov exponents
  std::string output;             ///< .svg, .png or .pdf
  std::string show;               ///< panels of trajectories, with commas; empty for what there is
  std::string coordinates;        ///< by name, with commas; empty for a few
  std::optional<double> from, to;
  bool wrapped = false;  ///< angles within one turn
};

/// Draws runs, by the Python package pendula_plot; its complaints go to standard error.
ExitStatus plot(const PlotOptions& options);

struct MapOptions {
  std::string file;     ///< of an ensemble
  std::string key;      ///< what is kept of every member
  std::string output;   ///< .svg, .png or .pdf
  std::string scale;    ///< "log" or "linear"; empty for what the numbers ask for
  std::string contour;  ///< `key=value`, a line where what is kept has that value; empty for none
};

/// Draws an ensemble over its axes, as plot does.
ExitStatus map(const MapOptions& options);

/// Whether a film of that name can be made here; says why not on standard error.
ExitStatus check_film(const std::string& output);

/// Makes a film of a run file.
ExitStatus film(const std::string& run, const std::string& output);

/// Makes a page of striking cases, with films, in a folder.
ExitStatus gallery(const std::string& folder);

struct LyapunovOptions {
  std::string scenario;                ///< the file
  std::vector<std::string> overrides;  ///< `key.path=value`
  int count = 0;                       ///< leading exponents; 0 for all
  std::optional<std::string> output;   ///< CSV of how they converge
  bool json = false;
};

/// Runs a scenario and tells its Lyapunov exponents on standard output. Throws io::InputError.
ExitStatus lyapunov(const LyapunovOptions& options);

/// One of several parts of an ensemble that run by themselves.
struct Shard {
  int number = 1, of = 1;
};

struct EnsembleOptions {
  std::string command;                 ///< as it was typed, for the file to tell
  std::string scenario;                ///< the file
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string output;                  ///< HDF5 file
  int threads = 0;                     ///< of each process; 0 for as many as there are cores, of several ranks for one
  std::optional<Shard> shard;
  bool resume = false;  ///< goes on with what is beside the output
  bool json = false;
};

/// Moves the members of a scenario with [ensemble]; a summary to standard output. Throws io::InputError.
ExitStatus ensemble(const EnsembleOptions& options);

/// Lists the fixed-n kernels of this build on standard output.
ExitStatus kernels();

}  // namespace pendula::cli
