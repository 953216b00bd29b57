#include <cmath>
#include <filesystem>
#include <iostream>
#include <pendula/numeric/number_text.hpp>
#include <string>
#include <vector>

#include "cli/commands.hpp"
#include "io/errors.hpp"
#include "io/process.hpp"
#include "io/toolchain.hpp"

namespace pendula::cli {
namespace {

/// Runs the Python package pendula_plot, which prints its own errors.
ExitStatus draw(const std::vector<std::string>& arguments) {
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  std::vector<std::string> command = toolchain.module(toolchain.plotting, "pendula_plot");
  command.insert(command.end(), arguments.begin(), arguments.end());
  const int status = io::run_attached(command);
  if (status == 127) {
    throw io::InputError("pictures take a Python, which " + toolchain.setup().string() + " installs; " +
                         toolchain.python + " could not be started (PENDULA_PYTHON names another one)");
  }
  return status == 0 ? done : status == 2 ? wrong_input : failed;
}

/// The same, and prints the name of the picture.
ExitStatus draw_picture(const std::vector<std::string>& arguments, const std::string& output) {
  const ExitStatus status = draw(arguments);
  if (status == done) std::cout << "picture            " << output << '\n';
  return status;
}

}  // namespace

ExitStatus plot(const PlotOptions& options) {
  std::vector<std::string> arguments{"plot",
                                     "--output=" + options.output,
                                     "--show=" + options.show,
                                     "--coordinates=" + options.coordinates,
                                     "--phase=" + options.phase,
                                     "--event=" + options.event};
  if (options.from) arguments.push_back("--from=" + shortest(*options.from));
  if (options.to) arguments.push_back("--to=" + shortest(*options.to));
  if (options.wrapped) arguments.emplace_back("--wrapped");
  arguments.emplace_back("--");
  arguments.insert(arguments.end(), options.runs.begin(), options.runs.end());
  return draw_picture(arguments, options.output);
}

ExitStatus map(const MapOptions& options) {
  return draw_picture({"map", "--output=" + options.output, "--scale=" + options.scale, "--contour=" + options.contour,
                       "--", options.file, options.key},
                      options.output);
}

ExitStatus check_film(const std::string& output) {
  return draw({"film", "--output=" + output});
}

ExitStatus film(const std::vector<std::string>& runs, const std::string& output, const FilmOptions& film) {
  std::vector<std::string> arguments{"film",
                                     "--output=" + output,
                                     "--size=" + shortest(film.size),
                                     "--fps=" + shortest(film.fps),
                                     "--speed=" + shortest(film.speed),
                                     "--from=" + shortest(film.from)};
  if (std::isfinite(film.to)) arguments.push_back("--to=" + shortest(film.to));
  arguments.emplace_back("--");
  arguments.insert(arguments.end(), runs.begin(), runs.end());
  return draw(arguments);
}

ExitStatus gallery(const std::string& folder) {
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  return draw({"gallery", "--scenarios=" + toolchain.examples.string(),
               "--program=" + std::filesystem::read_symlink("/proc/self/exe").string(), "--", folder});
}

}  // namespace pendula::cli
