#include <pendula/run/run_failed.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

void require(const Outcome& outcome, const Subject& subject) {
  if (!outcome) throw RunFailed(message(outcome, subject.coordinates(), subject.switches()));
}

}  // namespace pendula
