#include "io/scenario_document.hpp"

#include <algorithm>
#include <cstddef>

#include "io/section.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {

ScenarioDocument::ScenarioDocument(std::string_view text, std::string_view name, std::span<const std::string> overrides)
    : name_(name), root_(parse_toml(text, name, overrides)), plan_(read_ensemble(Section(root_), name_)) {
  root_.erase("ensemble");
}

bool ScenarioDocument::starts_with_momenta() const {
  constexpr std::string_view prefix = "p_", table = "start.";
  const auto is_momentum = [&](std::string_view key) { return key.starts_with(prefix); };
  const auto is_key_of_momentum = [&](const std::string& key) {
    return key.starts_with(table) && is_momentum(std::string_view(key).substr(table.size()));
  };
  if (std::ranges::any_of(plan_.keys(), is_key_of_momentum)) return true;
  const toml::table* const start = root_["start"].as_table();
  return start != nullptr &&
         std::ranges::any_of(*start, [&](const auto& entry) { return is_momentum(entry.first.str()); });
}

AnyScenario ScenarioDocument::with(std::span<const std::string> overrides, const FindSystem& find) const {
  if (overrides.empty()) return read_document(root_, name_, find);
  toml::table changed = root_;  // a copy knows no lines
  for (const std::string& override : overrides) apply_override(changed, override);
  return read_document(changed, name_, find);
}

AnyScenario ScenarioDocument::with(std::span<const std::string> keys, std::span<const double> numbers,
                                   const FindSystem& find) const {
  toml::table changed = root_;
  for (std::size_t k = 0; k < keys.size(); ++k) set_number(changed, keys[k], numbers[k]);
  return read_document(changed, name_, find);
}

}  // namespace pendula::io
