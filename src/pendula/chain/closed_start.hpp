#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/end_force.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/held_rods.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/numeric/number_text.hpp>
#include <string>

namespace pendula {

/// Starts of chains whose last bob is held.
template <class Space>
class ClosedStart {
  static constexpr int D = Space::dimension;
  using Vector = Eigen::Matrix<double, D, 1>;
  using Matrix = Eigen::Matrix<double, D, D>;

 public:
  explicit ClosedStart(const Chain<Space>& chain) : chain_(chain), length_(chain.lengths().sum()) {}

  /// Where the hook should be instead, if no angles close at a time; empty where some do.
  std::string against(double time) const {
    const double far = place(time).norm(), longest = chain_.lengths().maxCoeff();
    if (far > length_) {
      return "a point within " + shortest(length_) + " of the pivot, the length of the chain";
    }
    if (longest - (length_ - longest) > far) {
      return "a point that the last bob reaches: a link of " + shortest(longest) +
             " is longer than all others and the way there together";
    }
    return "";
  }

  /// How far the last bob is from its hook  [m].
  double gap(const State<Space>& state) const { return lacking(state).norm(); }

  /// Brings the angles of a state that nearly closes to where the last bob is at its hook, by the least change, and
  /// then rates by that of the least kinetic energy. False if an angle would change by more than `farthest`, or it
  /// cannot be.
  bool close(State<Space>& state) const {
    const State<Space> given = state;
    double left = gap(state);
    for (int correction = 0; correction < most_corrections && left > 0; ++correction) {
      const State<Space> before = state;
      correct(state);
      const double now = gap(state);
      if (!(now < left)) {
        state.q = before.q;
        break;
      }
      left = now;
      if (!((state.q - given.q).cwiseAbs().maxCoeff() <= farthest)) return false;
    }
    if (!(left <= enough * length_)) return false;
    close_rates(state);
    return true;
  }

  /// Whether a state that closes is stretched straight between its ends, so that it cannot move.
  bool is_straight(const State<Space>& state) const {
    constexpr double least = 1e-9;  // how far the last bob gives way along its rod, relative to across
    const PlacedRods<Space> placed(chain_, state);
    const auto tip = HeldRods<RodState<Space>>::find_tip(placed.rods, placed.constants, [](int) { return 0.0; });
    return !(tip.mobility.along() > least);
  }

  /// Sets angles to those at which a chain hangs at rest between its hooks; empty if done, else what is expected
  /// instead.
  std::string hang(State<Space>& state) const {
    const double g = chain_.gravity();
    if (g == 0) return "some gravity, by which a chain hangs";
    const Vector hook = place(state.time);
    if (!(hook.template head<D - 1>().norm() > upright * length_)) {
      return "a point beside the vertical through the pivot: on it a chain hangs folded";
    }
    if (!(hook.norm() < (1 - upright) * length_)) return "a point nearer to the pivot than the chain is long";
    const double weight = std::abs(g) * chain_.mass_below()[0];
    Vector force = hook.normalized() * weight;
    force[D - 1] += g * chain_.mass_below()[0] / 2;
    for (int correction = 0; correction < most_corrections; ++correction) {
      const Pull pull = pull_of(force);
      const Vector lacking = hook - pull.gradient;
      if (lacking.norm() <= enough * length_ / 10) break;
      const Vector change = pull.hessian.fullPivLu().solve(lacking);
      const double value = pull.value - force.dot(hook), slope = change.dot(lacking);
      double part = 1;
      while (part > 1e-12) {
        const Vector next = force + part * change;
        const Pull there = pull_of(next);
        // Near the solution the value changes by its rounding alone; what is lacking still tells.
        if (there.value - next.dot(hook) <= value - part * slope / 10) break;
        if ((hook - there.gradient).norm() < lacking.norm() / 2) break;
        part /= 2;
      }
      if (part <= 1e-12) break;
      force += part * change;
    }
    const int links = chain_.links();
    for (int i = 0; i < links; ++i) {
      const Vector u = tension(force, i).normalized();
      std::array<double, static_cast<std::size_t>(D)> direction;
      std::copy_n(u.data(), D, direction.data());
      std::array<double, Space::dof> q;
      Space::Link::coordinates(direction, q);
      for (int a = 0; a < Space::dof; ++a) state.q[a * links + i] = q[static_cast<std::size_t>(a)];
    }
    if (close(state)) return "";
    return "a point between which and the pivot the chain's equilibrium is found";
  }

