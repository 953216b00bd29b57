#pragma once

#include <stdexcept>

namespace pendula {

struct Outcome;
class Subject;

/// The mathematics of a run failed: a step did not converge, or a start is singular. The message says how.
class RunFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws RunFailed unless a step of a subject went well.
void require(const Outcome& outcome, const Subject& subject);

}  // namespace pendula
