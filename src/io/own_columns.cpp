#include "io/own_columns.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <pendula/run/quantity.hpp>
#include <span>
#include <string_view>
#include <utility>

#include "io/expression.hpp"
#include "io/expression_operations.hpp"

namespace pendula::io {
namespace {

/// Whether a text can be a name in an expression.
bool is_expression_name(std::string_view text) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto is_inside = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !text.empty() && is_letter(text.front()) && std::ranges::all_of(text, is_inside);
}

bool is_taken(const std::string& name, const Subject& subject) {
  const std::vector<std::string> columns = subject.columns();
  const std::vector<Quantity> quantities = subject.quantities();
  return name == "pi" || operation_named(name) != nullptr || std::ranges::find(columns, name) != columns.end() ||
         std::ranges::find(quantities, name, &Quantity::name) != quantities.end();
}

/// An expression that several threads may ask for its value.
class Guarded {
 public:
  Guarded(const std::string& text, const std::vector<std::string>& names)
      : expression_(text, names), numbers_(expression_.columns().size()) {}

  double operator()(std::span<const double> row) {
    const std::scoped_lock lock(guard_);
    for (std::size_t k = 0; k < numbers_.size(); ++k) numbers_[k] = row[expression_.columns()[k]];
    return expression_(numbers_);
  }

 private:
  Expression expression_;
  std::vector<double> numbers_;
  std::mutex guard_;
};

}  // namespace

std::vector<ColumnPlan> read_columns(const Section& output) {
  std::vector<ColumnPlan> plans;
  const std::optional<Entry> columns = output.find("columns");
  if (!columns) return plans;
  if (columns->table() == nullptr) columns->fail("a table of expressions by name, { height = \"1 - cos(theta_1)\" }");
  for (const auto& [key, node] : *columns->table()) {
    const Entry value = columns->member(key.str());
    if (!is_expression_name(key.str())) {
      throw InputError(value.where(), columns->name(), "names of letters, digits and _ that begin with a letter",
                       toml_string(key.str()));
    }
    plans.push_back({std::string(key.str()), value.text(), value.place()});
  }
  return plans;
}

std::vector<OwnColumn> own_columns(const std::vector<ColumnPlan>& plans, const Subject& subject) {
  std::vector<OwnColumn> columns;
  for (const ColumnPlan& plan : plans) {
    if (is_taken(plan.name, subject)) {
      throw InputError(plan.place + ": expected a name that no column and no function has, got \"" + plan.name + '"');
    }
    try {
      const auto value = std::make_shared<Guarded>(plan.value, subject.columns());
      columns.push_back({plan.name, plan.value, [value](std::span<const double> row) { return (*value)(row); }});
    } catch (const ExpressionError& error) {
      throw InputError(plan.place + ": expected " + error.expected + ", got " + error.got);
    }
  }
  return columns;
}

}  // namespace pendula::io
