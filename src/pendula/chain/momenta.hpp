#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/space.hpp>
#include <pendula/chain/state.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace pendula {

/// Conjugate momenta p = ∂L/∂v, (dof·n)  [N m s]: those of link i are l_i ∂û_i/∂q · P_i, P_i = Σ_{j≥i} m_j ṙ_j.
template <class Space>
Coordinates<Space, Eigen::Dynamic> momenta(const Chain<Space>& chain, const State<Space>& state) {
  const int n = chain.links();
  const Points<Space, Eigen::Dynamic> velocities = bob_velocities(chain, state);
  Coordinates<Space, Eigen::Dynamic> p(Space::dof * n);
  Eigen::Matrix<double, Space::dimension, 1> P = Eigen::Matrix<double, Space::dimension, 1>::Zero();
  for (int i = n; i-- > 0;) {
    P += chain.masses()[i] * velocities.col(i);
    const detail::LinkMotion<Space, double> link(state, n, i);
    for (int a = 0; a < Space::dof; ++a) p[a * n + i] = chain.lengths()[i] * link.derivatives.col(a).dot(P);
  }
  return p;
}

namespace detail {

/// Whether φ of a link is undefined: sin θ = 0, up to rounding.
template <class Space>
bool at_pole(double theta) {
  constexpr double rounding = 4 * std::numeric_limits<double>::epsilon();
  return Space::dof == 2 && std::abs(std::sin(theta)) <= rounding * (1 + std::abs(theta));
}

/// P of all bobs from a link on, linear in the velocity V of the bob before it: P = inertia V + bias.
template <class Space>
struct CarriedMomentum {
  Eigen::Matrix<double, Space::dimension, Space::dimension> inertia =
      Eigen::Matrix<double, Space::dimension, Space::dimension>::Zero();
  Eigen::Matrix<double, Space::dimension, 1> bias = Eigen::Matrix<double, Space::dimension, 1>::Zero();
};

/// The rates of one link, linear in the velocity V of the bob before it, from its momenta p = Jᵀ P and from what it
/// carries, P = B (V + J v) + bias:  v = D⁻¹ (p − Jᵀ bias − (B J)ᵀ V),  D = Jᵀ B J. At a pole the last rate is zero.
template <class Space>
class LinkRates {
  using Lever = Eigen::Matrix<double, Space::dimension, Space::dof>;
  using Vector = Eigen::Matrix<double, Space::dimension, 1>;
  using Rates = Eigen::Matrix<double, Space::dof, 1>;

 public:
  /// J  l ∂û/∂q. `carried` is given behind the link, with the mass of its bob, and becomes that before the link.
  LinkRates(const Lever& J, bool at_pole, const Rates& p, CarriedMomentum<Space>& carried)
      : J_(J), BJ_(carried.inertia * J), D_inverse_(decltype(D_inverse_)::Zero()) {
    const Eigen::Matrix<double, Space::dof, Space::dof> D = J.transpose() * BJ_;
    if (at_pole) {
      D_inverse_(0, 0) = 1 / D(0, 0);
    } else {
      D_inverse_ = D.inverse();
    }
    constant_ = D_inverse_ * (p - J.transpose() * carried.bias);
    carried.bias += BJ_ * constant_;
    // In the form Pᵀ B P: B − BJ D⁻¹ (BJ)ᵀ is the same, but its rounding errors grow from link to link.
    using Inertia = decltype(carried.inertia);
    const Inertia passed_on = Inertia::Identity() - J * D_inverse_ * BJ_.transpose();
    const Inertia square = passed_on.transpose() * carried.inertia * passed_on;
    carried.inertia = (square + square.transpose()) / 2;
  }

  /// The rates if the bob before moves with V. V becomes the velocity of the bob of this link.
  Rates operator()(Vector& V) const {
    Rates rates = constant_ - D_inverse_ * (BJ_.transpose() * V);
    V += J_ * rates;
    return rates;
  }

 private:
  Lever J_, BJ_;
  Eigen::Matrix<double, Space::dof, Space::dof> D_inverse_;
  Rates constant_;
};

}  // namespace detail

/// The rates that go with the momenta p, (dof·n)  [rad/s]: M(q) v = p, in O(n) by elimination along the chain. At a
/// pole p_φ is zero whatever the rate of φ, which is then set to zero. Throws std::invalid_argument, naming the link,
/// where such a p_φ is not zero.
template <class Space>
Coordinates<Space, Eigen::Dynamic> rates_from_momenta(const Chain<Space>& chain,
                                                      const Coordinates<Space, Eigen::Dynamic>& q,
                                                      const Coordinates<Space, Eigen::Dynamic>& p) {
  const int n = chain.links();
  const State<Space> placed{0, q, Coordinates<Space, Eigen::Dynamic>::Zero(q.size())};
  std::vector<detail::LinkRates<Space>> links;  // from the last to the first
  links.reserve(static_cast<std::size_t>(n));
  detail::CarriedMomentum<Space> carried;
  for (int i = n; i-- > 0;) {
    Eigen::Matrix<double, Space::dof, 1> of_link;
    for (int a = 0; a < Space::dof; ++a) of_link[a] = p[a * n + i];
    const bool at_pole = detail::at_pole<Space>(q[i]);
    if (at_pole && of_link[Space::dof - 1] != 0) {
      throw std::invalid_argument("link " + std::to_string(i + 1) + ": expected 0 where sin(theta) = 0");
    }
    carried.inertia.diagonal().array() += chain.masses()[i];
    const detail::LinkMotion<Space, double> motion(placed, n, i);
    links.emplace_back(chain.lengths()[i] * motion.derivatives, at_pole, of_link, carried);
  }
  Coordinates<Space, Eigen::Dynamic> v(q.size());
  Eigen::Matrix<double, Space::dimension, 1> V = Eigen::Matrix<double, Space::dimension, 1>::Zero();
  for (int i = 0; i < n; ++i) {
    const auto rates = links[static_cast<std::size_t>(n - 1 - i)](V);
    for (int a = 0; a < Space::dof; ++a) v[a * n + i] = rates[a];
  }
  return v;
}

}  // namespace pendula
