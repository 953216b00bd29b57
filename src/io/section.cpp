#include "io/section.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/system/options.hpp>

#include "io/nearest_name.hpp"

namespace pendula::io {
namespace {

constexpr std::size_t longest_shown = 60;

/// Floats keep their point, so that `expected an integer, got 3.0` makes sense.
std::string shown_float(double value) {
  const std::string text = shortest(value);
  return text.find_first_not_of("-0123456789") == std::string::npos ? text + ".0" : text;
}

std::string shown_array(const toml::array& array) {
  std::string text = "[";
  for (const toml::node& element : array) {
    if (text.size() > 1) text += ", ";
    if (text.size() > longest_shown) return text + "...] (" + std::to_string(array.size()) + " values)";
    text += shown(element);
  }
  return text + "]";
}

}  // namespace

std::string line_place(const std::string& name, std::int64_t line) {
  return name.starts_with(override_prefix) ? name : name + ":" + std::to_string(line);
}

std::string location(const toml::source_region& source) {
  return line_place(source.path ? *source.path : std::string("scenario"), source.begin.line);
}

std::string cut(std::string_view text) {
  if (text.size() <= longest_shown) return std::string(text);
  std::size_t end = longest_shown;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "...";
}

std::string printable(std::string_view text) {
  std::string shown = cut(text);
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';  // no control characters
  }
  return shown;
}

std::string toml_string(std::string_view text) {
  return '"' + printable(text) + '"';
}

std::string shown(const toml::node& node) {
  if (const auto* array = node.as_array()) return shown_array(*array);
  if (node.is_table()) return "a table";
  if (const auto* value = node.as_string()) return toml_string(value->get());
  if (const auto* value = node.as_floating_point()) return shown_float(value->get());
  if (const auto* value = node.as_integer()) return std::to_string(value->get());
  if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
  return "a date or time";
}

namespace {

using Names = std::span<const std::string_view>;

std::string expected_number(Bound bound) {
  std::string expected = "a finite number";
  if (bound.least > any_number.least) expected += (bound.is_excluded ? " > " : " >= ") + shortest(bound.least);
  return expected;
}

/// " or a string …" for messages: always for angles, for other quantities only if a string was given.
std::string or_a_string(std::string_view unit, bool is_string) {
  const std::string strings = strings_in(unit);
  const bool is_usual = strings != unit;
  if (unit.empty() || unit == "1" || !(is_usual || is_string)) return "";
  const std::string_view kind = is_usual ? "" : kind_of_unit(unit);
  return " or a string in " + strings + (kind.empty() ? "" : " (" + std::string(kind) + ")");
}

std::string joined(Names names, std::string_view separator) {
  std::string text;
  for (const std::string_view name : names) text += std::string(text.empty() ? "" : separator) + std::string(name);
  return text;
}

std::string expected_choice(Names choices) {
  return '"' + joined(choices, "\" or \"") + '"';
}

bool is_known(std::span<const ScenarioKey> keys, std::string_view key) {
  return std::ranges::find(keys, key, &ScenarioKey::name) != keys.end();
}

/// A hint: the key of this table that may have been meant, or the table that has this key.
std::string hint_at_key(std::string_view key, Names known, Names elsewhere) {
  const auto ends_in_key = [&](std::string_view name) { return name.ends_with("." + std::string(key)); };
  const auto found = std::ranges::find_if(elsewhere, ends_in_key);
  return found == elsewhere.end() ? did_you_mean(nearest_name(key, known)) : did_you_mean(*found);
}

}  // namespace

Entry Entry::element(std::size_t index) const {
  return {*node_->as_array()->get(index), name_ + "[" + std::to_string(index + 1) + "]", *key_, base_};
}

Entry Entry::member(std::string_view name) const {
  return {*node_->as_table()->get(name), name_ + "." + printable(name), *key_, base_};
}

void Entry::fail(const std::string& expected) const {
  throw InputError(where(), name_, expected, shown(*node_));
}

double Entry::number(std::string_view unit) const {
  unit = unit_or_own(unit);
  const auto* text = node_->as_string();
  const std::optional<double> value = is_number() ? node_->value<double>()
                                      : text      ? with_unit(text->get(), unit, base_)
                                                  : std::nullopt;
  if (value && std::isfinite(*value) && key_->bound.allows(*value)) return *value;
  const std::string_view kind = text && !value ? kind_of_quantity(text->get()) : "";
  throw InputError(where(), name_, expected_number(key_->bound) + or_a_string(unit, text != nullptr),
                   shown(*node_) + (kind.empty() ? "" : ", " + std::string(kind)));
}

bool Entry::truth() const {
  const auto* value = node_->as_boolean();
  if (value == nullptr) fail("true or false");
  return value->get();
}

std::int64_t Entry::integer(std::int64_t least, std::int64_t most) const {
  const auto* value = node_->as_integer();
  if (value == nullptr || value->get() < least || value->get() > most) {
    fail("an integer from " + std::to_string(least) + " to " + std::to_string(most));
  }
  return value->get();
}

std::string Entry::text() const {
  const auto* value = node_->as_string();
  if (value == nullptr || value->get().empty()) fail("a text");
  return value->get();
}

std::size_t Entry::choice(Names choices) const {
  const auto* value = node_->as_string();
  const auto found = value == nullptr ? choices.end() : std::ranges::find(choices, std::string_view(value->get()));
  if (found != choices.end()) return static_cast<std::size_t>(found - choices.begin());
  if (value == nullptr) fail(expected_choice(choices));
  const std::string_view instead = instead_of(value->get());
  throw InputError(where(), name_, expected_choice(choices),
                   shown(*node_) + (instead.empty() ? did_you_mean(nearest_name(value->get(), choices))
                                                    : " (that is gone, take " + std::string(instead) + ')'));
}

