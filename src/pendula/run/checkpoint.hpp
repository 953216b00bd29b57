#pragma once

#include <cstdint>
#include <pendula/system/member.hpp>

namespace pendula {

/// Where a run may go on from: with the same subject, start and options, and to any end that is later, as if it had
/// never stopped, to the last bit.
struct Checkpoint {
  double time = 0;             ///< of the state  [s]
  std::int64_t rows = 0;       ///< that the run had come by; later ones are there only because it ended
  std::int64_t since_row = 0;  ///< steps since the last of them
  Member integrator;
  Member record;  ///< of the rows and the events (RunRecord, EventWatch)
};

}  // namespace pendula
