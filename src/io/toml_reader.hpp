#pragma once

#include <toml++/toml.h>
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/input_error.hpp"

namespace pendula::io {

/// Reads TOML text and applies overrides `key.path=value`. Every node keeps where it came from: `name` and a line, or
/// the text of the override. Throws InputError on text that is no TOML and on overrides that fit nowhere.
toml::table parse_toml(std::string_view text, std::string_view name, std::span<const std::string> overrides);

/// The same as an override of one key by a number, without its text: for copies of documents, of which there are many,
/// and which have lost their places in the file.
void set_number(toml::table& root, std::string_view key, double number);

/// Where `source` lies, as messages begin: `file:line`, or `--set key=value`.
std::string location(const toml::source_region& source);

/// A value as messages show it: one line, cut where it is long.
std::string shown(const toml::node& node);

/// What a number must be besides finite.
enum class Sign { any, not_negative, positive };

/// A unit that a number may be given in, by a string such as "90 deg".
struct Unit {
  std::string_view name;
  double size;  ///< in the unit of numbers without one
};
using Units = std::span<const Unit>;

/// Number of links, and what told it.
struct LinkCount {
  int links = 0;
  std::string told_by;  ///< key
  std::string place;    ///< `where: key`
};

/// One value of the scenario: converts to what is expected, or throws InputError with place, key, expected and got.
class Entry {
 public:
  Entry(const toml::node& node, std::string key) : node_(&node), key_(std::move(key)) {}

  const std::string& key() const { return key_; }
  bool is_array() const { return node_->is_array(); }
  bool is_number() const { return node_->is_number(); }
  const toml::table* table() const { return node_->as_table(); }
  std::string where() const { return location(node_->source()); }
  std::string place() const { return where() + ": " + key_; }

  std::size_t size() const { return node_->is_array() ? node_->as_array()->size() : 0; }
  /// Element of an array, counted from 0 here and from 1 in messages, as links are.
  Entry element(std::size_t index) const;

  /// A number; where there are `units`, also a string of a number and one of them.
  double number(Sign sign = Sign::any, Units units = {}) const;
  bool truth() const;
  std::int64_t integer(std::int64_t least, std::int64_t most) const;
  /// Any string but an empty one.
  std::string text() const;
  /// A string out of `choices`, as its index there.
  std::size_t choice(std::span<const std::string_view> choices) const;
  /// One number a link; a single number stands for every link.  (n)
  Eigen::VectorXd per_link(const LinkCount& count, Sign sign = Sign::any, Units units = {}) const;
  /// A vector of `components` numbers.  (components)
  Eigen::VectorXd vector(Eigen::Index components) const;

  [[noreturn]] void fail(const std::string& expected) const;

 private:
  const toml::node* node_;
  std::string key_;
};

/// A table of the scenario whose keys are all known; without a table it has no keys at all.
class Section {
 public:
  /// Throws InputError where `entry` is no table, or holds a key that is not in `known`. `elsewhere` are the dotted
  /// names of all keys, to hint at those that were put into the wrong table.
  Section(const Entry& entry, std::span<const std::string_view> known,
          std::span<const std::string_view> elsewhere = {});
  /// The table `name` of `parent`, which need not be there.
  Section(const Section& parent, std::string name, std::span<const std::string_view> known,
          std::span<const std::string_view> elsewhere);

  std::optional<Entry> find(std::string_view key) const;
  /// The value of a key that has no default.
  Entry require(std::string_view key, const std::string& expected) const;
  const std::string& where() const { return where_; }

 private:
  void read(const Entry& entry, std::span<const std::string_view> known, std::span<const std::string_view> elsewhere);
  std::string dotted(std::string_view key) const;

  const toml::table* table_ = nullptr;
  std::string name_;
  std::string where_;  // of the table, or of its parent where there is none
};

}  // namespace pendula::io
