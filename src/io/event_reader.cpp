#include "io/event_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <string_view>

#include "io/errors.hpp"
#include "io/expression.hpp"
#include "io/row_function.hpp"

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

/// Inputs with feedback or signals may change faster than the motion, and jump: no event is found on them.
void require_unfed(const Expression& expression, const Subject& subject, const std::vector<std::string>& names) {
  for (const std::size_t column : subject.fed_columns()) {
    if (std::ranges::find(expression.columns(), column) == expression.columns().end()) continue;
    throw ExpressionError("an expression without inputs that have feedback or signals (write what is fed back)",
                          names[column]);
  }
}

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
      require_unfed(*expression, *subject, names);
      const auto function = std::make_shared<RowFunction>(subject, expression, start);
      const double value = (*function)(start);
      if (!std::isfinite(value)) {
        throw ExpressionError("an expression that is finite at the start", shortest(value) + " there");
      }
      events.push_back(
          {plan.name, [function](const Motion& motion) { return (*function)(motion); }, plan.direction, plan.stop});
      if (!expression->is_plain()) events.back().formula = function;
      if (function->can_enclose()) {
        events.back().enclose = [function](const MotionRange& range) { return function->enclose(range); };
      }
    } catch (const ExpressionError& error) {
      throw InputError(plan.place + ": expected " + error.expected + ", got " + error.got);
    }
  }
  return events;
}

}  // namespace pendula::io
