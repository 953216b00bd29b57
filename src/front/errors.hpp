#pragma once

#include <pendula/pendula.h>

#include <pendula/run/subject.hpp>
#include <pendula/system/outcome.hpp>
#include <stdexcept>
#include <string>

namespace pendula::front {

/// A run failed numerically; the message says how.
class RunFailure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws RunFailure unless the outcome is ok.
void require(const Outcome& outcome, const Subject& subject);

/// Keeps the message that pendula_error() returns in this thread. Returns `status`.
pendula_status fail(pendula_status status, const char* what) noexcept;

/// The same for the exception that is being handled.
pendula_status fail() noexcept;

/// Calls act(); an exception becomes a status.
template <class Do>
pendula_status guarded(Do&& act) noexcept {
  try {
    return act();
  } catch (...) {
    return fail();
  }
}

/// Calls make() and returns its result; null after an exception.
template <class Do>
auto made(Do&& make) noexcept -> decltype(make()) {
  try {
    return make();
  } catch (...) {
    fail();
    return nullptr;
  }
}

}  // namespace pendula::front
