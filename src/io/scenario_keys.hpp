#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace pendula::io {

/// Most links of a scenario, so that a typing error does not exhaust the memory.
inline constexpr int max_links = 1'000'000;

/// Most members: doubles count exactly up to 2⁵³.
inline constexpr std::int64_t most_members = std::int64_t{1} << 53;

/// Bounds of a number, which must be finite, too.
struct Bound {
  double least = -std::numeric_limits<double>::infinity();
  bool is_excluded = false;  ///< whether the bound itself is excluded

  constexpr bool allows(double value) const { return value > least || (value == least && !is_excluded); }
};
inline constexpr Bound any_number{}, not_negative{0, false}, positive{0, true};

/// Types of values.
enum class KeyType {
  number,
  integer,
  truth,     ///< true or false
  text,      ///< a string that is not empty
  choice,    ///< one of several strings
  per_link,  ///< a number for all links, or an array of one a link
  torque,    ///< in the plane a number, in space [x, y, z]; of [chain] for all links, or an array of one a link
  numbers,   ///< an array
  texts,     ///< an array
  names,     ///< a table whose keys the model has
  columns,   ///< a table of expressions, whose keys are anybody's
  table,
  tables  ///< any number of them, [[name]]
};

/// The default of a key: none, so that it must be given; a value; or a description, if it follows from other keys.
struct Required {};
struct InWords {
  std::string_view text;
};
using Otherwise = std::variant<Required, InWords, double, std::int64_t, bool, std::string_view>;

/// The definition of a key, for readers, errors, help, completion, axes of ensembles and tests of the documentation.
// NOLINTBEGIN(readability-redundant-member-init): left out in designated initializers
struct ScenarioKey {
  std::string_view name;
  KeyType type = KeyType::number;
  std::string_view unit = {};  ///< for UDUNITS; empty if there is none, or the model has it
  Otherwise otherwise = {};
  std::string_view hint = {};
  Bound bound = {};        ///< of numbers
  std::int64_t least = 0;  ///< of integers
  std::int64_t most = 0;   ///< of integers
  std::span<const std::string_view> choices = {};
  bool may_change = false;  ///< whether a resumed run may have another value
};                          // NOLINTEND(readability-redundant-member-init)

/// The keys of a table, and which commands read it. The document has an empty name; its keys are the tables.
struct ScenarioTable {
  std::string_view name;
  std::span<const std::string_view> commands;
  std::span<const ScenarioKey> keys;
};

std::span<const ScenarioTable> scenario_tables();

/// A table by its dotted name, which must exist.
const ScenarioTable& table_named(std::string_view name);

/// A key without array elements: `chain.masses` for `chain.masses[2]`.
std::string without_elements(std::string_view key);

/// The definition of a dotted key, array elements aside; null for a key that only a model has, or that is unknown.
const ScenarioKey* find_key(std::string_view key);

/// The dotted names of all keys; of tables only those of the document.
std::span<const std::string_view> all_keys();

/// Whether its value, or an element of it, may be a number.
bool takes_numbers(const ScenarioKey& key);

/// The default as TOML; a description if it follows from other keys; empty if there is none.
std::string default_text(const ScenarioKey& key);

/// A description of its values: `a number > 0, or one a link`.
std::string type_text(const ScenarioKey& key);

/// The JSON Schema of scenarios, for editors and for the tests of docs/reference/scenario.md.
std::string scenario_schema();

}  // namespace pendula::io
