#include "io/expression_reader.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <numbers>
#include <pendula/run/quantity.hpp>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "io/expression.hpp"
#include "io/expression_operations.hpp"
#include "io/nearest_name.hpp"

namespace pendula::io {
namespace {

constexpr std::size_t longest_text = 10'000;
constexpr std::size_t most_listed = 24;
constexpr int deepest = 200;

/// Signs between two operands, by how strongly they bind. A longer sign stands before its beginning: "<=" before "<".
constexpr std::array<std::array<std::string_view, 6>, 5> signs = {
    {{"||"}, {"&&"}, {"<=", ">=", "<", ">", "==", "!="}, {"+", "-"}, {"*", "/"}}};

std::string quoted(const std::string& text) {
  constexpr std::size_t longest_shown = 60;
  std::string shown = text.size() <= longest_shown ? text : text.substr(0, longest_shown) + "...";
  std::ranges::replace_if(
      shown, [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '\x7f'; }, '?');
  return '"' + shown + '"';
}

/// The names for a message; a long list is cut in the middle. Columns that must not be used have none.
std::string listed(std::span<const std::string> all) {
  std::vector<std::string> names;
  std::ranges::copy_if(all, std::back_inserter(names), [](const std::string& name) { return !name.empty(); });
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (names.size() > most_listed && k == most_listed / 2) {
      text += "..., ";
      k = names.size() - most_listed / 4;
    }
    text += names[k] + ", ";
  }
  return text + "pi";
}

/// A recursive-descent parser. −x^2 is −(x^2), and 2^3^2 is 2^(3^2).
class ExpressionReader {
 public:
  ExpressionReader(const std::string& text, std::span<const std::string> names) : text_(text), names_(names) {}

  ExpressionProgram read() {
    if (text_.size() > longest_text) throw ExpressionError(expected(), quoted(text_) + ", which is too long");
    choice();
    if (here() == ',') throw ExpressionError(expected(), quoted(text_) + ", which is several");
    if (here() == '=') throw ExpressionError(expected() + ", which sets nothing", quoted(text_));
    if (here() != '\0') fail("an operator");
    program_.is_plain = kinds_.back().is_plain && !kinds_.back().is_of_time();
    return std::move(program_);
  }

 private:
  /// Properties of a node.
  struct Kind {
    bool is_constant = false, is_plain = false;
    bool has_time = false, has_others = false;
    /// The most that it changes when all columns change by one; infinite if it is not linear.
    double turns = std::numeric_limits<double>::infinity();

    bool is_of_time() const { return has_time && !has_others; }
  };

  // --- Grammar: each function returns the place of its node ---

  std::size_t choice() {
    const Deeper deeper(*this);
    const std::size_t condition = bound_by(0);
    if (!take("?")) return condition;
    const std::size_t yes = choice();
    need(":");
    return add("?:", {condition, yes, choice()});
  }
  std::size_t bound_by(std::size_t level) {
    if (level == signs.size()) return factor();
    std::size_t value = bound_by(level + 1);
    for (;;) {
      const auto sign = std::ranges::find_if(signs[level], [&](auto each) { return !each.empty() && take(each); });
      if (sign == signs[level].end()) return value;
      value = add(*sign, {value, bound_by(level + 1)});
    }
  }
  std::size_t factor() {
    const Deeper deeper(*this);
    if (take("-")) return add("~", {factor()});
    if (take("+")) return factor();
    const std::size_t base = operand();
    return take("^") ? add("^", {base, factor()}) : base;
  }
  std::size_t operand() {
    if (take("(")) {
      const std::size_t value = choice();
      need(")");
      return value;
    }
    if (is_digit(here()) || here() == '.') return number();
    if (is_letter(here())) return name();
    fail("a number, a name or a parenthesis");
  }

  std::size_t number() {
    double value = 0;
    const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) fail("a number");
    at_ = static_cast<std::size_t>(end - text_.data());
    return constant(value);
  }

