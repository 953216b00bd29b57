#pragma once

#include <Eigen/Core>
#include <pendula/space.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Angles and rates of a chain at one time, as users give and read them.
template <class Space, int N = Eigen::Dynamic>
struct State {
  double time = 0;          ///< s
  Coordinates<Space, N> q;  ///< angles θ_1..θ_n, then in space φ_1..φ_n, (dof·n)  rad
  Coordinates<Space, N> v;  ///< their rates, (dof·n)  rad/s

  int links() const { return static_cast<int>(q.size()) / Space::dof; }
  auto theta() const { return q.head(links()); }
  auto theta_dot() const { return v.head(links()); }
  auto phi() const requires(Space::dof == 2) { return q.tail(links()); }
  auto phi_dot() const requires(Space::dof == 2) { return v.tail(links()); }

  /// A planar state, at rest unless rates are given.
  static State from_angles(const LinkVector<N>& theta, const LinkVector<N>& theta_dot = {}) requires(Space::dof == 1) {
    return {0, theta, rates(theta_dot, theta.size())};
  }

  /// A spatial state, at rest unless rates are given.
  static State from_angles(const LinkVector<N>& theta, const LinkVector<N>& phi, const LinkVector<N>& theta_dot = {},
                           const LinkVector<N>& phi_dot = {}) requires(Space::dof == 2) {
    if (phi.size() != theta.size()) throw_sizes("phi", phi.size(), theta.size());
    State state;
    state.q.resize(2 * theta.size());
    state.v.resize(2 * theta.size());
    state.q << theta, phi;
    state.v << rates(theta_dot, theta.size()), rates(phi_dot, theta.size());
    return state;
  }

 private:
  static LinkVector<N> rates(const LinkVector<N>& given, Eigen::Index links) {
    if (given.size() == links) return given;
    if (given.size() != 0) throw_sizes("rates", given.size(), links);
    return LinkVector<N>::Zero(links);
  }

  [[noreturn]] static void throw_sizes(const char* name, Eigen::Index got, Eigen::Index expected) {
    throw std::invalid_argument(std::string("state: ") + name + ": expected " + std::to_string(expected) +
                                " numbers, got " + std::to_string(got));
  }
};

}  // namespace pendula
