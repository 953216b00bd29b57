#pragma once

#include <cstdint>
#include <pendula/system/member.hpp>

namespace pendula {

/// Where a run can be continued: with the same subject, start and options, and any later end, as if it had never
/// stopped, to the last bit.
struct Checkpoint {
  double time = 0;             ///< of the state  [s]
  std::int64_t rows = 0;       ///< so far; rows written only because the run ended do not count
  std::int64_t since_row = 0;  ///< steps since the last row
  Member integrator;
  Member record;  ///< state of the rows and events (RunRecord, EventWatch)
};

}  // namespace pendula
