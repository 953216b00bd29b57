#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/member_loads.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/chain/rod_tangent.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/system/moving_part.hpp>
#include <type_traits>

namespace pendula {

/// Forward dynamics of several chains at once, one in each lane. The unknowns are the rod vectors ξ and their rates; ξ̈
/// follows from weight, loads and Lagrange multipliers (rod tensions) that keep |ξ̇|² + ξ·ξ̈ = 0
/// (ChainForwardDynamics).
///
/// With a tangent, every number carries its derivative along one tangent of each member's motion.
template <class Space, int N = Eigen::Dynamic, class Num = LanePack<MemberRegister>, bool with_tangent = false>
class ChainAccelerations {
 public:
  using SpaceType = Space;
  using L = Num;
  using Mask = MaskOf<L>;
  using Number = std::conditional_t<with_tangent, Dual<L>, L>;
  static constexpr int links_known = N;
  static constexpr bool has_tangent = with_tangent, is_short = detail::is_short_chain<N>;
  static constexpr bool limits_turns = true;  ///< whether steps are limited to less than half a turn of a rod
  static constexpr std::size_t D = Space::dimension;

  using Part = MovingPart<Number, D>;  ///< ξ, ξ̇
  using Parts = detail::PerLink<Part, N>;

  using Subject = int;  ///< number of links
  explicit ChainAccelerations(int links)
      : links_(links), constants_(links), rows_(links), loads_(links), freed_(links) {}

  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }
  int parts() const { return links(); }
  const LinkConstants<L>& link(int i) const { return constants_[i]; }
  const L& gravity() const { return gravity_; }

  /// The longest step in which drives turn by at most `turn`  [rad]. `nodes`: those of a Gauss quadrature as accurate
  /// as the method.
  template <int nodes>
  L longest_step(double turn) const {
    return L(turn) / loads_.fastest_drive();
  }

