#pragma once

#include <map>
#include <memory>
#include <pendula/run/event.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/section.hpp"

namespace pendula::io {

/// An event as a scenario describes it. Its expression is read later, once the columns of the rows are known.
struct EventPlan {
  std::string name, when;
  Direction direction = Direction::both;
  bool stop = false;
  std::string place;  ///< `where: key` of `when`
};

/// Reads the tables [[event]] of a document. Throws InputError.
std::vector<EventPlan> read_events(const Section& root);

class Expression;

/// Parsed expressions, shared by the events of many runs in one thread.
using SharedExpressions = std::map<std::pair<std::string, std::vector<std::string>>, std::shared_ptr<Expression>>;

/// The events of a run of `subject` that begins at `start`. Throws InputError if an expression cannot be read, names an
/// unknown column, or is not finite at the start.
std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start);
/// The same for one of many runs.
std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start, SharedExpressions& shared);

}  // namespace pendula::io
