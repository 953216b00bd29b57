#include "io/toml_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/quantity.hpp>
#include <system_error>

#include "io/nearest_name.hpp"
#include "io/toml_nesting.hpp"

namespace pendula::io {
namespace {

constexpr std::string_view override_prefix = "--set ";

constexpr std::size_t longest_shown = 60;

/// The beginning of a text that is too long for a message, and never half a character of it.
std::string cut(std::string_view text) {
  if (text.size() <= longest_shown) return std::string(text);
  std::size_t end = longest_shown;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "...";
}

/// A text on one line, cut where it is long.
std::string printable(std::string_view text) {
  std::string shown = cut(text);
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';  // nothing that steers a terminal
  }
  return shown;
}

std::string quoted(std::string_view text) {
  return '"' + printable(text) + '"';
}

bool is_key_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

/// A part of a key between dots, `torque[2][3]`: its name, and elements from 1 on.
struct KeyPart {
  std::string_view name;
  std::vector<std::size_t> elements;
};

/// `masses[2]` and the like; nothing where it is none.
std::optional<KeyPart> key_part(std::string_view text) {
  KeyPart part;
  part.name = text.substr(0, text.find('['));
  if (part.name.empty() || !std::ranges::all_of(part.name, is_key_character)) return std::nullopt;
  for (text.remove_prefix(part.name.size()); !text.empty();) {
    const std::size_t close = text.find(']');
    if (text.front() != '[' || close == std::string_view::npos) return std::nullopt;
    std::size_t element = 0;
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + close, element);
    if (error != std::errc() || end != text.data() + close || element == 0) return std::nullopt;
    part.elements.push_back(element);
    text.remove_prefix(close + 1);
  }
  return part;
}

/// The parts of `a.b[2].c`; none where one of them is wrong.
std::vector<KeyPart> key_path(std::string_view key) {
  std::vector<KeyPart> path;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    std::optional<KeyPart> part = key_part(key.substr(begin, end - begin));
    if (!part) return {};
    path.push_back(*std::move(part));
    begin = end + 1;
  }
  return path;
}

/// Where a line of `name` is, as messages begin: `file:line`, or `--set key=value`.
std::string line_place(const std::string& name, std::int64_t line) {
  return name.starts_with(override_prefix) ? name : name + ":" + std::to_string(line);
}

/// What is wrong with a number that C++ has no room for; empty where nothing is.
std::string number_problem(std::string token) {
  std::erase(token, '_');
  const bool is_integer = token.find_first_not_of("+-0123456789") == std::string::npos;
  const char* const first = token.data() + (token.starts_with('+') ? 1 : 0);
  const char* const last = token.data() + token.size();
  const auto out_of_range = [&](auto value) {
    return std::from_chars(first, last, value).ec == std::errc::result_out_of_range;
  };
  if (is_integer) return out_of_range(std::int64_t()) ? "too large for an integer; with a point it is a float" : "";
  if (!out_of_range(double())) return "";
  return std::abs(std::strtod(first, nullptr)) > 1 ? "too large for a double" : "too small for a double";
}

/// The first number in a line of text that C++ has no room for, and why: `1e400, too large for a double`; empty where
/// there is none.
std::string impossible_number(std::string_view line) {
  constexpr std::string_view digits = "0123456789", in_a_number = "0123456789+-._eE";
  for (std::size_t begin = 0; begin < line.size();) {
    const std::size_t end = std::min(line.find_first_not_of(in_a_number, begin), line.size());
    const std::string_view token = line.substr(begin, end - begin);
    const std::string problem = token.find_first_of(digits) < 2 ? number_problem(std::string(token)) : "";
    if (!problem.empty()) return cut(token) + ", " + problem;
    begin = end + 1;
  }
  return {};
}

/// A line of text, counted from 1.
std::string_view line_of(std::string_view text, std::int64_t number) {
  for (; number > 1; --number) text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
  return text.substr(0, text.find('\n'));
}

/// Throws InputError on text that would exhaust the parser's stack.
void require_shallow(std::string_view text, const std::string& name) {
  const int line = line_nested_too_deep(text);
  if (line == 0) return;
  throw InputError(line_place(name, line) + ": expected keys and values nested at most " + std::to_string(max_nesting) +
                   " deep, got more");
}

