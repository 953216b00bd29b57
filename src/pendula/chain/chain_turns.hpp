#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/chain/chain_motion.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/gauss/stage_layout.hpp>
#include <pendula/gauss/step_prediction.hpp>
#include <pendula/numeric/lanes.hpp>

namespace pendula {

/// The angles of one chain whose rods move by Gauss steps, at the end of a step and within it. Of all angles of a rod,
/// they are those to which the motion has led.
template <class Space, int S, int N, class Real>
class ChainTurns : public ChainMotion<Space, StagesInLanes<S, Real>, N> {
  using Base = ChainMotion<Space, StagesInLanes<S, Real>, N>;

 public:
  using State = pendula::State<Space, N, Real>;
  using L = Lanes<S, Real>;
  using Base::D, Base::links;
  static constexpr std::size_t Z = L::size;
  using Numbers = std::array<Real, D>;

  ChainTurns(int count, Family family) : Base(count, family), anchors_(count) {}

  State state(double time) const {
    State state = empty_state(time);
    rods_.for_each_rate(constants_, [&](int i, const Numbers& rate, const Real&) {
      read_angles(i, rods_.heading(0, i, rate), anchors_[i], state);
    });
    return state;
  }

  /// The state of the chain.
  struct FullState {
    typename Base::Rods::FullState rods{};
    detail::PerLink<AngleAnchor<Space, Real>, N> anchors{0};
  };
  void keep(FullState& place) const {
    place.rods = rods_.place();
    place.anchors = anchors_;
  }
  void go_to(const FullState& place) {
    rods_.place() = place.rods;
    anchors_ = place.anchors;
  }

  /// The state within the last step, x steps after its beginning, by the polynomials through its rates.
  State at(const FullState& begin, double time, double x) const {
    State state = empty_state(time);
    const auto up_to = columns_.integrals(Real(x));
    for (int i = 0; i < links(); ++i) {
      const Real* along = begin.rods.along[i];
      const Numbers rate = rate_at(i, Real(x), Real(prediction_.last_h())), rod = rod_in_step(along, i, up_to), low{};
      AngleAnchor<Space, Real> anchor = begin.anchors[i];
      if (may_leave(anchor, i, along, turn_ * std::abs(x))) follow_turn(anchor, along, i, Real(x), rod);
      read_angles(i, Base::Rods::heading_of(rod, low, rate), anchor, state);
    }
    return state;
  }

  /// Sets q and v to bounds of how far angles and their rates get within the last step from their values at its start:
  /// infinite near a pole.
  bool bound_excursions(const FullState& begin, double* q, double* v) const {
    using std::abs;
    const Real h = abs(Real(prediction_.last_h()));
    for (int i = 0; i < links(); ++i) {
      const Excursions farthest = excursions_of(begin.rods.along[i], i, h);
      for (std::size_t a = 0; a < Space::dof; ++a) {
        q[entry(i, a)] = static_cast<double>(farthest.angles[a]);
        v[entry(i, a)] = static_cast<double>(farthest.rates[a]);
      }
    }
    return true;
  }

 protected:
  using Base::columns_, Base::constants_, Base::rods_;

  const auto& past(int i) const { return this->pasts_[i][this->newest_]; }

  using Weights = typename Base::Columns::Weights;
  static Real weighed(const Weights& weights, const Real* x) {
    Real sum(0);
    for (std::size_t j = 0; j < S; ++j) sum += weights[j] * x[j];
    return sum;
  }

  // rate_at: the rate of a rod x steps after the start of the last step. rod_in_step: the rod there, from `along` on.
  Numbers rate_at(int i, const Real& x, const Real& h) const {
    const Weights weights = columns_.values(x);
    return components<D>([&](std::size_t k) {
      return h == 0 ? Real(rods_.free(i)[k]) : Real(weighed(weights, past(i).advance[k].numbers()) / h);
    });
  }
  Numbers rod_in_step(const Real* along, int i, const Weights& up_to) const {
    return components<D>([&](std::size_t k) { return Real(along[k] + weighed(up_to, past(i).advance[k].numbers())); });
  }

