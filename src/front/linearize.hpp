#pragma once

#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>

namespace pendula::front {

/// How a motion changes beside where it is: d(q, v)/dt = A (q, v) + B inputs, row by row, A (2n, 2n) and B (2n,
/// inputs), exactly, by the kernel's derivatives. Either may be null. Throws NoKernel for a chain without one,
/// std::invalid_argument where the mass matrix is singular.
void linearize(const Subject& subject, const Motion& motion, double* a, double* b);

}  // namespace pendula::front