toml::table parse(std::string_view text, const std::string& name) {
  require_shallow(text, name);
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const std::string number = impossible_number(line_of(text, error.source().begin.line));
    throw InputError(
        location(error.source()) + ": expected " +
        (number.empty() ? "valid TOML, got: " + std::string(error.description()) : "a number, got " + number));
  }
}

/// A word that a shell user types for a string: begins with a letter, and holds nothing that TOML gives a meaning to.
bool is_bare_word(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !text.empty() && is_letter(text.front()) &&
         std::ranges::all_of(text, [](char c) { return is_key_character(c) || c == '.'; });
}

/// A number and whatever stands behind it, as in "90 deg".
struct TextWithUnit {
  double value = 0;
  std::string_view unit;
};

std::optional<TextWithUnit> read_quantity(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  TextWithUnit quantity;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), quantity.value);
  if (error != std::errc()) return std::nullopt;
  quantity.unit = trimmed(text.substr(static_cast<std::size_t>(end - text.data())));
  return quantity;
}

constexpr std::string_view degree_sign = "\u00b0";

/// What a shell user types for a string: a word, or a number with a unit, whose quotes the shell takes.
bool is_bare_string(std::string_view text) {
  if (is_bare_word(text)) return true;
  const auto in_a_unit = [](char c) {
    return (c >= 'a' && c <= 'z') || c == '/' || degree_sign.find(c) != std::string_view::npos;
  };
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  return quantity && !quantity->unit.empty() && std::ranges::all_of(quantity->unit, in_a_unit);
}

/// The value of an override in a table of its own, under the key "value".
toml::table parse_value(std::string_view value, const std::string& where) {
  const std::string text(value);
  try {
    toml::table table = toml::parse("value = " + text, where);
    if (table.size() == 1) return table;  // not "1 \n another = 2"
  } catch (const toml::parse_error&) {
    if (is_bare_string(value)) return toml::parse("value = \"" + text + '"', where);
  }
  const std::string number = impossible_number(value);
  throw InputError(where + ": expected " +
                   (number.empty() ? "a TOML value after '=', got " + quoted(value) : "a number, got " + number));
}

/// Where a value is to be put.
struct Place {
  const std::string& where;
  std::string_view key;
};

/// The array that has an element of this number.
toml::array& array_with(toml::node* node, std::size_t element, const Place& place) {
  toml::array* const array = node == nullptr ? nullptr : node->as_array();
  if (array == nullptr || array->size() < element) {
    throw InputError(place.where, printable(place.key), "an array of at least " + std::to_string(element) + " elements",
                     node == nullptr ? "none" : shown(*node));
  }
  return *array;
}

/// The table that a part names which others come after.
toml::table& table_of(toml::table& table, const KeyPart& part, const Place& place) {
  // A table made here takes the override as its place; one that stands in the file keeps its own.
  if (part.elements.empty() && !table.contains(part.name)) {
    table.insert(part.name, std::move(*parse("t = {}", place.where).get("t")));
  }
  toml::node* next = table.get(part.name);
  for (const std::size_t element : part.elements) next = array_with(next, element, place).get(element - 1);
  if (!next->is_table()) {
    throw InputError(place.where, printable(place.key), "a table before the last dot (an array is set as a whole)",
                     std::string(part.name) + " = " + shown(*next));
  }
  return *next->as_table();
}

/// The table that the last part of a key is in.
toml::table& last_table(toml::table& root, std::span<const KeyPart> path, const Place& place) {
  toml::table* table = &root;
  for (const KeyPart& part : path.first(path.size() - 1)) table = &table_of(*table, part, place);
  return *table;
}

/// The array that a part's last element is in.
toml::array& last_array(toml::table& table, const KeyPart& part, const Place& place) {
  toml::node* node = table.get(part.name);
  for (std::size_t k = 0; k + 1 < part.elements.size(); ++k) {
    node = array_with(node, part.elements[k], place).get(part.elements[k] - 1);
  }
  return array_with(node, part.elements.back(), place);
}

