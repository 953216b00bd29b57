#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "cli/commands.hpp"
#include "io/errors.hpp"
#include "io/kernel_cache.hpp"

namespace pendula::cli {
namespace {

constexpr const char* model_text =
    R"(# A mechanical system for pendula: coordinates, parameters and a Lagrangian, in SymPy.
#
#   pendula check NAME.py             derives and compiles it, and tests it on itself
#   pendula simulate NAME.toml        with a scenario that says   [system] model = "NAME.py"
#
# What is here is a bob on a spring that swings in the plane; put your own in its place.
from sympy import cos, sin


def define(model, links):
    # Coordinates: a name and a unit. "rad" is an angle; anything else is not.
    r = model.coordinate("r", "m")  # length of the spring
    theta = model.coordinate("theta", "rad")  # from hanging down

    # Parameters: numbers that the scenario gives; with a default it need not. per_link=True gives one for each link.
    m = model.parameter("mass", "kg", default=1.0, positive=True)
    k = model.parameter("stiffness", "N/m", default=40.0, positive=True)
    rest = model.parameter("rest_length", "m", default=1.0)
    g = model.parameter("gravity", "m/s^2", default=9.81)
    drag = model.parameter("drag", "N s/m", default=0.0)

    # Inputs: forces from outside, driven by the scenario or by a program.
    push = model.input("push", "N")

    # Rates: of coordinates, and of whatever is made of them. model.time is the time.
    x, y = r * sin(theta), -r * cos(theta)
    x_dot, y_dot = model.rate(x), model.rate(y)

    # The Lagrangian, kinetic less potential energy.
    model.lagrangian = m * (x_dot**2 + y_dot**2) / 2 - k * (r - rest) ** 2 / 2 - m * g * y

    # What it does not give: Rayleigh's dissipation function, and forces along coordinates.
    model.dissipation = drag * (x_dot**2 + y_dot**2) / 2
    model.force(r, push)

    # Points, for files and pictures, and what is drawn between them; kind="cart" or "pivot" draws no ball.
    model.point("bob", (x, y))
    model.spring("origin", "bob")
)";

std::string with_name(std::string text, const std::string& name) {
  const std::string placeholder = "NAME";
  for (std::size_t at = 0; (at = text.find(placeholder, at)) != std::string::npos; at += name.size()) {
    text.replace(at, placeholder.size(), name);
  }
  return text;
}

bool is_name(const std::string& name) {
  const auto letter = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
  return !name.empty() && std::isalpha(static_cast<unsigned char>(name.front())) != 0 &&
         std::ranges::all_of(name, letter);
}

}  // namespace

ExitStatus build(const BuildOptions& options) {
  const io::ModelKernel kernel =
      io::find_kernel({options.model, options.links}, io::Toolchain::of_this_program(),
                      [](const std::string& what) { std::cerr << "pendula: " << what << '\n'; });
  const SystemInfo& info = kernel.table->info;
  std::cout << info.name << ": coordinates";
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    std::cout << (k == 0 ? " " : ", ") << info.coordinates[k] << " [" << info.coordinate_units[k] << ']';
  }
  std::cout << '\n';
  if (kernel.file.empty()) {
    std::cout << "part of this program\n";
  } else {
    std::cout << (kernel.by() == "compiler" ? "compiled\n" : "interpreted\n")
              << (kernel.was_there ? "kept in " : "made as ") << kernel.file.string() << '\n';
  }
  return done;
}

ExitStatus new_model(const std::string& name) {
  const std::string stem = name.ends_with(".py") ? name.substr(0, name.size() - 3) : name;
  if (!is_name(stem))
    throw io::InputError("new-model: expected a name of letters, digits and underscores, got " + name);
  const std::string file = stem + ".py";
  if (std::filesystem::exists(file))
    throw io::InputError("new-model: expected a new name, got " + file + ", which exists");
  std::ofstream stream(file);
  stream << with_name(model_text, stem);
  stream.close();
  if (!stream) throw io::InputError("new-model: expected to write " + file + ", got: " + std::strerror(errno));
  std::cout << file << " is a model to start from; pendula check " << file << " derives, compiles and tests it\n";
  return done;
}

}  // namespace pendula::cli
