#include "io/toml_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/nearest_name.hpp"
#include "io/quantity_text.hpp"
#include "io/scenario_keys.hpp"
#include "io/section.hpp"

namespace pendula::io {
namespace {

/// Greatest depth of nested keys and values; a scenario needs four.
constexpr int max_nesting = 16;

/// One past the last quote of the string that begins at `begin`; the end of the text if it does not end.
std::size_t string_end(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  const std::string_view three = text.substr(begin, 3);
  const bool multi_line = three.size() == 3 && three[1] == quote && three[2] == quote;
  for (std::size_t i = begin + (multi_line ? 3 : 1); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;  // an escaped character does not end the string
    } else if (multi_line && text.substr(i, 3) == three) {
      return i + 3;
    } else if (!multi_line && (text[i] == quote || text[i] == '\n')) {
      return i + (text[i] == quote ? 1 : 0);
    }
  }
  return text.size();
}

/// The first line, from 1, of TOML text in which a key has more than `max_nesting` parts, or a value is nested deeper;
/// 0 if there is none. Call before parsing: a recursive parser would exhaust the stack on such text.
int line_nested_too_deep(std::string_view text) {
  int depth = 0, dots = 0, line = 1;
  for (std::size_t i = 0; i < text.size(); ++i) {
    switch (text[i]) {
      case '#':
        i = std::min(text.find('\n', i), text.size()) - 1;
        break;
      case '"':
      case '\'': {
        const std::size_t end = string_end(text, i);
        line += static_cast<int>(std::ranges::count(text.substr(i, end - i), '\n'));
        i = end - 1;
        break;
      }
      case '[':
      case '{':
        ++depth;
        dots = 0;
        break;
      case ']':
      case '}':
        depth = std::max(depth - 1, 0);
        break;
      case '.':
        ++dots;
        break;
      case '\n':
        ++line;
        [[fallthrough]];
      case '=':
      case ',':
        dots = 0;
        break;
      default:
        break;
    }
    if (depth > max_nesting || dots >= max_nesting) return line;
  }
  return 0;
}

bool is_key_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

/// A part of a key, `torque[2][3]`: its name, and elements, counted from 1.
struct KeyPart {
  std::string_view name;
  std::vector<std::size_t> elements;
};

/// Parses a part such as `masses[2]`; empty if it is wrong.
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

/// Parses a key such as `a.b[2].c`; empty if a part is wrong.
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

/// Why a number does not fit into a C++ type; empty if it does.
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

/// The first number in a line that does not fit into a C++ type, and why: `1e400, too large for a double`; empty if
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

/// Throws InputError if the text would exhaust the parser's stack.
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

/// Whether a text is a bare word that counts as a string: it begins with a letter, and has no characters of TOML's
/// syntax.
bool is_bare_word(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !text.empty() && is_letter(text.front()) &&
         std::ranges::all_of(text, [](char c) { return is_key_character(c) || c == '.'; });
}

/// Whether a text counts as a string without quotes: a bare word, or a number with a unit. The shell has removed
/// quotes.
bool is_bare_string(std::string_view text) {
  if (is_bare_word(text)) return true;
  const auto in_a_unit = [](char c) {
    return is_key_character(c) || std::string_view("/*^ ").find(c) != std::string_view::npos ||
           unit_signs.find(c) != std::string_view::npos;
  };
  const std::optional<TextWithUnit> quantity = read_quantity(text);
  if (!quantity || quantity->unit.empty() || (quantity->unit.front() >= '0' && quantity->unit.front() <= '9'))
    return false;
  return std::ranges::all_of(quantity->unit, in_a_unit);
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
                   (number.empty() ? "a TOML value after '=', got " + toml_string(value) : "a number, got " + number));
}

/// The place where a value is to be put.
struct KeyPlace {
  const std::string& where;
  std::string_view key;
};

/// The array with an element of this number.
toml::array& array_with(toml::node* node, std::size_t element, const KeyPlace& place) {
  toml::array* const array = node == nullptr ? nullptr : node->as_array();
  if (array == nullptr || array->size() < element) {
    throw InputError(place.where, printable(place.key), "an array of at least " + std::to_string(element) + " elements",
                     node == nullptr ? "none" : shown(*node));
  }
  return *array;
}

