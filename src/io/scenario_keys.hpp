#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace pendula::io {

/// Most links that a scenario may ask for: a slip of the keyboard should not eat the memory.
inline constexpr int max_links = 1'000'000;

/// Beyond 2⁵³ a double no longer tells one member from the next.
inline constexpr std::int64_t most_members = std::int64_t{1} << 53;

/// What a number must be besides finite.
struct Bound {
  double least = -std::numeric_limits<double>::infinity();
  bool is_excluded = false;  ///< the least itself

  constexpr bool allows(double value) const { return value > least || (value == least && !is_excluded); }
};
inline constexpr Bound any_number{}, not_negative{0, false}, positive{0, true};

/// What the value of a key is.
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
  table,
  tables  ///< any number of them, [[name]]
};

/// What a key stands for where a scenario does not have it: nothing, so that it must be there; a value; or what follows
/// from other keys, in words.
struct Required {};
struct InWords {
  std::string_view text;
};
using Otherwise = std::variant<Required, InWords, double, std::int64_t, bool, std::string_view>;

/// All that is said of a key: readers, errors, help, completion, axes of ensembles and tests of documents go by this.
// NOLINTBEGIN(readability-redundant-member-init): left out in designated initializers
struct ScenarioKey {
  std::string_view name;
  KeyType type = KeyType::number;
  std::string_view unit = {};  ///< as UDUNITS has it; empty where there is none, or the model tells it
  Otherwise otherwise = {};
  std::string_view hint = {};
  Bound bound = {};        ///< of numbers
  std::int64_t least = 0;  ///< of integers
  std::int64_t most = 0;   ///< of integers
  std::span<const std::string_view> choices = {};
  bool may_change = false;  ///< where a run goes on; everything else decides how it came to where it is
};                          // NOLINTEND(readability-redundant-member-init)

/// The keys of a table, and which commands look at it; those of the document, whose name is empty, are the tables.
struct ScenarioTable {
  std::string_view name;
  std::span<const std::string_view> commands;
  std::span<const ScenarioKey> keys;
};

std::span<const ScenarioTable> scenario_tables();

/// A table by its dotted name, which must be there.
const ScenarioTable& table_named(std::string_view name);

/// `chain.masses` of `chain.masses[2]`: a key without the elements of arrays.
std::string without_elements(std::string_view key);

/// What a dotted key stands for, elements aside: a null pointer where it is none that all scenarios have.
const ScenarioKey* find_key(std::string_view key);

/// The dotted names of all keys, tables but the document's own left out.
std::span<const std::string_view> all_keys();

/// Whether a number may stand in the place of its value, or of an element of it.
bool takes_numbers(const ScenarioKey& key);

/// The default as a scenario would have it; in words where it follows from others, empty where there is none.
std::string default_text(const ScenarioKey& key);

/// What its value is, for people: `a number > 0, or one a link`.
std::string type_text(const ScenarioKey& key);

}  // namespace pendula::io
