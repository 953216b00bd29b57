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
};

struct SimulateOptions {
  std::string scenario;                ///< the file; empty where a run goes on
  std::optional<std::string> resume;   ///< run file that it goes on with
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::optional<std::string> output;   ///< trajectory file, HDF5 where it ends in .h5; "-" is standard output
  std::optional<std::string> view;     ///< page to look at the run
  std::optional<std::string> video;    ///< film of the run
  int copies = 0;                      ///< further runs in the page, from starts that differ
  double apart = 1e-9;                 ///< by this, in the first coordinate, from one to the next
  bool json = false;                   ///< summary as JSON
  bool quiet = false;                  ///< no summary, progress or warnings; JSON is still printed where asked for
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

/// Writes NAME.py, a model to start from. Throws io::InputError where that cannot be.
ExitStatus new_model(const std::string& name);

struct PlotOptions {
  std::vector<std::string> runs;  ///< trajectory files
  std::string output;             ///< .svg, .png or .pdf
  std::string show = "series,phase,energy,trace";
  std::string coordinates;  ///< by name, with commas; empty for a few
  std::optional<double> from, to;
  bool wrapped = false;  ///< angles within one turn
};

/// Draws runs, by the Python package pendula_plot; its complaints go to standard error.
ExitStatus plot(const PlotOptions& options);

/// Whether a film of that name can be made here; says why not on standard error.
ExitStatus check_film(const std::string& output);

/// Makes a film of a run file.
ExitStatus film(const std::string& run, const std::string& output);

/// Makes a page of striking cases, with films, in a folder.
ExitStatus gallery(const std::string& folder);

/// Lists the fixed-n kernels of this build on standard output.
ExitStatus kernels();

}  // namespace pendula::cli