 private:
  static constexpr int most_corrections = 400;
  static constexpr double farthest = 0.5;  // rad
  static constexpr double enough = 1e-13;  // of the length
  static constexpr double upright = 1e-9;  // of the length

  Vector place(double time) const {
    Vector at;
    for (int k = 0; k < D; ++k) at[k] = chain_.end()->place(static_cast<std::size_t>(k), time);
    return at;
  }
  Vector rate(double time) const {
    Vector at;
    for (int k = 0; k < D; ++k) at[k] = chain_.end()->rate(static_cast<std::size_t>(k), time);
    return at;
  }

  // Where the hook is from the last bob.
  Vector lacking(const State<Space>& state) const {
    Vector last = Vector::Zero();
    for_each_bob(chain_, state, [&](int, const auto& position, const auto&) { last = position; });
    return place(state.time) - last;
  }

  // One of Newton's corrections.
  void correct(State<Space>& state) const {
    const int links = chain_.links();
    Matrix square = Matrix::Zero();
    const auto slope = [&](int i) -> Eigen::Matrix<double, D, Space::dof> {
      return chain_.lengths()[i] * detail::LinkMotion<Space, double>(state, links, i).derivatives;
    };
    for (int i = 0; i < links; ++i) square += slope(i) * slope(i).transpose();
    const Vector found = square.fullPivLu().solve(lacking(state));
    const State<Space> from = state;
    for (int i = 0; i < links; ++i) {
      const Eigen::Matrix<double, Space::dof, 1> change =
          chain_.lengths()[i] * detail::LinkMotion<Space, double>(from, links, i).derivatives.transpose() * found;
      for (int a = 0; a < Space::dof; ++a) state.q[a * links + i] += change[a];
    }
  }

  void close_rates(State<Space>& state) const {
    Vector fastest = Vector::Zero();
    for_each_bob(chain_, state, [&](int, const auto&, const auto& velocity) { fastest = velocity; });
    const Vector wanted = rate(state.time);
    if (fastest == wanted) return;
    PlacedRods<Space> placed(chain_, state);
    std::array<double, static_cast<std::size_t>(D)> hook;
    std::copy_n(wanted.data(), D, hook.data());
    HeldRods<RodState<Space>>::push_to_rate(placed.rods, placed.constants, hook);
    const int links = chain_.links();
    placed.rods.for_each_rate(placed.constants, [&](int i, const auto& rod_rate, const double&) {
      using Wide = typename RodState<Space>::Wide;
      std::array<Wide, Space::dof> near;
      for (std::size_t a = 0; a < near.size(); ++a) near[a] = Wide(state.q[static_cast<Eigen::Index>(a) * links + i]);
      const auto angles = user_angles(placed.rods.heading(0, i, rod_rate), near);
      for (std::size_t a = 0; a < near.size(); ++a) {
        state.v[static_cast<Eigen::Index>(a) * links + i] = static_cast<double>(angles.v[a]);
      }
    });
  }

  // The tension of a rod of a chain at rest, by the force at its end.
  Vector tension(const Vector& force, int i) const {
    Vector tension = force;
    tension[D - 1] -= chain_.gravity() * chain_.mass_below()[i];
    return tension;
  }
  // Σ l |T|, whose gradient by the force at the end is where the last bob is.
  struct Pull {
    double value = 0;
    Vector gradient = Vector::Zero();
    Matrix hessian = Matrix::Zero();
  };
  Pull pull_of(const Vector& force) const {
    Pull pull;
    for (int i = 0; i < chain_.links(); ++i) {
      const Vector T = tension(force, i);
      const double size = std::max(T.norm(), std::numeric_limits<double>::min());
      const Vector u = T / size;
      pull.value += chain_.lengths()[i] * size;
      pull.gradient += chain_.lengths()[i] * u;
      pull.hessian += chain_.lengths()[i] / size * (Matrix::Identity() - u * u.transpose());
    }
    return pull;
  }

  const Chain<Space>& chain_;
  double length_;
};

}  // namespace pendula
