#pragma once

#include <Eigen/Core>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>

namespace pendula {

/// The linearisation at a motion: d(q, v)/dt = A (q, v) + B inputs, row by row, A (2n, 2n) and B (2n, inputs), exactly,
/// by the kernel's derivatives. Either may be null. Throws NoKernel for a chain without one, std::invalid_argument
/// where the mass matrix is singular.
void linearize(const Subject& subject, const Motion& motion, double* a, double* b);

/// Eigenvalues of A (size, size)  [1/s].
Eigen::VectorXcd eigenvalues(const double* a, Eigen::Index size);

/// An equilibrium, by Newton's method on the accelerations, from a motion near it. Coordinates that the accelerations
/// do not depend on keep their values. Throws NoKernel as linearize, std::invalid_argument where a system changes with
/// time, or where no equilibrium is found.
Motion equilibrium(const Subject& subject, const Motion& near);

}  // namespace pendula
