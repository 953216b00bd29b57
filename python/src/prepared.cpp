#include "prepared.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <optional>
#include <pendula/run/inputs.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/run/state_columns.hpp>
#include <stdexcept>
#include <utility>
#include <variant>

#include "arrays.hpp"
#include "bindings.hpp"
#include "io/kernel_cache.hpp"
#include "io/natural_units.hpp"
#include "io/scenario_run.hpp"
#include "toolchain.hpp"

namespace pendula::python {
namespace {

std::shared_ptr<Prepared> prepare(const std::string& text, const std::string& name,
                                  const std::vector<std::string>& overrides, const std::string& program,
                                  const std::string& python, const Tell& tell) {
  const nb::gil_scoped_release others_may_go_on;
  Models models(program, python, tell);
  return prepared(io::parse_scenario(text, name, overrides, models.finder()));
}

/// Throws io::InputError where a scenario is wrong.
void check(const std::string& text, const std::string& program, const std::string& python, const Tell& tell) {
  const nb::gil_scoped_release others_may_go_on;
  Models models(program, python, tell);
  io::parse_scenario(text, "pendula", {}, models.finder());
}

/// Values of constants of the system, by name.
std::map<std::string, std::vector<double>> constants_of(const Prepared& made) {
  std::map<std::string, std::vector<double>> values;
  for (const Constant& one : made.subject->constants()) values[one.name] = one.values;
  return values;
}

std::optional<io::NaturalUnits> natural_units_of(const Prepared& made) {
  return std::visit([](const auto& scenario) { return scenario.natural; }, made.scenario);
}

/// Names of inputs, those with signals, too.
std::vector<std::string> inputs_of(const Prepared& made) {
  const std::shared_ptr<const Subject> part = made.subject->part_at(made.start.time);
  return input_names(part ? *part : *made.subject);
}

/// Units in SI of coordinates, rates, inputs and parameters, by name.
std::map<std::string, std::string> si_units_of(const Prepared& made) {
  std::map<std::string, std::string> units;
  for (const Constant& one : made.subject->constants()) units[one.name] = one.unit;
  for (const std::string& input : inputs_of(made)) units[input] = "N m";
  const std::vector<std::string> columns = made.subject->columns();
  for (const Quantity& quantity : made.subject->quantities()) {
    for (std::size_t k = 0; k < quantity.size(); ++k) units[columns[quantity.column(k)]] = quantity.unit;
  }
  return units;
}

/// The same in the scenario's own units.
std::map<std::string, std::string> units_of(const Prepared& made) {
  std::map<std::string, std::string> units = si_units_of(made);
  for (auto& [name, unit] : units) unit = io::in_units(natural_units_of(made), unit);
  return units;
}

/// The number in a text with a unit, in the unit of what has this name; nothing if it is none.
std::optional<double> with_unit(const Prepared& made, const std::string& text, const std::string& name) {
  const std::optional<io::NaturalUnits> natural = natural_units_of(made);
  const io::BaseUnits base = natural ? io::BaseUnits{natural->mass, natural->length, natural->time} : io::BaseUnits{};
  const std::map<std::string, std::string> units = si_units_of(made);
  const auto unit = units.find(name);
  return unit == units.end() ? std::nullopt : io::with_unit(text, unit->second, base);
}

void require_continuous(const io::RunPlan& plan) {
  for (const io::FeedbackPlan& feedback : plan.feedback) {
    if (feedback.sample == 0) continue;
    throw io::InputError(
        "feedback: expected a continuous one, got one with sample, which simulate and ensemble alone have: here a "
        "program holds inputs itself, from step to step");
  }
}

}  // namespace

std::shared_ptr<Prepared> prepared(io::AnyScenario any) {
  return std::visit(
      [&](const auto& scenario) {
        require_continuous(scenario);
        std::shared_ptr<const Subject> subject = io::subject_of(scenario);
        Motion start = scenario.start;
        const RunOptions options = scenario.options;
        std::vector<std::string> warnings = scenario.warnings;
        return std::shared_ptr<Prepared>(
            new Prepared{std::move(any), std::move(subject), std::move(start), options, std::move(warnings)});
      },
      any);
}

Models::Models(const std::string& program, const std::string& python, const Tell& tell)
    : toolchain_(toolchain_of(program, python)), tell_(tell) {}

io::FindSystem Models::finder() {
  return [this](const io::ModelName& name) {
    const io::ModelKernel kernel = io::find_kernel(name, toolchain_, [&](const std::string& what) {
      const nb::gil_scoped_acquire lock;
      tell_(what);
    });
    by_ = kernel.by();
    return kernel.table;
  };
}

void define_prepared(nb::module_& module) {
  nb::class_<Prepared>(module, "Prepared")
      .def_prop_ro("columns", [](const Prepared& made) { return made.subject->columns(); })
      .def_prop_ro("state", [](const Prepared& made) { return state_columns(*made.subject); })
      .def_prop_ro("inputs", &inputs_of)
      .def_prop_ro(
          "start", [](const Prepared& made) { return vector_of(state_of(made.start)); }, nb::rv_policy::move)
      .def_prop_ro("units", &units_of)
      .def("with_unit", &with_unit, nb::arg("text"), nb::arg("name"))
      .def_prop_ro("constants", &constants_of)
      .def_prop_ro("is_natural", [](const Prepared& made) { return natural_units_of(made).has_value(); })
      .def_prop_ro("time", [](const Prepared& made) { return made.start.time; })
      .def_ro("warnings", &Prepared::warnings);
  module.def("check", &check, nb::arg("text"), nb::arg("program"), nb::arg("python"), nb::arg("tell"));
  module.def("prepare", &prepare, nb::arg("text"), nb::arg("name"), nb::arg("overrides"), nb::arg("program"),
             nb::arg("python"), nb::arg("tell"));
}

}  // namespace pendula::python