/// The table of a part that is not the last one.
toml::table& table_of(toml::table& table, const KeyPart& part, const KeyPlace& place) {
  // A new table has the override as its place; an existing one keeps its own.
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

/// The table that holds the last part of a key.
toml::table& last_table(toml::table& root, std::span<const KeyPart> path, const KeyPlace& place) {
  toml::table* table = &root;
  for (const KeyPart& part : path.first(path.size() - 1)) table = &table_of(*table, part, place);
  return *table;
}

/// The array that holds the last element of a part.
toml::array& last_array(toml::table& table, const KeyPart& part, const KeyPlace& place) {
  toml::node* node = table.get(part.name);
  for (std::size_t k = 0; k + 1 < part.elements.size(); ++k) {
    node = array_with(node, part.elements[k], place).get(part.elements[k] - 1);
  }
  return array_with(node, part.elements.back(), place);
}

/// Sets the value of `key`.
void put(toml::table& root, std::string_view key, toml::node& value, const std::string& where) {
  const std::vector<KeyPart> path = key_path(key);
  const KeyPlace place{where, key};
  toml::table& table = last_table(root, path, place);
  const auto& [name, elements] = path.back();
  if (elements.empty()) {
    table.insert_or_assign(name, std::move(value));
    return;
  }
  toml::array& array = last_array(table, path.back(), place);
  array.replace(array.cbegin() + static_cast<std::ptrdiff_t>(elements.back() - 1), std::move(value));
}

/// Removes `key`.
void take_out(toml::table& root, std::string_view key, const std::string& where) {
  const std::vector<KeyPart> path = key_path(key);
  const KeyPlace place{where, key};
  toml::table& table = last_table(root, path, place);
  const auto& [name, elements] = path.back();
  if (!elements.empty()) {
    toml::array& array = last_array(table, path.back(), place);
    array.erase(array.cbegin() + static_cast<std::ptrdiff_t>(elements.back() - 1));
  } else if (table.erase(name) == 0) {
    const std::string known =
        find_key(key) == nullptr ? did_you_mean(nearest_name(without_elements(key), all_keys())) : "";
    throw InputError(where, printable(key), "a key of the scenario, to take it out", "none" + known);
  }
}

/// A hint at the form of keys, in which elements count from 1.
std::string counting_hint(std::string_view key) {
  return key.find("[0]") == std::string_view::npos ? "" : " (elements of arrays count from 1)";
}

/// Longest scenario that is read: ten numbers for each of `max_links` fit in.
constexpr std::size_t max_text = std::size_t{256} << 20;

[[noreturn]] void reject_file(const std::string& name, const std::string& why) {
  throw InputError(name + ": expected a scenario file that can be read, got: " + why);
}

std::string checked(InputFile file, const std::string& name) {
  if (!file.problem.empty()) reject_file(name, file.problem);
  return std::move(file.text);
}

}  // namespace

void apply_override(toml::table& root, const std::string& text) {
  const std::string where = std::string(override_prefix) + printable(text);
  require_shallow(text, where);
  const std::size_t equals = text.find('=');
  const std::string_view key = trimmed(std::string_view(text).substr(0, equals));
  if (equals == std::string::npos || key_path(key).empty()) {
    throw InputError(where + ": expected KEY=VALUE such as run.step=1e-4, got " + toml_string(text) +
                     counting_hint(key));
  }
  const std::string_view given = trimmed(std::string_view(text).substr(equals + 1));
  if (given.empty()) return take_out(root, key, where);
  toml::table value = parse_value(given, where);
  put(root, key, *value.get("value"), where);
}

ScenarioText read_scenario_text(const std::filesystem::path& file) {
  const std::string standard_input = "standard input";
  if (file == "-") return {standard_input, checked(read_standard_input(max_text), standard_input)};
  return {file.string(), checked(read_input_file(file, max_text), file.string())};
}

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

}  // namespace pendula::io