/// Puts a value in the place of what `key` names.
void put(toml::table& root, std::string_view key, toml::node& value, const std::string& where) {
  const std::vector<KeyPart> path = key_path(key);
  const Place place{where, key};
  toml::table& table = last_table(root, path, place);
  const auto& [name, elements] = path.back();
  if (elements.empty()) {
    table.insert_or_assign(name, std::move(value));
    return;
  }
  toml::array& array = last_array(table, path.back(), place);
  array.replace(array.cbegin() + static_cast<std::ptrdiff_t>(elements.back() - 1), std::move(value));
}

/// Takes out what `key` names.
void take_out(toml::table& root, std::string_view key, const std::string& where) {
  const std::vector<KeyPart> path = key_path(key);
  const Place place{where, key};
  toml::table& table = last_table(root, path, place);
  const auto& [name, elements] = path.back();
  if (!elements.empty()) {
    toml::array& array = last_array(table, path.back(), place);
    array.erase(array.cbegin() + static_cast<std::ptrdiff_t>(elements.back() - 1));
  } else if (table.erase(name) == 0) {
    throw InputError(where, printable(key), "a key of the scenario, to take it out", "none");
  }
}

/// What a key may look like, for those who count from 0.
std::string counting_hint(std::string_view key) {
  return key.find("[0]") == std::string_view::npos ? "" : " (elements of arrays count from 1)";
}

void apply_override(toml::table& root, const std::string& text) {
  const std::string where = std::string(override_prefix) + printable(text);
  require_shallow(text, where);
  const std::size_t equals = text.find('=');
  const std::string_view key = trimmed(std::string_view(text).substr(0, equals));
  if (equals == std::string::npos || key_path(key).empty()) {
    throw InputError(where + ": expected KEY=VALUE such as run.step=1e-4, got " + quoted(text) + counting_hint(key));
  }
  const std::string_view given = trimmed(std::string_view(text).substr(equals + 1));
  if (given.empty()) return take_out(root, key, where);
  toml::table value = parse_value(given, where);
  put(root, key, *value.get("value"), where);
}

std::string expected_number(Sign sign, Units units) {
  std::string expected = "a finite number";
  if (sign == Sign::not_negative) expected += " >= 0";
  if (sign == Sign::positive) expected += " > 0";
  for (std::size_t i = 0; i < units.size(); ++i) {
    expected += (i == 0 ? " or a string in " : " or ") + std::string(units[i].name);
  }
  return expected;
}

/// The number in a text such as "90 deg" or "90°".
std::optional<double> with_unit(std::string_view text, Units units) {
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  if (!quantity) return std::nullopt;
  std::string name(quantity->unit);
  if (name.starts_with(degree_sign)) name.replace(0, degree_sign.size(), "deg");
  const auto unit = std::ranges::find(units, name, &Unit::name);
  return unit == units.end() ? std::nullopt : std::optional(quantity->value * unit->size);
}

bool fits(double value, Sign sign) {
  if (!std::isfinite(value)) return false;
  return sign == Sign::any || value > 0 || (sign == Sign::not_negative && value == 0);
}

/// A float always looks like one, so that `expected an integer, got 3.0` makes sense.
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

std::string joined(std::span<const std::string_view> names, std::string_view separator) {
  std::string text;
  for (const std::string_view name : names) text += std::string(text.empty() ? "" : separator) + std::string(name);
  return text;
}

/// The key of this table that may have been meant, or the table that has this key.
std::string hint_at_key(std::string_view key, std::span<const std::string_view> known,
                        std::span<const std::string_view> elsewhere) {
  const auto ends_in_key = [&](std::string_view name) { return name.ends_with("." + std::string(key)); };
  const auto found = std::ranges::find_if(elsewhere, ends_in_key);
  return found == elsewhere.end() ? did_you_mean(nearest_name(key, known)) : did_you_mean(*found);
}

}  // namespace

toml::table parse_toml(std::string_view text, std::string_view name, std::span<const std::string> overrides) {
  toml::table root = parse(text, std::string(name));
  for (const std::string& override : overrides) apply_override(root, override);
  return root;
}

void set_number(toml::table& root, std::string_view key, double number) {
  const std::string where = std::string(override_prefix) + std::string(key);
  if (key_path(key).empty()) throw InputError(where + ": expected a key such as run.step" + counting_hint(key));
  const bool is_integer = std::abs(number) < 0x1p53 && number == std::floor(number);
  toml::value<std::int64_t> integer(is_integer ? static_cast<std::int64_t>(number) : 0);
  toml::value<double> real(number);
  put(root, key, is_integer ? static_cast<toml::node&>(integer) : real, where);
}

