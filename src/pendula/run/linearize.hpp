#pragma once

#include <Eigen/Core>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula {

/// Coordinates and rates from which the others follow by constraints, beside a motion; without constraints all of them.
/// They are the first ones of a system from which others follow well. With x those of them,
///   (δq, δv) = basis δx.
struct Independent {
  std::vector<Eigen::Index> places;  ///< ascending, in (q, v)
  Directions<> basis;                ///< (2n x d), d of them

  /// Those of the rows of a matrix (2n x any) that are of x.
  Directions<> rows(const Directions<>& of_all) const { return of_all(places, Eigen::all); }
};

Independent find_independent(const Subject& subject, const Motion& motion);

/// The linearisation at a motion: dx/dt = A x + B inputs, in deviations x of independent coordinates and rates.
struct Linearized {
  Independent independent;
  Directions<> a, b;  ///< (d x d), (d x inputs)
};

/// It is exact, by the kernel's derivatives. Throws NoKernel for a chain without one, std::invalid_argument where the
/// mass matrix is singular.
Linearized linearize(const Subject& subject, const Motion& motion);

/// Eigenvalues of A  [1/s].
Eigen::VectorXcd eigenvalues(const Directions<>& a);

/// An equilibrium, by Newton's method on the forces, from a motion near it. Coordinates that the forces do not depend
/// on keep their values. Throws NoKernel as linearize, std::invalid_argument where a system changes with
/// time, or where no equilibrium is found.
Motion equilibrium(const Subject& subject, const Motion& near);

}  // namespace pendula
