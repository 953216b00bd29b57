#pragma once

#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/lanes/explicit_tableau.hpp>
#include <pendula/lanes/lane_error_controller.hpp>
#include <pendula/lanes/lane_links.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

/// An explicit Runge–Kutta method on several chains at once, one in each lane, for few digits and short times: as a
/// stepper of LaneQueue. Rods and their rates are what is moved, ξ̈ being made of weight and multipliers that keep |ξ̇|²
/// + ξ·ξ̈ = 0 (RodState::for_each_acceleration); after each step rods have their lengths again, and rates go across.
/// Gravity is all that acts.
template <class Space, class Method, int N = Eigen::Dynamic, class Register = MemberRegister>
class LaneExplicit {
 public:
  using SpaceType = Space;
  static constexpr int links_known = N, stages = static_cast<int>(Method::stages);
  static constexpr bool is_implicit = false, can_choose = Method::error_order > 0;
  using Chain = LaneExplicit;
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using Controller = LaneErrorController<L, Method::error_order>;
  static constexpr int lanes = L::size;
  static constexpr std::size_t D = Space::dimension;
  using Vector = std::array<L, D>;

  struct Options {};
  explicit LaneExplicit(int links, Options = {})
      : links_(links),
        constants_(links),
        rods_(links),
        trial_(links),
        before_(links),
        stages_(links),
        slopes_(Method::stages + 1, Rods(links)),
        before_slopes_(links),
        rows_(links) {
    for (int i = 0; i < links; ++i) {
      for (Rods* rods : {&rods_, &trial_, &before_, &stages_, &before_slopes_}) (*rods)[i] = resting();
      for (Rods& slopes : slopes_) slopes[i] = {zero(), zero()};
    }
  }