std::string location(const toml::source_region& source) {
  return line_place(source.path ? *source.path : std::string("scenario"), source.begin.line);
}

std::string shown(const toml::node& node) {
  if (const auto* array = node.as_array()) return shown_array(*array);
  if (node.is_table()) return "a table";
  if (const auto* value = node.as_string()) return quoted(value->get());
  if (const auto* value = node.as_floating_point()) return shown_float(value->get());
  if (const auto* value = node.as_integer()) return std::to_string(value->get());
  if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
  return "a date or time";
}

Entry Entry::element(std::size_t index) const {
  return {*node_->as_array()->get(index), key_ + "[" + std::to_string(index + 1) + "]"};
}

void Entry::fail(const std::string& expected) const {
  throw InputError(where(), key_, expected, shown(*node_));
}

double Entry::number(Sign sign, Units units) const {
  const auto* text = node_->as_string();
  const std::optional<double> value = is_number() ? node_->value<double>()
                                      : text      ? with_unit(text->get(), units)
                                                  : std::nullopt;
  if (!value || !fits(*value, sign)) fail(expected_number(sign, units));
  return *value;
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

std::size_t Entry::choice(std::span<const std::string_view> choices) const {
  const auto* value = node_->as_string();
  const auto found = value == nullptr ? choices.end() : std::ranges::find(choices, std::string_view(value->get()));
  if (found != choices.end()) return static_cast<std::size_t>(found - choices.begin());
  const std::string expected = '"' + joined(choices, "\" or \"") + '"';
  if (value == nullptr) fail(expected);
  throw InputError(where(), key_, expected, shown(*node_) + did_you_mean(nearest_name(value->get(), choices)));
}

Eigen::VectorXd Entry::per_link(const LinkCount& count, Sign sign, Units units) const {
  if (is_number() || (node_->is_string() && !units.empty())) {
    return Eigen::VectorXd::Constant(count.links, number(sign, units));
  }
  if (!is_array() || size() != static_cast<std::size_t>(count.links)) {
    fail(expected_number(sign, units) + " for all links, or an array of " + std::to_string(count.links) +
         (key_ == count.told_by ? "" : " (the links that " + count.told_by + " tells)"));
  }
  Eigen::VectorXd values(count.links);
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] = element(static_cast<std::size_t>(i)).number(sign, units);
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

Section::Section(const Entry& entry, std::span<const std::string_view> known,
                 std::span<const std::string_view> elsewhere)
    : name_(entry.key()) {
  read(entry, known, elsewhere);
}

Section::Section(const Section& parent, std::string name, std::span<const std::string_view> known,
                 std::span<const std::string_view> elsewhere)
    : name_(std::move(name)), where_(parent.where_) {
  if (const std::optional<Entry> entry = parent.find(name_)) read(*entry, known, elsewhere);
}

void Section::read(const Entry& entry, std::span<const std::string_view> known,
                   std::span<const std::string_view> elsewhere) {
  table_ = entry.table();
  where_ = entry.where();
  if (table_ == nullptr) entry.fail("a table");
  for (const auto& [key, node] : *table_) {
    if (std::ranges::find(known, key.str()) != known.end()) continue;
    if (std::ranges::find(known, present_name(key.str())) != known.end()) continue;
    throw InputError(location(node.source()), dotted(printable(key.str())), "one of " + joined(known, ", "),
                     "the unknown key " + quoted(key.str()) + hint_at_key(key.str(), known, elsewhere));
  }
}

std::string Section::dotted(std::string_view key) const {
  return (name_.empty() ? "" : name_ + ".") + std::string(key);
}

std::optional<Entry> Section::find(std::string_view key) const {
  const toml::node* node = table_ == nullptr ? nullptr : table_->get(key);
  if (node == nullptr) return std::nullopt;
  return Entry(*node, dotted(key));
}

Entry Section::require(std::string_view key, const std::string& expected) const {
  if (std::optional<Entry> entry = find(key)) return *entry;
  throw InputError(where_, dotted(key), expected, "no such key");
}

}  // namespace pendula::io