  /// body(i) for all links i from the pivot outward; unrolled for short chains of known length.
  template <class Body>
  [[gnu::always_inline]] void for_parts(Body body) const {
    detail::for_links<N>(links(), body);
  }
  /// body(i) for all links i from the tip inward.
  template <class Body>
  [[gnu::always_inline]] void for_parts_inward(Body body) const {
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      if constexpr (is_short) {
        body(std::integral_constant<int, N - 1 - i>());
      } else {
        body(links() - 1 - i);
      }
    });
  }
  template <class Links>
  static auto& at(Links& of, int link) {
    return of[link];
  }

  /// Unused lanes hold a chain that hangs at rest.
  static Part resting() {
    Part rod = Part::zero();
    rod.place[D - 1] = Number(-1.0);
    return rod;
  }

  /// Starts a member in a lane, with its chain, at q and v  [rad, rad/s]. `low`, if given, is set to the rounding
  /// errors of rods and rates.
  template <class... Low>
  void start(int lane, double /*time*/, const Chain<Space, N>& given, const ChainLinks<Space, N, double>& chain,
             const double* q, const double* v, Parts& rods, Low&... low) {
    using Wide = std::conditional_t<sizeof...(low) == 0, double, LongReal>;
    const double gravity = given.gravity();
    set(gravity_, lane, gravity);
    loads_.take(lane, given, chain);
    double length = 0;
    for (int i = 0; i < links(); ++i) {
      constants_[i].set(lane, chain[i]);
      length += chain[i].length;
      std::array<Wide, Space::dof> angles, rates;
      for (std::size_t a = 0; a < angles.size(); ++a) {
        angles[a] = q[static_cast<Eigen::Index>(a) * links() + i];
        rates[a] = v[static_cast<Eigen::Index>(a) * links() + i];
      }
      const Heading<Space, Wide> heading(angles, rates);
      for (std::size_t k = 0; k < D; ++k) {
        put(lane, Wide(chain[i].length) * heading.u[k], rods[i].place[k], low[i].place[k]...);
        put(lane, Wide(chain[i].length) * heading.u_dot[k], rods[i].rate[k], low[i].rate[k]...);
      }
    }
    set(swing_squared_, lane, std::abs(gravity) / length);
    set(slowest_pace_, lane, slowest_pace_squared<double>(links(), gravity, length));
    if constexpr (has_tangent) start_tangent(lane, rods);
  }

  /// Direction of a member's link, and its rate.
  auto heading(int lane, int i, const Parts& rods) const {
    Heading<Space, LongReal> heading;
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = get(detail::value_of(rods[i].place[k]), lane) / get(constants_[i].length, lane);
      heading.u_dot[k] = get(detail::value_of(rods[i].rate[k]), lane) / get(constants_[i].length, lane);
    }
    return heading;
  }

  /// T + U  [J].
  L energy(const L& /*time*/, const Parts& rods) const {
    L energy(0.0);
    std::array<L, D> bob;
    bob.fill(L(0.0));
    for (int i = 0; i < links(); ++i) {
      bob = sum(bob, detail::values_of(rods[i].rate));
      energy = fma(0.5 * constants_[i].mass, dot(bob, bob), energy);
      energy = fma(constants_[i].weight, detail::value_of(rods[i].place[D - 1]), energy);
    }
    return energy;
  }

  /// Fastest angular velocity of a link, squared, but at least the frequency of the chain, squared  [1/s²].
  L pace_squared(const Parts& rods) const {
    L largest = slowest_pace_;
    for (int i = 0; i < links(); ++i) {
      const auto& rate = detail::values_of(rods[i].rate);
      largest = max(largest, dot(rate, rate) * constants_[i].inverse_square);
    }
    return largest;
  }

  /// The largest rod and rate, squared: rods relative to their lengths, rates relative to length times pace.
  [[gnu::always_inline]] L size_squared(const Parts& parts, const L& pace_squared) const {
    L largest(0.0);
    const L inverse_pace = L(1.0) / pace_squared;
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const auto& part = at(parts, i);
      const auto &place = detail::values_of(part.place), &rate = detail::values_of(part.rate);
      const L squared = fma(dot(rate, rate), inverse_pace, dot(place, place));
      largest = max(largest, squared * at(constants_, i).inverse_square);
    });
    return largest;
  }

  /// Squared error of a step of `h`, from the error sums of rods and rates. Only the part across the rods counts, since
  /// `restore` removes the part along them. Relative to the size of the motion after the step: the deflection from
  /// hanging, at most 1, so that oscillations of 1e-9 rad are resolved like any other.
  [[gnu::always_inline]] L error_squared(const L& h, const Parts& errors, const Parts& /*before*/,
                                         const Parts& /*slopes*/, const Parts& after, const L& pace_squared) const {
    L largest(0.0), swing(0.0);
    const L inverse_pace = L(1.0) / select(pace_squared > L(0.0), pace_squared, L(1.0));
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const L& inverse_square = at(constants_, i).inverse_square;
      const auto &error = at(errors, i), &rod = at(after, i);
      const auto &along = detail::values_of(rod.place), &rate = detail::values_of(rod.rate);
      const L place_off = across_squared(detail::values_of(error.place), along);
      const L rate_off = across_squared(detail::values_of(error.rate), along);
      L inverse_speed = inverse_pace;
      if constexpr (!is_batch<L>) {
        const L own = fma(dot(rate, rate), inverse_square, L(swing_squared_));
        inverse_speed = L(1.0) / select(own > L(0.0), own, L(1.0));
      }
      largest = max(largest, fma(rate_off, inverse_speed, place_off) * (inverse_square * inverse_square));
      L aside = along[0] * along[0];
      if constexpr (D == 3) aside = fma(along[1], along[1], aside);
      const L swung = fma(dot(rate, rate), inverse_pace, aside) * inverse_square;
      swing = max(swing, select(along[D - 1] * gravity_ < L(0.0), swung, L(1.0)));
    });
    return (h * h) * (largest / max(min(swing, L(1.0)), L(smallest_swing)));
  }

  /// Computes ξ̇ and ξ̈ of the rods.
  [[gnu::always_inline]] void slopes(const L& time, const Parts& rods, Parts& found) {
    const bool loaded = loads_.any();
    if (loaded) find_freed(time, rods);
    MultiplierRow<Number> row;
    Number beyond(0.0);
    const auto inward = [&](auto i) PENDULA_WRITTEN_OUT {
      const Part& rod = at(rods, i);
      Number right = -dot(rod.rate, rod.rate), before(0.0);
      if (i == 0) {
        right = fma(rod.place[D - 1], gravity_, right);
      } else {
        before = -at(constants_, i - 1).inverse_mass.value * dot(at(rods, i - 1).place, rod.place);
      }
      if (loaded) right = right - dot(rod.place, at(freed_, i));
      const Number square = at(constants_, i).inverse_masses * dot(rod.place, rod.place);
      const Number inverse = Number(1.0) / fma(-beyond, row.coupling, square);
      row = {fma(-beyond, row.offset, right) * inverse, before * inverse};
      at(rows_, i) = row;
      beyond = before;
    };
    for_parts_inward(inward);
    Number tau = row.offset;
    std::array<Number, D> bond_before;
    bond_before.fill(Number(0.0));
    bond_before[D - 1] = Number(gravity_);
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const Part& rod = at(rods, i);
      std::array<Number, D> pull = scaled(tau, rod.place);
      if (i + 1 < links()) {
        tau = fma(-at(rows_, i + 1).coupling, tau, at(rows_, i + 1).offset);
        for (std::size_t k = 0; k < D; ++k) pull[k] = fma(-tau, at(rods, i + 1).place[k], pull[k]);
      }
      const std::array<Number, D> bond = scaled(at(constants_, i).inverse_mass.value, pull);
      at(found, i) = {rod.rate, difference(bond, bond_before)};
      if (loaded) at(found, i).rate = sum(at(found, i).rate, at(freed_, i));
      bond_before = bond;
    });
  }

  /// Projects rods back to |ξ| = l and ξ·ξ̇ = 0; the errors of a step in these are small.
  [[gnu::always_inline]] void restore(Parts& rods) const {
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const LinkConstants<L>& link = at(constants_, i);
      Part& rod = at(rods, i);
      const Number factor = fma(-0.5 * link.inverse_square, dot(rod.place, rod.place), Number(1.5));
      rod.place = scaled(factor, rod.place);
      const Number along = dot(rod.place, rod.rate) * link.inverse_square;
      for (std::size_t k = 0; k < D; ++k) rod.rate[k] = fma(-along, rod.place[k], rod.rate[k]);
    });
  }

  /// The same for rods with low parts: the length of a rod is corrected without rounding its direction. Rods are copied
  /// and written back, because Clang 14 miscompiles the loop for AVX2 when they are changed in place: it reads old
  /// values, an error of 1e-10.
  [[gnu::always_inline]] void restore(Parts& rods, Parts& low) const {
    for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const LinkConstants<L>& link = at(constants_, i);
      Part rod = at(rods, i), rest = at(low, i);
      const Number missing = fma(-0.5 * link.inverse_square, dot(rod.place, rod.place), Number(0.5));
      for (std::size_t k = 0; k < D; ++k) add(missing, rod.place[k], rod.place[k], rest.place[k]);
      const Number along = dot(rod.place, rod.rate) * link.inverse_square;
      for (std::size_t k = 0; k < D; ++k) add(-along, rod.place[k], rod.rate[k], rest.rate[k]);
      at(rods, i) = rod;
      at(low, i) = rest;
    });
  }

  /// Squared norm of the tangent: the sum of |δξ|²/l² + |δξ̇|²/(l ω)² over all rods, where ω is the initial pace.
  L tangent_squared(const Parts& rods) const requires with_tangent {
    L squared(0.0);
    for (int i = 0; i < links(); ++i) {
      L along(0.0), rate(0.0);
      for (std::size_t k = 0; k < D; ++k) {
        along = fma(rods[i].place[k].slope, rods[i].place[k].slope, along);
        rate = fma(rods[i].rate[k].slope, rods[i].rate[k].slope, rate);
      }
      squared = fma(constants_[i].inverse_square, fma(inverse_pace_squared_, rate, along), squared);
    }
    return squared;
  }

 private:
  static constexpr double smallest_swing = 1e-32;  // squared

  // |a × b|².
  static L across_squared(const std::array<L, D>& a, const std::array<L, D>& b) {
    const L z = fma(a[0], b[1], -(a[1] * b[0]));
    if constexpr (D == 2) {
      return z * z;
    } else {
      const L x = fma(a[1], b[2], -(a[2] * b[1])), y = fma(a[2], b[0], -(a[0] * b[2]));
      return fma(x, x, fma(y, y, z * z));
    }
  }

  static void put(int lane, double number, Number& value) { detail::set_value(lane, number, value); }
  static void put(int lane, LongReal number, Number& value, Number& low) {
    const auto rounded = static_cast<double>(number);
    detail::set_value(lane, rounded, value);
    detail::set_value(lane, static_cast<double>(number - rounded), low);
  }

  // Adds factor · by.
  static void add(const Number& factor, const Number& by, Number& value, Number& low) {
    const Twofold<Number> there = exact_sum(value, fma(factor, by, low));
    value = there.value;
    low = there.low;
  }

  // Accelerations of rods by loads, as if there were no tensions.
  [[gnu::noinline]] void find_freed(const L& time, const Parts& rods) {
    loads_.set_time(time);
    const auto load = [&](int i) {
      return loads_.of_rod(i, loads_.torque(i, constants_[i]), rods[i].place, rods[i].rate);
    };
    std::array<Number, D> before{}, here = load(0);
    for (int i = 0; i < links(); ++i) {
      std::array<Number, D> freed = scaled(constants_[i].inverse_masses, here);
      if (i > 0) freed = difference(freed, scaled(constants_[i - 1].inverse_mass.value, before));
      before = here;
      if (i + 1 < links()) {
        here = load(i + 1);
        freed = difference(freed, scaled(constants_[i].inverse_mass.value, here));
      }
      freed_[i] = freed;
    }
  }

  void start_tangent(int lane, Parts& rods) {
    const auto numbers = [&](const std::array<Number, D>& of) {
      return components<D>([&](std::size_t k) { return get(of[k].value, lane); });
    };
    const auto rod_of = [&](int i) {
      return MovingRod<D>{numbers(rods[i].place), numbers(rods[i].rate), get(constants_[i].inverse_square, lane)};
    };
    const RodTangent<Space> tangent(links(), get(slowest_pace_, lane), rod_of);
    set(inverse_pace_squared_, lane, tangent.inverse_pace_squared());
    for (int i = 0; i < links(); ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        set(rods[i].place[k].slope, lane, tangent.place(i)[k]);
        set(rods[i].rate[k].slope, lane, tangent.rate(i)[k]);
      }
    }
  }

  int links_;
  L gravity_{0.0}, swing_squared_{1.0}, slowest_pace_{1.0}, inverse_pace_squared_{1.0};
  detail::PerLink<LinkConstants<L>, N> constants_;
  detail::PerLink<MultiplierRow<Number>, N> rows_;
  MemberLoads<Space, N, L> loads_;
  detail::PerLink<std::array<Number, D>, N> freed_;
};

}  // namespace pendula
