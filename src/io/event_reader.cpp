#include "io/event_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <string_view>

#include "io/expression.hpp"
#include "io/input_error.hpp"

namespace pendula::io {
namespace {

/// Whether a text can be a cell of a CSV table and a part of a key.
bool is_name(std::string_view text) {
  return std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

EventPlan read_event(const Section& table) {
  EventPlan plan;
  const Entry name = table.require("name");
  plan.name = name.text();
  if (!is_name(plan.name)) name.fail(std::string(find_key("event.name")->hint));
  const Entry when = table.require("when");
  plan.when = when.text();
  plan.place = when.place();
  plan.direction = table.option<Direction>("direction");
  plan.stop = table.truth("stop");
  return plan;
}

/// A function of the motion: an expression in the columns of its row.
class RowFunction : public Formula {
 public:
  RowFunction(std::shared_ptr<const Subject> subject, std::shared_ptr<Expression> expression, const Motion& start)
      : subject_(std::move(subject)), expression_(std::move(expression)), numbers_(columns().size()) {
    subject_->append_row(start, {}, row_);
    const std::size_t of_motion = row_.size() - 1;  // columns other than points and energy
    const auto is_observed = [&](std::size_t column) { return column >= of_motion; };
    observes_ = std::ranges::any_of(columns(), is_observed);
    has_time_ = std::ranges::find(columns(), time_column) != columns().end();
    reaches_.resize(columns().size());
  }

  double operator()(const Motion& motion) {
    take_row(motion);
    for (std::size_t k = 0; k < numbers_.size(); ++k) numbers_[k] = row_[columns()[k]];
    return (*expression_)(numbers_);
  }

  std::size_t size() const override { return columns().size() - (has_time_ ? 1 : 0); }

  void read(const Motion& motion, std::span<double> numbers) override {
    take_row(motion);
    auto number = numbers.begin();
    for (const std::size_t column : columns()) {
      if (column != time_column) *number++ = row_[column];
    }
  }

  double value(double time, std::span<const double> numbers) override {
    return (*expression_)(with_time(time, numbers, numbers_));
  }
  Reach reach(const Reach& time, std::span<const Reach> numbers) override {
    return (*expression_)(with_time(time, numbers, reaches_));
  }

 private:
  static constexpr std::size_t time_column = 0;

  const std::vector<std::size_t>& columns() const { return expression_->columns(); }

  void take_row(const Motion& motion) {
    row_.clear();
    subject_->append_row(motion, observes_ ? subject_->observe(motion) : Observation(), row_);
  }

  /// In the order of columns.
  template <class Number>
  std::span<const Number> with_time(const Number& time, std::span<const Number> others, std::vector<Number>& all) {
    auto other = others.begin();
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = columns()[k] == time_column ? time : *other++;
    return all;
  }

  std::shared_ptr<const Subject> subject_;
  std::shared_ptr<Expression> expression_;
  std::vector<double> row_, numbers_;  // all columns of a row; the columns of the expression
  std::vector<Reach> reaches_;
  bool observes_ = false;  // whether the expression needs energy or points, which cost more
  bool has_time_ = false;
};

}  // namespace

std::vector<EventPlan> read_events(const Section& root) {
  std::vector<EventPlan> plans;
  for (const Section& table : root.each("event")) {
    EventPlan plan = read_event(table);
    const auto same = [&](const EventPlan& other) { return other.name == plan.name; };
    if (std::ranges::any_of(plans, same)) table.find("name")->fail("a name that no event before it has");
    plans.push_back(std::move(plan));
  }
  return plans;
}

std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start) {
  SharedExpressions shared;
  return events_of(plans, subject, start, shared);
}

std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start, SharedExpressions& shared) {
  std::vector<Event> events;
  if (plans.empty()) return events;
  const std::vector<std::string> names = subject->columns();
  for (const EventPlan& plan : plans) {
    try {
      std::shared_ptr<Expression>& expression = shared[{plan.when, names}];
      if (!expression) expression = std::make_shared<Expression>(plan.when, names);
      const auto function = std::make_shared<RowFunction>(subject, expression, start);
      const double value = (*function)(start);
      if (!std::isfinite(value)) {
        throw ExpressionError("an expression that is finite at the start", shortest(value) + " there");
      }
      events.push_back(
          {plan.name, [function](const Motion& motion) { return (*function)(motion); }, plan.direction, plan.stop});
      if (!expression->is_plain()) events.back().formula = function;
    } catch (const ExpressionError& error) {
      throw InputError(plan.place + ": expected " + error.expected + ", got " + error.got);
    }
  }
  return events;
}

}  // namespace pendula::io
