#pragma once

#include <Eigen/Core>
#include <pendula/chain/space.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Angles and rates of a chain at one time, as users give and read them, in any floating-point type.
template <class Space, int N = Eigen::Dynamic, class Real = double>
struct State {
  double time = 0;                ///< s
  Coordinates<Space, N, Real> q;  ///< angles θ_1..θ_n, then in space φ_1..φ_n, (dof·n)  rad
  Coordinates<Space, N, Real> v;  ///< their rates, (dof·n)  rad/s

  State() = default;
  State(double at, const Coordinates<Space, N, Real>& angles, const Coordinates<Space, N, Real>& rates)
      : time(at), q(angles), v(rates) {}
  /// From any other state with a time, coordinates and rates.
  template <class Other>
  requires requires(const Other& other) {
    Coordinates<Space, N, Real>(other.q), Coordinates<Space, N, Real>(other.v), other.time;
  }
  State(const Other& other) : time(other.time), q(other.q), v(other.v) {}  // NOLINT(google-explicit-constructor)

  int links() const { return static_cast<int>(q.size()) / Space::dof; }
  auto theta() const { return q.head(links()); }
  auto theta_dot() const { return v.head(links()); }
  auto phi() const requires(Space::dof == 2) { return q.tail(links()); }
  auto phi_dot() const requires(Space::dof == 2) { return v.tail(links()); }

  /// The same state in another number type, each number rounded to it.
  template <class Other>
  State<Space, N, Other> cast() const {
    return {time, q.template cast<Other>(), v.template cast<Other>()};
  }

  /// A planar state, at rest unless rates are given.
  static State from_angles(const LinkVector<N, Real>& theta,
                           const LinkVector<N, Real>& theta_dot = {}) requires(Space::dof == 1) {
    return {0, theta, rates(theta_dot, theta.size())};
  }

  /// A spatial state, at rest unless rates are given.
  static State from_angles(const LinkVector<N, Real>& theta, const LinkVector<N, Real>& phi,
                           const LinkVector<N, Real>& theta_dot = {},
                           const LinkVector<N, Real>& phi_dot = {}) requires(Space::dof == 2) {
    if (phi.size() != theta.size()) throw_sizes("phi", phi.size(), theta.size());
    State state;
    state.q.resize(2 * theta.size());
    state.v.resize(2 * theta.size());
    state.q << theta, phi;
    state.v << rates(theta_dot, theta.size()), rates(phi_dot, theta.size());
    return state;
  }

 private:
  static LinkVector<N, Real> rates(const LinkVector<N, Real>& given, Eigen::Index links) {
    if (given.size() == links) return given;
    if (given.size() != 0) throw_sizes("rates", given.size(), links);
    return LinkVector<N, Real>::Zero(links);
  }

  [[noreturn]] static void throw_sizes(const char* name, Eigen::Index got, Eigen::Index expected) {
    throw std::invalid_argument(std::string("state: ") + name + ": expected " + std::to_string(expected) +
                                " numbers, got " + std::to_string(got));
  }
};

}  // namespace pendula
