#pragma once

#include <pendula/pendula.h>

#include <cstddef>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/run_failed.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

namespace detail {

/// Throws the exception for the last error of pendula.h.
[[noreturn]] inline void throw_error(pendula_status status) {
  const std::string what = pendula_error();
  if (status == PENDULA_INVALID) throw std::invalid_argument(what);
  if (status == PENDULA_NO_KERNEL) throw NoKernel(what);
  if (status == PENDULA_FAILED) throw RunFailed(what);
  throw std::runtime_error(what);
}

/// Throws if `status` is a failure; returns it otherwise.
inline pendula_status require(pendula_status status) {
  if (status >= PENDULA_FAILED) throw_error(status);
  return status;
}

/// Throws if `thing` is null; returns it otherwise.
template <class Thing>
Thing* made(Thing* thing) {
  if (thing == nullptr) throw_error(pendula_error_kind());
  return thing;
}

/// Index of `name` in `names`. Throws std::invalid_argument that lists all names if it is not among them.
inline std::size_t place_of(const char* what, std::string_view name, const std::vector<std::string>& names) {
  std::string all;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (names[k] == name) return k;
    all += (k == 0 ? "" : ", ") + names[k];
  }
  throw std::invalid_argument(std::string(what) + ": expected one of " + all + ", got " + std::string(name));
}

inline void require_size(const char* what, std::size_t got, std::size_t expected) {
  if (got == expected) return;
  throw std::invalid_argument(std::string(what) + ": expected " + std::to_string(expected) + " numbers, got " +
                              std::to_string(got));
}

}  // namespace detail
}  // namespace pendula
