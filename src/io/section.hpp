#pragma once

#include <toml++/toml.h>
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/errors.hpp"
#include "io/quantity_text.hpp"
#include "io/scenario_keys.hpp"

namespace pendula::io {

/// The beginning of the place of an override.
inline constexpr std::string_view override_prefix = "--set ";

/// The beginning of a message: `file:line`, or `--set key=value`.
std::string line_place(const std::string& name, std::int64_t line);

/// The same for a node of TOML.
std::string location(const toml::source_region& source);

/// Cuts a text that is too long for a message, between UTF-8 characters.
std::string cut(std::string_view text);

/// A text on one line, cut if it is long.
std::string printable(std::string_view text);

std::string toml_string(std::string_view text);

/// A value as messages show it: one line, cut if it is long.
std::string shown(const toml::node& node);

/// The number of links, and the key that it follows from.
struct LinkCount {
  int links = 0;
  std::string told_by;  ///< the key
  std::string place;    ///< `where: key`
};

/// One value of a scenario. It converts to the type of its key, or throws InputError with place, key, what was expected
/// and what was found.
class Entry {
 public:
  Entry(const toml::node& node, std::string name, const ScenarioKey& key, const BaseUnits& base = {})
      : node_(&node), name_(std::move(name)), key_(&key), base_(base) {}

  /// The full key, as start.theta[1].
  const std::string& name() const { return name_; }
  bool is_array() const { return node_->is_array(); }
  bool is_number() const { return node_->is_number(); }
  const toml::table* table() const { return node_->as_table(); }
  std::string where() const { return location(node_->source()); }
  std::string place() const { return where() + ": " + name_; }

  std::size_t size() const { return node_->is_array() ? node_->as_array()->size() : 0; }
  /// Element of an array, counted from 0 here, and from 1 in messages.
  Entry element(std::size_t index) const;
  /// A value of a table by its name, which must exist.
  Entry member(std::string_view name) const;

  /// A number, or a string with a number and a unit of the kind of `unit`; if that is empty, of the key's unit.
  double number(std::string_view unit = {}) const;
  bool truth() const;
  std::int64_t integer() const { return integer(key_->least, key_->most); }
  std::int64_t integer(std::int64_t least, std::int64_t most) const;
  /// A string that is not empty.
  std::string text() const;
  /// The index of a string among those of the key, or among `choices`.
  std::size_t choice() const { return choice(key_->choices); }
  std::size_t choice(std::span<const std::string_view> choices) const;
  /// One number a link; a single number stands for every link.  (n)
  Eigen::VectorXd per_link(const LinkCount& count, std::string_view unit = {}) const;
  /// A vector of `components` numbers.  (components)
  Eigen::VectorXd vector(Eigen::Index components) const;

  [[noreturn]] void fail(const std::string& expected) const;

  const BaseUnits& base() const { return base_; }

 private:
  std::string_view unit_or_own(std::string_view unit) const { return unit.empty() ? key_->unit : unit; }

  const toml::node* node_;
  std::string name_;
  const ScenarioKey* key_;
  BaseUnits base_;
};

/// A table of a scenario, all of whose keys must be known. It may be missing; then it has no keys.
class Section {
 public:
  /// A whole document.
  explicit Section(const toml::table& document);
  /// The table at this key of `parent`, which may be missing.
  Section(const Section& parent, std::string_view key);
  /// A table with other keys, such as those of a model. Like the others it throws InputError if `entry` is no table, or
  /// has an unknown key.
  Section(const Entry& entry, std::span<const ScenarioKey> keys);
  Section(const Section& parent, std::string_view key, std::span<const ScenarioKey> keys);

  /// The tables of the array [[name.key]].
  std::vector<Section> each(std::string_view key) const;

  std::optional<Entry> find(std::string_view key) const;
  /// The value of a key that must be given.
  Entry require(std::string_view key) const;
  Entry require(std::string_view key, const std::string& expected) const;

  /// The value of a key, or its default.
  double number(std::string_view key, std::string_view unit = {}) const;
  std::int64_t integer(std::string_view key) const;
  bool truth(std::string_view key) const;
  std::size_t choice(std::string_view key) const;
  /// One number a link, or the default for all links.
  Eigen::VectorXd per_link(std::string_view key, const LinkCount& count, std::string_view unit = {}) const;

  /// An option by its name.
  template <class Option>
  Option option(std::string_view key) const {
    return static_cast<Option>(choice(key));
  }

  const std::string& where() const { return where_; }

  /// From now on plain numbers are in these units, in the tables within, too.
  void measure_in(const BaseUnits& base) { base_ = base; }

 private:
  /// `elsewhere` has the dotted names of all keys, for hints at keys in the wrong table.
  void read(const Entry& entry, std::span<const std::string_view> elsewhere);
  void require_known(std::span<const std::string_view> elsewhere) const;
  const ScenarioKey& key_named(std::string_view key) const;
  std::string dotted(std::string_view key) const;

  const toml::table* table_ = nullptr;
  std::string name_;
  std::string where_;  // place of the table, or of its parent if it is missing
  std::span<const ScenarioKey> keys_;
  BaseUnits base_;
};

}  // namespace pendula::io
