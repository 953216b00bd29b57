#pragma once

#include <Eigen/Core>
#include <utility>

namespace pendula {

/// Coordinates and rates of a system at one time: the state as users give, get and store it.
struct Motion {
  double time = 0;    ///< s
  Eigen::VectorXd q;  ///< coordinates
  Eigen::VectorXd v;  ///< their rates
  /// The values that sampled feedback holds at this time (run/feedback.hpp); empty without such feedback, and at a
  /// start.
  Eigen::VectorXd held;

  Motion() = default;
  Motion(double at, Eigen::VectorXd coordinates, Eigen::VectorXd rates)
      : time(at), q(std::move(coordinates)), v(std::move(rates)) {}
  /// From any other state with a time, coordinates and rates, such as that of a chain.
  template <class Other>
  requires requires(const Other& other) { Eigen::VectorXd(other.q), Eigen::VectorXd(other.v), other.time; }
  Motion(const Other& other) : time(other.time), q(other.q), v(other.v) {}  // NOLINT(google-explicit-constructor)
};

}  // namespace pendula
