#pragma once

namespace pendula {

/// Asked within steps that take long whether the run is to end; once yes, always yes. It holds nothing that flags of
/// compilers change: it passes between a program and the library.
struct StopSign {
  bool (*asked)(const void*) = nullptr;  ///< none: it never does
  const void* about = nullptr;           ///< handed to it

  bool operator()() const { return asked != nullptr && asked(about); }
};

/// That of a function, which has to live as long as it is asked.
template <class Stop>
StopSign stop_sign(const Stop& stop) {
  return {[](const void* about) -> bool { return (*static_cast<const Stop*>(about))(); }, &stop};
}

}  // namespace pendula