  std::size_t name() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && (is_letter(text_[at_]) || is_digit(text_[at_]))) ++at_;
    const std::string word = text_.substr(begin, at_ - begin);
    if (const Operation* function = operation_named(word)) return call(*function);
    if (word == "pi") return constant(std::numbers::pi);
    auto found = std::ranges::find(names_, word);
    if (found == names_.end()) found = std::ranges::find(names_, present_name(word));
    if (found == names_.end()) reject_name(word);
    return column(static_cast<std::size_t>(found - names_.begin()));
  }

  /// min and max take any number of operands.
  std::size_t call(const Operation& function) {
    need("(");
    std::size_t value = choice();
    const bool takes_any = function.name == "min" || function.name == "max";
    if (function.operands == 1) value = add(function.name, {value});
    if (function.operands == 2 && !takes_any) {
      need(",");
      value = add(function.name, {value, choice()});
    }
    while (takes_any && take(",")) value = add(function.name, {value, choice()});
    need(")");
    return value;
  }

  // --- Nodes ---

  std::size_t constant(double value) {
    return append({.number = value}, {.is_constant = true, .is_plain = true, .turns = 0});
  }

  std::size_t column(std::size_t of_row) {
    const auto found = std::ranges::find(program_.columns, of_row);
    const auto place = static_cast<std::size_t>(found - program_.columns.begin());
    if (found == program_.columns.end()) program_.columns.push_back(of_row);
    const bool is_time = names_[of_row] == "t";
    return append({.a = place, .is_column = true},
                  {.is_plain = true, .has_time = is_time, .has_others = !is_time, .turns = 1});
  }

  /// An operation on constants becomes a constant.
  std::size_t add(std::string_view name, std::initializer_list<std::size_t> operands) {
    const Operation& operation = *operation_named(name);
    std::array<std::size_t, 3> of{};
    std::ranges::copy(operands, of.begin());
    const bool is_constant = std::ranges::all_of(operands, [&](std::size_t k) { return kinds_[k].is_constant; });
    if (is_constant) {
      const auto& nodes = program_.nodes;
      const double value = operation(nodes[of[0]].number, nodes[of[1]].number, nodes[of[2]].number);
      program_.nodes.resize(program_.nodes.size() - operands.size());
      kinds_.resize(program_.nodes.size());
      return constant(value);
    }
    return append({&operation, of[0], of[1], of[2]}, kind(name, operands));
  }

  std::size_t append(const ExpressionProgram::Node& node, const Kind& kind) {
    program_.nodes.push_back(node);
    kinds_.push_back(kind);
    return program_.nodes.size() - 1;
  }

  Kind kind(std::string_view operation, std::initializer_list<std::size_t> operands) const {
    constexpr double quickest_sine = 2.001;
    Kind made;
    bool are_plain = true;
    for (const std::size_t k : operands) {
      made.has_time |= kinds_[k].has_time;
      made.has_others |= kinds_[k].has_others;
      are_plain &= kinds_[k].is_plain;
    }
    const std::size_t first = *operands.begin(), last = *(operands.end() - 1);
    const Kind &a = kinds_[first], &b = kinds_[last];
    const double of_a = std::abs(program_.nodes[first].number), of_b = std::abs(program_.nodes[last].number);
    if (operation == "~") {
      made.turns = a.turns;
      made.is_plain = are_plain;
    } else if (operation == "+" || operation == "-") {
      made.turns = a.turns + b.turns;
      made.is_plain = are_plain;
    } else if (operation == "*") {
      if (a.is_constant) made.turns = of_a * b.turns;
      if (b.is_constant) made.turns = a.turns * of_b;
      made.is_plain = are_plain && (a.is_constant || b.is_constant);
    } else if (operation == "/") {
      if (b.is_constant) made.turns = a.turns / of_b;
      made.is_plain = are_plain && b.is_constant;
    } else if (operation == "sin" || operation == "cos") {
      made.is_plain = are_plain && a.turns <= quickest_sine && !a.has_time;
    }
    return made;
  }

  // --- Characters ---

  static bool is_digit(char c) { return c >= '0' && c <= '9'; }
  static bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

  /// The next character that is not a space; 0 at the end.
  char here() {
    while (at_ < text_.size() && static_cast<unsigned char>(text_[at_]) <= ' ') ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }

  bool take(std::string_view sign) {
    here();
    if (!std::string_view(text_).substr(at_).starts_with(sign)) return false;
    at_ += sign.size();
    return true;
  }
  void need(std::string_view sign) {
    if (!take(sign)) fail(std::string("\"").append(sign).append("\""));
  }

  // --- Errors ---

  std::string expected() const {
    return "an expression such as cos(" + names_[std::min<std::size_t>(1, names_.size() - 1)] + ") - 0.5";
  }
  [[noreturn]] void fail(const std::string& wanted) {
    const char found = here();
    const std::string got = found == '\0' ? "its end" : quoted(text_.substr(at_, 12));
    throw ExpressionError(expected(), quoted(text_) + ": expected " + wanted + " before " + got);
  }
  [[noreturn]] void reject_name(const std::string& word) const {
    std::vector<std::string_view> known(names_.begin(), names_.end());
    for (const Operation& one : operations()) {
      if (one.is_function()) known.push_back(one.name);
    }
    throw ExpressionError("an expression in " + listed(names_),
                          "the unknown name " + quoted(word) + did_you_mean(nearest_name(word, known)));
  }

  /// Limits the depth of nesting, since each level takes some of the stack.
  class Deeper {
   public:
    explicit Deeper(ExpressionReader& reader) : reader_(reader) {
      if (++reader_.depth_ > deepest) {
        throw ExpressionError(reader_.expected(), quoted(reader_.text_) + ", which is nested too deeply");
      }
    }
    ~Deeper() { --reader_.depth_; }
    Deeper(const Deeper&) = delete;
    Deeper& operator=(const Deeper&) = delete;

   private:
    ExpressionReader& reader_;
  };

  ExpressionProgram program_;
  std::vector<Kind> kinds_;  // of nodes
  const std::string& text_;
  std::span<const std::string> names_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

}  // namespace

ExpressionProgram read_expression(const std::string& text, std::span<const std::string> names) {
  return ExpressionReader(text, names).read();
}

}  // namespace pendula::io
