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

/// An event as a scenario describes it; what its expression may name is known when what is moved is.
struct EventPlan {
  std::string name, when;
  Direction direction = Direction::both;
  bool stop = false;
  std::string place;  ///< `where: key` of `when`
};

/// The tables [[event]] of a document. Throws InputError.
std::vector<EventPlan> read_events(const Section& root);

class Expression;

/// Expressions that events of many runs share, one thread's.
using SharedExpressions = std::map<std::pair<std::string, std::vector<std::string>>, std::shared_ptr<Expression>>;

/// Those of a run of `subject` that begins at `start`. Throws InputError where an expression is none, names what no row
/// has, or has no finite value at the start.
std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start);
/// The same of one of many runs.
std::vector<Event> events_of(const std::vector<EventPlan>& plans, const std::shared_ptr<const Subject>& subject,
                             const Motion& start, SharedExpressions& shared);

}  // namespace pendula::io
