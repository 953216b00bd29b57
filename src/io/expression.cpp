#include "io/expression.hpp"

#include <muParser.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <pendula/run/quantity.hpp>
#include <string_view>

#include "io/nearest_name.hpp"

namespace pendula::io {
namespace {

constexpr std::size_t longest_text = 10'000;
constexpr std::size_t most_listed = 24;

std::string quoted(const std::string& text) {
  constexpr std::size_t longest_shown = 60;
  std::string shown = text.size() <= longest_shown ? text : text.substr(0, longest_shown) + "...";
  std::ranges::replace_if(
      shown, [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '\x7f'; }, '?');
  return '"' + shown + '"';
}

/// As a message lists them: of very many, those at both ends.
std::string listed(std::span<const std::string> names) {
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

[[noreturn]] void reject_name(const std::string& name, std::span<const std::string> names) {
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw ExpressionError("an expression in " + listed(names),
                        "the unknown name " + quoted(name) + did_you_mean(nearest_name(name, views)));
}

/// Whether a text sets a variable, which an expression in muParser may.
bool assigns(std::string_view text) {
  constexpr std::string_view before = "=<>!";
  for (std::size_t at = text.find('='); at != std::string_view::npos; at = text.find('=', at + 1)) {
    const bool ends_comparison = at > 0 && before.find(text[at - 1]) != std::string_view::npos;
    const bool begins_comparison = at + 1 < text.size() && text[at + 1] == '=';
    if (!ends_comparison && !begins_comparison) return true;
  }
  return false;
}

}  // namespace

struct Expression::Parser : mu::Parser {
  Parser() {
    DefineConst("pi", std::numbers::pi);
    DefineFun(
        "fmod", +[](double a, double b) { return std::fmod(a, b); });
    DefineFun(
        "floor", +[](double a) { return std::floor(a); });
  }
};

Expression::~Expression() = default;

Expression::Expression(const std::string& text, std::span<const std::string> names)
    : parser_(std::make_unique<Parser>()) {
  const std::string expected =
      "an expression such as cos(" + names[std::min<std::size_t>(1, names.size() - 1)] + ") - 0.5";
  if (text.size() > longest_text) throw ExpressionError(expected, quoted(text) + ", which is too long");
  if (assigns(text)) throw ExpressionError(expected + ", which sets nothing", quoted(text));
  try {
    parser_->SetExpr(text);
    std::vector<std::string> used;
    for (const auto& [name, unused] : parser_->GetUsedVar()) used.push_back(name);
    values_.resize(used.size());
    for (std::size_t k = 0; k < used.size(); ++k) {
      auto found = std::ranges::find(names, used[k]);
      if (found == names.end()) found = std::ranges::find(names, present_name(used[k]));
      if (found == names.end()) reject_name(used[k], names);
      columns_.push_back(static_cast<std::size_t>(found - names.begin()));
      parser_->DefineVar(used[k], &values_[k]);
    }
    parser_->Eval();
    if (parser_->GetNumResults() != 1) throw ExpressionError(expected, quoted(text) + ", which is several");
  } catch (const mu::Parser::exception_type& error) {
    std::string why = error.GetMsg();
    if (why.ends_with('.')) why.pop_back();
    throw ExpressionError(expected, quoted(text) + ": " + why);
  }
}

double Expression::operator()(std::span<const double> row) {
  for (std::size_t k = 0; k < columns_.size(); ++k) values_[k] = row[columns_[k]];
  try {
    return parser_->Eval();
  } catch (const mu::Parser::exception_type&) {
    return std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace pendula::io
