#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula {

/// Coordinates from which the others follow by constraints, beside a motion; without constraints all of them. They are
/// the first ones of a system from which others follow well. With x = (these coordinates, their rates),
///   (δq, δv) = basis δx.
struct Independent {
  std::vector<std::size_t> coordinates;  ///< ascending, of the system's
  Directions<> basis;                    ///< (2n x 2d), d of them

  /// Those of the rows of a matrix (2n x any) that are of x.
  Directions<> rows(const Directions<>& of_all) const;
};

Independent find_independent(const Subject& subject, const Motion& motion);

/// The linearisation at a motion: dx/dt = A x + B inputs, in deviations x of independent coordinates and their rates.
struct Linearized {
  Independent independent;
  Directions<> a, b;  ///< (2d x 2d), (2d x inputs)
};

/// It is exact, by the kernel's derivatives. Throws NoKernel for a chain without one, std::invalid_argument where the
/// mass matrix is singular.
Linearized linearize(const Subject& subject, const Motion& motion);

/// Eigenvalues of A  [1/s].
Eigen::VectorXcd eigenvalues(const Directions<>& a);

/// An equilibrium, by Newton's method on the accelerations, from a motion near it. Coordinates that the accelerations
/// do not depend on keep their values. Throws NoKernel as linearize, std::invalid_argument where a system changes with
/// time, or where no equilibrium is found.
Motion equilibrium(const Subject& subject, const Motion& near);

}  // namespace pendula