Eigen::VectorXd Entry::per_link(const LinkCount& count, std::string_view unit) const {
  unit = unit_or_own(unit);
  if (is_number() || (node_->is_string() && !unit.empty())) {
    return Eigen::VectorXd::Constant(count.links, number(unit));
  }
  if (!is_array() || size() != static_cast<std::size_t>(count.links)) {
    fail(expected_number(key_->bound) + or_a_string(unit, false) + " for all links, or an array of " +
         std::to_string(count.links) + (name_ == count.told_by ? "" : " (the links that " + count.told_by + " tells)"));
  }
  Eigen::VectorXd values(count.links);
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] = element(static_cast<std::size_t>(i)).number(unit);
  return values;
}

Eigen::VectorXd Entry::vector(Eigen::Index components) const {
  if (!is_array() || size() != static_cast<std::size_t>(components)) {
    fail(components == 3 ? "a vector [x, y, z]" : "a vector of " + std::to_string(components) + " numbers");
  }
  Eigen::VectorXd values(components);
  for (Eigen::Index i = 0; i < components; ++i) values[i] = element(static_cast<std::size_t>(i)).number();
  return values;
}

Section::Section(const toml::table& document)
    : table_(&document), where_(location(document.source())), keys_(table_named("").keys) {
  require_known(all_keys());
}

Section::Section(const Section& parent, std::string_view key)
    : name_(parent.dotted(key)), where_(parent.where_), keys_(table_named(name_).keys), base_(parent.base_) {
  if (const std::optional<Entry> entry = parent.find(key)) read(*entry, all_keys());
}

Section::Section(const Entry& entry, std::span<const ScenarioKey> keys)
    : name_(entry.name()), where_(entry.where()), keys_(keys), base_(entry.base()) {
  read(entry, {});
}

Section::Section(const Section& parent, std::string_view key, std::span<const ScenarioKey> keys)
    : name_(parent.dotted(key)), where_(parent.where_), keys_(keys), base_(parent.base_) {
  if (const std::optional<Entry> entry = parent.find(key)) read(*entry, {});
}

std::vector<Section> Section::each(std::string_view key) const {
  std::vector<Section> sections;
  const std::optional<Entry> entry = find(key);
  if (!entry) return sections;
  if (!entry->is_array()) entry->fail("[[" + dotted(key) + "]] tables");
  const std::span<const ScenarioKey> keys = table_named(dotted(key)).keys;
  for (std::size_t i = 0; i < entry->size(); ++i) sections.emplace_back(entry->element(i), keys);
  return sections;
}

void Section::read(const Entry& entry, Names elsewhere) {
  table_ = entry.table();
  where_ = entry.where();
  if (table_ == nullptr) entry.fail("a table");
  require_known(elsewhere);
}

void Section::require_known(Names elsewhere) const {
  for (const auto& [key, node] : *table_) {
    if (is_known(keys_, key.str()) || is_known(keys_, present_name(key.str()))) continue;
    std::vector<std::string_view> known(keys_.size());
    std::ranges::transform(keys_, known.begin(), &ScenarioKey::name);
    throw InputError(location(node.source()), dotted(printable(key.str())), "one of " + joined(known, ", "),
                     "the unknown key " + toml_string(key.str()) + hint_at_key(key.str(), known, elsewhere));
  }
}

const ScenarioKey& Section::key_named(std::string_view key) const {
  const auto found = std::ranges::find(keys_, key, &ScenarioKey::name);
  return found == keys_.end() ? *std::ranges::find(keys_, present_name(key), &ScenarioKey::name) : *found;
}

std::string Section::dotted(std::string_view key) const {
  return (name_.empty() ? "" : name_ + ".") + std::string(key);
}

std::optional<Entry> Section::find(std::string_view key) const {
  const toml::node* node = table_ == nullptr ? nullptr : table_->get(key);
  if (node == nullptr) return std::nullopt;
  return Entry(*node, dotted(key), key_named(key), base_);
}

Entry Section::require(std::string_view key) const {
  const ScenarioKey& known = key_named(key);
  return require(key, known.choices.empty() ? std::string(known.hint) : expected_choice(known.choices));
}

Entry Section::require(std::string_view key, const std::string& expected) const {
  if (std::optional<Entry> entry = find(key)) return *entry;
  throw InputError(where_, dotted(key), expected, "no such key");
}

double Section::number(std::string_view key, std::string_view unit) const {
  const std::optional<Entry> entry = find(key);
  return entry ? entry->number(unit) : std::get<double>(key_named(key).otherwise);
}

std::int64_t Section::integer(std::string_view key) const {
  const std::optional<Entry> entry = find(key);
  return entry ? entry->integer() : std::get<std::int64_t>(key_named(key).otherwise);
}

bool Section::truth(std::string_view key) const {
  const std::optional<Entry> entry = find(key);
  return entry ? entry->truth() : std::get<bool>(key_named(key).otherwise);
}

std::size_t Section::choice(std::string_view key) const {
  if (const std::optional<Entry> entry = find(key)) return entry->choice();
  const ScenarioKey& known = key_named(key);
  const auto otherwise = std::ranges::find(known.choices, std::get<std::string_view>(known.otherwise));
  return static_cast<std::size_t>(otherwise - known.choices.begin());
}

Eigen::VectorXd Section::per_link(std::string_view key, const LinkCount& count, std::string_view unit) const {
  if (const std::optional<Entry> entry = find(key)) return entry->per_link(count, unit);
  const double* const otherwise = std::get_if<double>(&key_named(key).otherwise);
  return Eigen::VectorXd::Constant(count.links, otherwise == nullptr ? 0 : *otherwise);
}

}  // namespace pendula::io
