#pragma once

#include <algorithm>
#include <pendula/forward_dynamics.hpp>
#include <pendula/gauss/chain_sweep.hpp>
#include <vector>

namespace pendula {

/// Accelerations of a chain in O(n), by the sweep that gives velocities from momenta.
///
/// With p_a = l û_a·G, the rate of p and the force f share y_a·(l G), and what remains is û_a·(l Ġ) = û_a·R, R the
/// load. The bobs accelerate by ẇ_i = Σ_{j≤i} l_j (Σ_a û_a q̈_a + Σ_ab û_ab q̇_a q̇_b), so that q̈ belongs to the momentum
/// û_a·(R − l Σ_{j≥i} m_j b_j), b the accelerations that q̈ = 0 would give.
template <class Space>
class ChainForwardDynamics : public ForwardDynamics {
  using Link = typename Space::Link;
  using Rates = std::array<double, Space::dof>;
  using Cartesian = typename Link::template Cartesian<double>;
  using Trig = typename Link::template Trig<double>;

 public:
  explicit ChainForwardDynamics(const Chain<Space>& chain)
      : chain_(chain), constants_(chain), sweep_(chain.links()), motions_(static_cast<std::size_t>(chain.links())) {
    chain_.torque(0, torque_);
  }

  void acceleration(double time, const double* q, const double* v, double* acceleration) override {
    if (chain_.driven()) chain_.torque(time, torque_);
    Cartesian b{}, below{};
    for (int i = 0; i < chain_.links(); ++i) {
      motion(i).trig = trig_of(i, q);
      b = sum(b, scaled(chain_.lengths()[i], turning(motion(i).trig, rates_of(i, v))));
      motion(i).b = b;
    }
    typename TensionSweep<Space, double>::Inward next;
    for (int i = chain_.links(); i-- > 0;) {
      below = sum(below, scaled(chain_.masses()[i], motion(i).b));
      inward(next, i, below, rates_of(i, v));
    }
    typename TensionSweep<Space, double>::Outward before;
    for (int i = 0; i < chain_.links(); ++i) {
      const Motion& here = motion(i);
      Cartesian u_ddot, G;
      Rates a;
      sweep_.outward(before, i, constants_[i], here.u, motion(std::min(i + 1, chain_.links() - 1)).u, here.across,
                     u_ddot, G);
      Link::rates(here.trig, here.inverse_determinant, u_ddot, a);
      for (std::size_t k = 0; k < a.size(); ++k) acceleration[entry(i, k)] = a[k];
    }
  }

 private:
  struct Motion {
    Trig trig;
    Cartesian b, u, across;
    double inverse_determinant;
  };

  Motion& motion(int i) { return motions_[static_cast<std::size_t>(i)]; }
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * chain_.links() + i; }

  Rates rates_of(int i, const double* values) const {
    Rates rates;
    for (std::size_t a = 0; a < rates.size(); ++a) rates[a] = values[entry(i, a)];
    return rates;
  }

  Trig trig_of(int i, const double* q) const {
    Trig trig;
    Link::trig(rates_of(i, q), trig);
    return trig;
  }

  // Σ_ab û_ab v_a v_b, each pair of different coordinates counted twice.
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

  void inward(typename TensionSweep<Space, double>::Inward& next, int i, const Cartesian& below, const Rates& v) {
    const Trig& trig = motion(i).trig;
    Cartesian load = constants_.template weight<double>(i);
    typename Link::template Torque<double> torque;
    for (std::size_t k = 0; k < torque.size(); ++k) torque[k] = torque_(static_cast<Eigen::Index>(k), i);
    if (chain_.loaded()) constants_.add_loads(i, torque, trig, v, load);
    load = sum(load, scaled(-chain_.lengths()[i], below));

    double determinant;
    Link::metric_determinant(trig, determinant);
    motion(i).inverse_determinant = 1 / determinant;
    typename Link::template First<double> u_a;
    Link::direction_first(trig, u_a);
    Rates p;
    for (std::size_t a = 0; a < p.size(); ++a) p[a] = dot(u_a[a], load) * constants_[i].inverse_length;
    Link::direction(trig, motion(i).u);
    Link::tangent_momentum(trig, motion(i).inverse_determinant, p, motion(i).across);
    sweep_.inward(next, i, constants_[i], motion(i).u, motion(i).across);
  }

  Chain<Space> chain_;
  ChainLinks<Space> constants_;
  TensionSweep<Space, double> sweep_;
  std::vector<Motion> motions_;
  Torque<Space, Eigen::Dynamic> torque_;
};

}  // namespace pendula
