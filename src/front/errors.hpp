#pragma once

#include <pendula/pendula.h>

namespace pendula::front {

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
