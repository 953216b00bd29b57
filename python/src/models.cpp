// What models have: names, units, defaults, and how their kernels run.

#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cstddef>
#include <map>
#include <optional>
#include <pendula/run/quantity.hpp>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "io/generator.hpp"
#include "io/kernel_cache.hpp"
#include "io/quantity_text.hpp"
#include "prepared.hpp"
#include "toolchain.hpp"

namespace pendula::python {
namespace {

using Named = std::vector<std::pair<std::string, std::string>>;  // names and units

/// A model as it is described.
struct ModelInfo {
  int links = 1;
  Named coordinates, rates, inputs, constraints;
  std::vector<std::tuple<std::string, std::string, double>> parameters;  // with defaults, NaN where there is none
  std::map<std::string, std::string> units;                              // of all of these
  std::vector<std::string> points;
  std::string kernel_by, kernel_file;
};

Named named(std::span<const std::string_view> names, std::span<const std::string_view> units) {
  Named named;
  for (std::size_t k = 0; k < names.size(); ++k) named.emplace_back(names[k], units[k]);
  return named;
}

ModelInfo describe_model(const std::string& model, std::optional<int> links, const std::string& program,
                         const std::string& python, const Tell& tell) {
  const nb::gil_scoped_release others_may_go_on;
  const io::ModelKernel kernel =
      io::find_kernel({model, links}, toolchain_of(program, python), [&](const std::string& what) {
        const nb::gil_scoped_acquire lock;
        tell(what);
      });
  const SystemInfo& info = kernel.table->info;
  ModelInfo told{.links = info.links,
                 .coordinates = named(info.coordinates, info.coordinate_units),
                 .rates = {},
                 .inputs = named(info.inputs, info.input_units),
                 .constraints = named(info.constraints, info.constraint_units),
                 .parameters = {},
                 .units = {},
                 .points = {info.points.begin(), info.points.end()},
                 .kernel_by = std::string(kernel.by()),
                 .kernel_file = kernel.file.string()};
  for (const auto& [name, unit] : told.coordinates) told.rates.emplace_back(rate_name(name), rate_unit(unit));
  for (std::size_t k = 0; k < info.own_parameters(); ++k) {
    told.parameters.emplace_back(info.parameters[k], info.parameter_units[k], info.parameter_defaults[k]);
    told.units.emplace(info.parameters[k], info.parameter_units[k]);
  }
  for (const Named& names : {told.coordinates, told.rates, told.inputs}) told.units.insert(names.begin(), names.end());
  return told;
}

/// The number in a text with a unit, as an input or a parameter has it; nothing if it is none.
std::optional<double> with_unit(const ModelInfo& info, const std::string& text, const std::string& name) {
  const auto unit = info.units.find(name);
  return unit == info.units.end() ? std::nullopt : io::with_unit(text, unit->second);
}

}  // namespace

void define_models(nb::module_& module) {
  nb::class_<ModelInfo>(module, "ModelInfo")
      .def_ro("links", &ModelInfo::links)
      .def_ro("coordinates", &ModelInfo::coordinates)
      .def_ro("rates", &ModelInfo::rates)
      .def_ro("inputs", &ModelInfo::inputs)
      .def_ro("constraints", &ModelInfo::constraints)
      .def_ro("parameters", &ModelInfo::parameters)
      .def_ro("units", &ModelInfo::units)
      .def_ro("points", &ModelInfo::points)
      .def_ro("kernel_by", &ModelInfo::kernel_by)
      .def_ro("kernel_file", &ModelInfo::kernel_file)
      .def("with_unit", &with_unit, nb::arg("text"), nb::arg("name"));
  module.def("describe_model", &describe_model, nb::arg("model"), nb::arg("links").none(), nb::arg("program"),
             nb::arg("python"), nb::arg("tell"));
  module.def(
      "built_in_models", [](const std::string& program) { return io::built_in_models(io::Toolchain::of(program)); },
      nb::arg("program"));
}

}  // namespace pendula::python