  struct Excursions {
    std::array<Real, Space::dof> angles, rates;
  };
  // In the plane the rate of an angle is smooth everywhere, so that its stages give the bounds. h is the step size.
  Excursions excursions_of(const Real* along, int i, const Real& h) const requires(Space::dof == 1) {
    std::array<L, D> rod, moved;
    for (std::size_t k = 0; k < D; ++k) {
      moved[k] = columns_.weight(0) * past(i).advance[k][0];
      rod[k] = L(along[k]) + columns_.integral(moved[k]);
    }
    alignas(pack_alignment) Real turned[Z];
    ((rod[0] * moved[1] - rod[1] * moved[0]) / fma(rod[0], rod[0], rod[1] * rod[1])).store(turned);
    const auto [turn, change] = columns_.excursion(turned);
    return {{turn}, {change / h}};
  }
  // In space rates of angles have narrow peaks near a pole: bounds follow from those of the rod, of constant length.
  Excursions excursions_of(const Real* along, int i, const Real& h) const requires(Space::dof > 1) {
    using std::asin, std::sqrt;
    const Real& inverse_length = constants_[i].inverse_length;
    Numbers moved_by, changed_by;
    for (std::size_t k = 0; k < D; ++k) {
      alignas(pack_alignment) Real moved[Z];
      (columns_.weight(0) * past(i).advance[k][0]).store(moved);
      const auto [integral, change] = columns_.excursion(moved);
      moved_by[k] = inverse_length * integral;
      changed_by[k] = inverse_length * change / h;
    }
    const Real far = sqrt(dot(moved_by, moved_by)), change = sqrt(dot(changed_by, changed_by)), fastest = far / h;
    const Real level = inverse_length * sqrt(along[0] * along[0] + along[1] * along[1]);  // distance from the axis
    const Real nearest = level - far;
    constexpr Real infinite = std::numeric_limits<Real>::infinity();
    Excursions bounds;
    bounds.angles = {far < 1 ? Real(asin(far)) : infinite, infinite};
    bounds.rates.fill(infinite);
    if (!(nearest > Real(0.1) * level)) return bounds;
    // For a direction (x, y, z), theta_dot = ż/level and phi_dot = (x ẏ − y ẋ)/level².
    bounds.angles[1] = asin(far / level);
    bounds.rates = {change / nearest + fastest * (1 / nearest - 1 / level),
                    (level * change + far * fastest) / (nearest * nearest) +
                        level * fastest * (1 / (nearest * nearest) - 1 / (level * level))};
    return bounds;
  }

  State empty_state(double time) const {
    State state;
    state.time = time;
    state.q.resize(Space::dof * links());
    state.v.resize(Space::dof * links());
    return state;
  }

  template <class LinkHeading>
  void read_angles(int i, const LinkHeading& heading, const AngleAnchor<Space, Real>& anchor, State& state) const {
    using Wide = typename decltype(heading.u)::value_type;
    std::array<Wide, Space::dof> near;
    for (std::size_t a = 0; a < near.size(); ++a) near[a] = Wide(anchor.angles()[a]);
    const auto angles = user_angles(heading, near);
    for (std::size_t a = 0; a < near.size(); ++a) {
      state.q[entry(i, a)] = Real(angles.q[a]);
      state.v[entry(i, a)] = Real(angles.v[a]);
    }
  }

  // Index of coordinate a of link i in the user's vectors.
  Eigen::Index entry(int i, std::size_t a) const { return static_cast<Eigen::Index>(a) * links() + i; }

  Numbers direction(int i) const { return scaled(constants_[i].inverse_length, Base::Rods::vector(rods_.along(i))); }

  // Whether a link that turns by at most `turn`, from `along` on, may leave the reach of its anchor.
  bool may_leave(const AngleAnchor<Space, Real>& anchor, int i, const Real* along, double turn) const {
    using std::sqrt;
    const Numbers off = components<D>(
        [&](std::size_t k) { return Real(along[k] * constants_[i].inverse_length - anchor.direction()[k]); });
    const Real farthest = sqrt(dot(off, off)) + Real(1.5 * turn);
    return farthest * farthest > anchor.reach_squared();
  }

  // Takes an anchor from the rod `along` through the stages to the rod `end`, x steps after the start. Where stages are
  // too far apart for that, near a pole, it goes along the polynomial through them.
  void follow_turn(AngleAnchor<Space, Real>& anchor, const Real* along, int i, const Real& x,
                   const Numbers& end) const {
    const Real& inverse_length = constants_[i].inverse_length;
    alignas(pack_alignment) Real u[D][2 * Z];
    L squared(Real(0));
    for (std::size_t k = 0; k < D; ++k) {
      const L moved = columns_.integral(columns_.weight(0) * past(i).advance[k][0]);
      const L direction = L(inverse_length) * (L(along[k]) + moved), off = direction - L(anchor.direction()[k]);
      direction.store(u[k]);
      squared = fma(off, off, squared);
    }
    std::size_t before = 0;
    while (before < S && columns_.c(before) < x) ++before;
    Real farthest(0);
    for (std::size_t k = 0; k < D; ++k) {
      u[k][before] = inverse_length * end[k];
      const Real off = u[k][before] - anchor.direction()[k];
      farthest += off * off;
    }
    alignas(pack_alignment) Real stored[Z];
    squared.store(stored);
    for (std::size_t j = 0; j < before; ++j) farthest = std::max(farthest, stored[j]);
    if (farthest <= anchor.reach_squared() || anchor.follow_through(u, before + 1)) return;
    const auto direction_at = [&](const Real& at) {
      return scaled(inverse_length, rod_in_step(along, i, columns_.integrals(at)));
    };
    anchor.follow_path(direction_at, x);
  }

  // Takes all anchors to the end of the solved step.
  void follow_turns() {
    for (int i = 0; i < links(); ++i) {
      const Real* along = rods_.along(i);
      if (!may_leave(anchors_[i], i, along, turn_)) continue;
      const Numbers end = components<D>(
          [&](std::size_t k) { return Real(along[k] + (columns_.h() * rods_.free(i)[k] + this->moved_[i][k])); });
      follow_turn(anchors_[i], along, i, Real(1), end);
    }
  }

  double turn_ = 0;  // the largest turn of a link in the solved step  [rad]
  StepPrediction prediction_;
  detail::PerLink<AngleAnchor<Space, Real>, N> anchors_;
};

}  // namespace pendula
