#pragma once

#include <pendula/run/system_subject.hpp>
#include <pendula/system/motion.hpp>
#include <string>
#include <vector>

namespace pendula {

/// Which coordinates and rates of a start are found.
struct FreeNumbers {
  std::vector<bool> coordinates, rates;
};

/// Brings a start onto the constraints of its system, at its time: by the least change of the coordinates that are
/// free, then by those free rates that have the least kinetic energy. Returns what is left over where that cannot be, a
/// sentence; empty where it is done.
std::string assemble(const SystemSubject& system, const FreeNumbers& free, Motion& start);

/// Brings a motion back onto the constraints of its system: by the least change of the coordinates that are free, then
/// by the change of rates that has the least kinetic energy. Returns what is left over, as `assemble` does.
std::string bring_back(const SystemSubject& system, const std::vector<bool>& free, Motion& motion);

/// How many constraints do not follow from others in a state; `least`: what of one, relative to it, is still its own.
int independent_constraints(const SystemSubject& system, Motion state, double least = 1e-10);

}  // namespace pendula