  LaneExplicit& chain() { return *this; }
  const LaneExplicit& chain() const { return *this; }
  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }

  /// A member comes into a lane, with its chain, at q and v  [rad, rad/s].
  void start(int lane, const ChainLinks<Space, N, double>& chain, double gravity, const double* q, const double* v) {
    gravity_.set(lane, gravity);
    fresh_.set(lane, 1);
    double length = 0;
    for (int i = 0; i < links(); ++i) {
      constants_[i].set(lane, chain[i]);
      length += chain[i].length;
      std::array<double, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        angles[a] = q[static_cast<Eigen::Index>(a) * links() + i];
        rates[a] = v[static_cast<Eigen::Index>(a) * links() + i];
      }
      const Heading<Space> heading(angles, rates);
      for (std::size_t k = 0; k < D; ++k) {
        rods_[i].along[k].set(lane, chain[i].length * heading.u[k]);
        rods_[i].rate[k].set(lane, chain[i].length * heading.u_dot[k]);
      }
    }
    slowest_pace_.set(lane, 0.15 * links() * links() * std::abs(gravity) / length);
  }

  /// Direction of a member's link and its rate.
  auto heading(int lane, int i) const {
    Heading<Space, long double> heading;
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = rods_[i].along[k][lane] / constants_[i].length[lane];
      heading.u_dot[k] = rods_[i].rate[k][lane] / constants_[i].length[lane];
    }
    return heading;
  }
  void find_rates() const {}
  const Vector& along(int i) const { return rods_[i].along; }

  /// Rates of all rods; visit(i, ξ̇_i, …).
  template <class Visit>
  void for_each_rate(Visit visit) const {
    for (int i = 0; i < links(); ++i) visit(i, rods_[i].rate, L(0.0));
  }

  /// Rods and rates of the members whose step was accepted when `share` of it was done, by the polynomial of degree
  /// five through both ends with rates and accelerations; visit(i, ξ, ξ̇).
  template <class Visit>
  void for_each_glance(double share, Visit visit) const {
    const double u = share, w = u - 1;
    const L rise(u * u * u * (10 - 15 * u + 6 * u * u)), turn_on(u * w * w * w * (-1 - 3 * u)),
        turn_off(u * u * u * w * (4 - 3 * u)), bend_on(-0.5 * u * u * w * w * w), bend_off(0.5 * u * u * u * w * w);
    const L rise_rate(30 * u * u * w * w), turn_on_rate(w * w * (1 - 3 * u) * (1 + 5 * u)),
        turn_off_rate(u * u * (-12 + 28 * u - 15 * u * u)), bend_on_rate(-0.5 * u * w * w * (5 * u - 2)),
        bend_off_rate(0.5 * u * u * w * (5 * u - 3));
    const L inverse_h = L(1.0) / step_;
    for (int i = 0; i < links(); ++i) {
      const Rod &from = before_[i], &to = rods_[i];
      const Vector &bend = before_slopes_[i].rate, &bend_after = slopes_[0][i].rate;
      Vector rod, rate;
      for (std::size_t k = 0; k < D; ++k) {
        const L moved = to.along[k] - from.along[k];
        const L turning = step_ * from.rate[k], turned = step_ * to.rate[k];
        const L bending = step_ * (step_ * bend[k]), bent = step_ * (step_ * bend_after[k]);
        rod[k] = from.along[k] +
                 (((rise * moved + turn_on * turning) + turn_off * turned) + (bend_on * bending + bend_off * bent));
        rate[k] = inverse_h * (((rise_rate * moved + turn_on_rate * turning) + turn_off_rate * turned) +
                               (bend_on_rate * bending + bend_off_rate * bent));
      }
      visit(i, rod, rate);
    }
  }

  /// The same by a step that ends there.
  template <class Visit>
  void for_each_look(double share, Visit visit) {
    go_back();
    solve(L(share) * step_, step_ > L(0.0));
    for (int i = 0; i < links(); ++i) visit(i, trial_[i].along, trial_[i].rate);
    go_back();
  }

  /// T + U  [J].
  L energy() const {
    L energy(0.0);
    Vector bob = zero();
    for (int i = 0; i < links(); ++i) {
      bob = sum(bob, rods_[i].rate);
      energy = fma(0.5 * constants_[i].mass, dot(bob, bob), energy);
      energy = fma(constants_[i].weight, rods_[i].along[D - 1], energy);
    }
    return energy;
  }

  /// Fastest turning of a link, squared, and no less than the chain swings  [1/s²].
  L pace_squared() const { return pace_squared_of(rods_); }

  /// Tries a step of `h`; gives those of the members that are `wanted` to whom nothing happened that is not finite, and
  /// whose links turn by less than half a turn. The state stays what it was.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& h, const Mask& wanted) {
    refresh();
    detail::unrolled<static_cast<int>(Method::stages) - 1>([&](auto s) PENDULA_WRITTEN_OUT {
      constexpr auto stage = static_cast<std::size_t>(s) + 1;
      weigh<stage>(h, Method::a[stage], stages_);
      slopes(stages_, slopes_[stage]);
    });
    weigh<Method::stages>(h, Method::b, trial_);
    for_links([&](auto i) PENDULA_WRITTEN_OUT { restore(at(constants_, i), at(trial_, i)); });
    slopes(trial_, slopes_[Method::stages]);
    const L pace = pace_squared_of(trial_);
    if constexpr (can_choose) find_error(h, pace);
    tried_ = h;
    const L turned = max(pace, pace_squared_of(rods_)) * (h * h);
    return wanted & (turned < L(largest_turn * largest_turn));
  }

  /// What the step errs by, relative to the size of the motion, squared.
  const L& error_squared() const { return error_; }

  /// Moves the members to the end of the step that was tried.
  void accept(const Mask& which) {
    step_ = select(which, tried_, step_);
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      assign(which, at(rods_, i), at(before_, i));
      assign(which, at(slopes_[0], i), at(before_slopes_, i));
      assign(which, at(trial_, i), at(rods_, i));
      assign(which, at(slopes_[Method::stages], i), at(slopes_[0], i));
    });
  }

 private:
  struct Rod {
    Vector along, rate;  // ξ, ξ̇; of slopes ξ̇, ξ̈
  };
  using Rods = detail::PerLink<Rod, N>;

  static constexpr bool is_short = detail::is_short_chain<N>;
  static constexpr double largest_turn = 3;  // rad

  static Vector zero() {
    Vector vector;
    vector.fill(L(0.0));
    return vector;
  }
  static Rod resting() {
    Rod rod{zero(), zero()};
    rod.along[D - 1] = L(-1.0);
    return rod;
  }

  static void assign(const Mask& which, const Rod& from, Rod& to) {
    for (std::size_t k = 0; k < D; ++k) {
      to.along[k] = select(which, from.along[k], to.along[k]);
      to.rate[k] = select(which, from.rate[k], to.rate[k]);
    }
  }

  template <class Links>
  static auto& at(Links& of, int link) {
    return of[link];
  }

  template <class Body>
  [[gnu::always_inline]] void for_links(Body body) {
    detail::for_links<N>(links(), body);
  }

  L pace_squared_of(const Rods& rods) const {
    L largest = slowest_pace_;
    for (int i = 0; i < links(); ++i) {
      largest = max(largest, dot(rods[i].rate, rods[i].rate) * constants_[i].inverse_square);
    }
    return largest;
  }

  // To where the last step began, and from there.
  void go_back() {
    std::swap(rods_, before_);
    std::swap(slopes_[0], before_slopes_);
  }

  // The first slopes of members that have come into lanes; of others they are those of the last step's end.
  void refresh() {
    const Mask fresh = fresh_ > L(0.0);
    if (!xsimd::any(fresh)) return;
    fresh_ = L(0.0);
    Rods& found = stages_;  // slopes are as large
    slopes(rods_, found);
    for_links([&](auto i) PENDULA_WRITTEN_OUT { assign(fresh, at(found, i), at(slopes_[0], i)); });
  }

  // ξ̇ and ξ̈ of rods.
  [[gnu::always_inline]] void slopes(const Rods& rods, Rods& found) {
    MultiplierRow<L> row;
    L beyond(0.0);
    const auto inward = [&](auto i) PENDULA_WRITTEN_OUT {
      const Rod& rod = at(rods, i);
      L right = -dot(rod.rate, rod.rate), before(0.0);
      if (i == 0) {
        right = fma(rod.along[D - 1], gravity_, right);
      } else {
        before = -at(constants_, i - 1).inverse_mass.value * dot(at(rods, i - 1).along, rod.along);
      }
      const L square = at(constants_, i).inverse_masses * dot(rod.along, rod.along);
      const L inverse = L(1.0) / fma(-beyond, row.coupling, square);
      row = {fma(-beyond, row.offset, right) * inverse, before * inverse};
      at(rows_, i) = row;
      beyond = before;
    };
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      if constexpr (is_short) {
        inward(std::integral_constant<int, N - 1 - i>());
      } else {
        inward(links() - 1 - i);
      }
    });
    L tau = row.offset;
    Vector bond_before{};
    bond_before.fill(L(0.0));
    bond_before[D - 1] = gravity_;
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      const Rod& rod = at(rods, i);
      Vector pull = scaled(tau, rod.along);
      if (i + 1 < links()) {
        tau = fma(-at(rows_, i + 1).coupling, tau, at(rows_, i + 1).offset);
        for (std::size_t k = 0; k < D; ++k) pull[k] = fma(-tau, at(rods, i + 1).along[k], pull[k]);
      }
      const Vector bond = scaled(at(constants_, i).inverse_mass.value, pull);
      at(found, i) = {rod.rate, difference(bond, bond_before)};
      bond_before = bond;
    });
  }

  // Where the first `Count` slopes lead to, weighed.
  template <std::size_t Count, class Weights>
  [[gnu::always_inline]] void weigh(const L& h, const Weights& weights, Rods& to) {
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      Rod moved{zero(), zero()};
      detail::unrolled<static_cast<int>(Count)>([&](auto j) PENDULA_WRITTEN_OUT {
        const double weight = weights[static_cast<std::size_t>(j)];
        if (weight == 0) return;
        add(L(weight), at(slopes_[static_cast<std::size_t>(j)], i), moved);
      });
      const Rod& from = at(rods_, i);
      Rod& there = at(to, i);
      for (std::size_t k = 0; k < D; ++k) {
        there.along[k] = fma(h, moved.along[k], from.along[k]);
        there.rate[k] = fma(h, moved.rate[k], from.rate[k]);
      }
    });
  }
  static void add(const L& weight, const Rod& slope, Rod& sum) {
    for (std::size_t k = 0; k < D; ++k) {
      sum.along[k] = fma(weight, slope.along[k], sum.along[k]);
      sum.rate[k] = fma(weight, slope.rate[k], sum.rate[k]);
    }
  }

  // Of rods relative to their lengths, and of rates to those and the pace.
  [[gnu::always_inline]] void find_error(const L& h, const L& pace_squared) {
    error_ = L(0.0);
    const L inverse_pace = L(1.0) / pace_squared;
    for_links([&](auto i) PENDULA_WRITTEN_OUT {
      Rod error{zero(), zero()};
      detail::unrolled<static_cast<int>(Method::stages) + 1>([&](auto j) PENDULA_WRITTEN_OUT {
        constexpr double weight = Method::e[static_cast<std::size_t>(j)];
        if constexpr (weight != 0) add(L(weight), at(slopes_[static_cast<std::size_t>(j)], i), error);
      });
      const L squared = fma(dot(error.rate, error.rate), inverse_pace, dot(error.along, error.along));
      error_ = max(error_, (h * h) * (squared * at(constants_, i).inverse_square));
    });
  }

  // |ξ| = l and ξ·ξ̇ = 0 again; what a step errs by in them is small.
  static void restore(const LaneLink<L>& link, Rod& rod) {
    const L factor = fma(-0.5 * link.inverse_square, dot(rod.along, rod.along), L(1.5));
    rod.along = scaled(factor, rod.along);
    const L along = dot(rod.along, rod.rate) * link.inverse_square;
    for (std::size_t k = 0; k < D; ++k) rod.rate[k] = fma(-along, rod.along[k], rod.rate[k]);
  }

  int links_;
  L gravity_{0.0}, slowest_pace_{1.0}, fresh_{0.0}, error_{0.0};
  L tried_{0.0}, step_{1.0};  // the steps that were tried, and those that were taken last
  detail::PerLink<LaneLink<L>, N> constants_;
  Rods rods_, trial_, before_, stages_;  // before_: where the last step began
  std::vector<Rods> slopes_;             // of the stages, and of the end
  Rods before_slopes_;
  detail::PerLink<MultiplierRow<L>, N> rows_;
};

}  // namespace pendula
