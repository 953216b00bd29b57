#pragma once

#include <toml++/toml.h>
#include <span>
#include <string>
#include <string_view>

#include "io/ensemble_plan.hpp"
#include "io/scenario.hpp"

namespace pendula::io {

/// Reads a scenario from its document. Throws InputError.
AnyScenario read_document(const toml::table& document, std::string_view name, const FindSystem& find);

/// A scenario with [ensemble] that is parsed once and read many times with other numbers.
class ScenarioDocument {
 public:
  /// Throws InputError as parse_scenario, and where there is no [ensemble].
  ScenarioDocument(std::string_view text, std::string_view name, std::span<const std::string> overrides);

  const EnsemblePlan& plan() const { return plan_; }

  /// Whether it starts with momenta, of which rates are made by the mass matrix at the coordinates.
  bool starts_with_momenta() const;

  /// The scenario with further overrides. An InputError names these; lines of the file only where there are none.
  AnyScenario with(std::span<const std::string> overrides, const FindSystem& find) const;
  /// The scenario with numbers[k] as the value of keys[k]. Neither it nor the InputError that it throws knows places in
  /// the file.
  AnyScenario with(std::span<const std::string> keys, std::span<const double> numbers, const FindSystem& find) const;

 private:
  std::string name_;
  toml::table root_;  // without [ensemble], which may list every member
  EnsemblePlan plan_;
};

}  // namespace pendula::io
