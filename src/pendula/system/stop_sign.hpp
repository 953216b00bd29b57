#pragma once

namespace pendula {

/// Asked within long steps whether the run should end; once true, it stays true. Its layout does not depend on compiler
/// flags, since it passes between a program and the library.
struct StopSign {
  bool (*asked)(const void*) = nullptr;  ///< null: never stops
  const void* about = nullptr;           ///< argument of `asked`

  bool operator()() const { return asked != nullptr && asked(about); }
};

/// With fewer links or coordinates a step, or an iteration, takes less time than to ask for the sign.
inline constexpr int quick_parts = 1000;

/// A StopSign that asks `stop`, which must outlive it.
template <class Stop>
StopSign stop_sign(const Stop& stop) {
  return {[](const void* about) -> bool { return (*static_cast<const Stop*>(about))(); }, &stop};
}

}  // namespace pendula
