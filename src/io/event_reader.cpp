#include "io/event_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <string_view>

#include "io/expression.hpp"
#include "io/input_error.hpp"

namespace pendula::io {
namespace {

constexpr std::array<std::string_view, 4> event_keys = {"name", "when", "direction", "stop"};
constexpr std::array<std::string_view, 3> direction_names = {"up", "down", "both"};

/// What can be a cell of a table and a part of a key.
bool is_name(std::string_view text) {
  return std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

EventPlan read_event(const Section& table) {
  EventPlan plan;
  const Entry name = table.require("name", "a name of letters, digits, _ and -");
  plan.name = name.text();
  if (!is_name(plan.name)) name.fail("a name of letters, digits, _ and -");
  const Entry when = table.require("when", "an expression that crosses zero where the event is, as \"x_1 - 0.5\"");
  plan.when = when.text();
  plan.place = when.place();
  if (const auto direction = table.find("direction")) {
    plan.direction = static_cast<Direction>(direction->choice(direction_names));
  }
  if (const auto stop = table.find("stop")) plan.stop = stop->truth();
  return plan;
}

/// A function of the motion that evaluates an expression in the columns of its row.
class RowFunction {
 public:
  RowFunction(std::shared_ptr<const Subject> subject, std::shared_ptr<Expression> expression, const Motion& start)
      : subject_(std::move(subject)), expression_(std::move(expression)) {
    subject_->append_row(start, {}, row_);
    const std::size_t of_motion = row_.size() - 1;  // without points; the last is the energy
    const auto is_observed = [&](std::size_t column) { return column >= of_motion; };
    observes_ = std::ranges::any_of(expression_->columns(), is_observed);
  }

  double operator()(const Motion& motion) {
    row_.clear();
    subject_->append_row(motion, observes_ ? subject_->observe(motion) : Observation(), row_);
    return (*expression_)(row_);
  }

 private:
  std::shared_ptr<const Subject> subject_;
  std::shared_ptr<Expression> expression_;
  std::vector<double> row_;
  bool observes_ = false;  // energy or points, which cost more than what the motion has
};

}  // namespace

std::vector<EventPlan> read_events(const Section& root) {
  std::vector<EventPlan> plans;
  const std::optional<Entry> entry = root.find("event");
  if (!entry) return plans;
  if (!entry->is_array()) entry->fail("[[event]] tables");
  for (std::size_t i = 0; i < entry->size(); ++i) {
    const Section table(entry->element(i), event_keys);
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
    } catch (const ExpressionError& error) {
      throw InputError(plan.place + ": expected " + error.expected + ", got " + error.got);
    }
  }
  return events;
}

}  // namespace pendula::io
