#pragma once

namespace bench {

/// Nanoseconds of one scalar std::sin and std::cos of the same argument, random in [-4, 4]: the unit that costs are
/// given in, so that they mean something on another machine. Takes under a millisecond.
double sincos_nanoseconds();

/// The unit as a benchmark of its own.
void register_unit();

}  // namespace bench
