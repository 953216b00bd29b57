#pragma once

#include <pendula/system/plain_system.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Throws std::invalid_argument for a system with constraints, where what is asked for cannot keep them:
/// "method: expected gauss, got radau, for a system with constraints (loop_x, …)".
inline void require_no_constraints(const SystemInfo& info, const std::string& what) {
  if (info.constraints.empty()) return;
  const std::string more = info.constraints.size() > 1 ? ", ..." : "";
  throw std::invalid_argument(what + ", for a system with constraints (" + std::string(info.constraints.front()) +
                              more + ")");
}

}  // namespace pendula
