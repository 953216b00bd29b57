#pragma once

#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <vector>

namespace pendula {

/// Accelerations of a chain in O(n), by the same elimination that gives rates from momenta.
///
/// Bob i is accelerated by forces of its two rods: tensions T_i ξ_i, and torques and damping across the rods:
///   ξ̈_i = b_i − b_{i−1} − δ_{i1} g up,  b_i = (F_i − F_{i+1})/m_i,  F_i = T_i ξ_i + (torque_i × ξ_i − λ_i ξ̇_i)/l_i²,
/// where T keeps the lengths: ξ_i·ξ̈_i = −|ξ̇_i|².
template <class Space>
class ChainForwardDynamics {
  using Link = typename Space::Link;
  using Rates = std::array<double, Space::dof>;
  using Cartesian = typename Link::template Cartesian<double>;
  using Trig = typename Link::template Trig<double>;

 public:
  explicit ChainForwardDynamics(const Chain<Space>& chain)
      : chain_(chain), constants_(chain), motions_(static_cast<std::size_t>(chain.links())) {
    chain_.torque(0, torque_);
  }

  /// q̈ at `time`, of angles and their rates; all (dof·n).
  void acceleration(double time, const double* q, const double* v, double* acceleration) {
    if (chain_.driven()) chain_.torque(time, torque_);
    for (int i = 0; i < chain_.links(); ++i) place(i, rates_of(i, q), rates_of(i, v));
    eliminate();
    double tension = motions_.front().row.offset;
    Cartesian before{};
    for (int i = 0; i < chain_.links(); ++i) {
      const bool last = i + 1 == chain_.links();
      const double next = last ? 0 : motion(i + 1).row.offset - motion(i + 1).row.coupling * tension;
      Cartesian bond = scaled(tension, motion(i).rod);
      if (!last) bond = difference(bond, scaled(next, motion(i + 1).rod));
      bond = scaled(constants_[i].inverse_mass.value, bond);
      const Cartesian rod_acceleration = sum(motion(i).free, difference(bond, before));
      const Rates a = of_coordinates(i, rates_of(i, v), scaled(constants_[i].inverse_length, rod_acceleration));
      for (std::size_t k = 0; k < a.size(); ++k) acceleration[entry(i, k)] = a[k];
      before = bond;
      tension = next;
    }
  }

 private:
  struct Motion {
    Trig trig;
    Cartesian rod, rate;
    Cartesian load;  // across the rod, over l²
    Cartesian free;  // its acceleration without tensions
    MultiplierRow<double> row;
  };

  Motion& motion(int i) { return motions_[static_cast<std::size_t>(i)]; }
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * chain_.links() + i; }

  Rates rates_of(int i, const double* values) const {
    Rates rates;
    for (std::size_t a = 0; a < rates.size(); ++a) rates[a] = values[entry(i, a)];
    return rates;
  }

  void place(int i, const Rates& q, const Rates& v) {
    Motion& here = motion(i);
    Link::trig(q, here.trig);
    Link::direction(here.trig, here.rod);
    Link::velocity(here.trig, v, here.rate);
    here.rod = scaled(chain_.lengths()[i], here.rod);
    here.rate = scaled(chain_.lengths()[i], here.rate);
    typename Link::template Torque<double> torque;
    for (std::size_t k = 0; k < torque.size(); ++k) torque[k] = torque_(static_cast<Eigen::Index>(k), i);
    Link::torque_load(torque, here.rod, here.load);
    here.load = difference(scaled(constants_[i].inverse_square, here.load), scaled(constants_[i].drag, here.rate));
  }

  // Eliminates the tensions from the tip to the pivot.
  void eliminate() {
    MultiplierRow<double> row;
    double beyond = 0;
    for (int i = chain_.links(); i-- > 0;) {
      Motion& here = motion(i);
      here.free = scaled(constants_[i].inverse_masses, here.load);
      if (i + 1 < chain_.links()) {
        here.free = difference(here.free, scaled(constants_[i].inverse_mass.value, motion(i + 1).load));
      }
      double before = 0;
      if (i == 0) {
        here.free.back() -= chain_.gravity();
      } else {
        const double inverse_mass = constants_[i - 1].inverse_mass.value;
        here.free = difference(here.free, scaled(inverse_mass, motion(i - 1).load));
        before = -inverse_mass * dot(motion(i - 1).rod, here.rod);
      }
      const double right = -(dot(here.rod, here.free) + dot(here.rate, here.rate));
      here.row = row = row.next(constants_[i].inverse_masses * dot(here.rod, here.rod), beyond, before, right);
      beyond = before;
    }
  }

  // Solves û̈ = Σ_a û_a q̈_a + Σ_ab û_ab q̇_a q̇_b for q̈.
  Rates of_coordinates(int i, const Rates& v, const Cartesian& direction_acceleration) {
    const Trig& trig = motion(i).trig;
    double determinant;
    Link::metric_determinant(trig, determinant);
    Rates a;
    Link::rates(trig, 1 / determinant, difference(direction_acceleration, turning(trig, v)), a);
    return a;
  }

  // Σ_ab û_ab v_a v_b; mixed terms count twice.
  static Cartesian turning(const Trig& trig, const Rates& v) {
    typename Link::template Second<double> u_ab;
    Link::direction_second(trig, u_ab);
    Cartesian turning{};
    std::size_t pair = 0;
    for (std::size_t a = 0; a < v.size(); ++a) {
      for (std::size_t b = a; b < v.size(); ++b) {
        turning = sum(turning, scaled((a == b ? 1 : 2) * v[a] * v[b], u_ab[pair++]));
      }
    }
    return turning;
  }

  Chain<Space> chain_;
  ChainLinks<Space> constants_;
  std::vector<Motion> motions_;
  Torque<Space, Eigen::Dynamic> torque_;
};

}  // namespace pendula
