#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/chain/rod_blocks.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>
#include <type_traits>

namespace pendula {

/// The rods ξ of a chain and their free rates z, of one motion or of several members: Num is a number, a LanePack, or
/// either with its derivative (Dual). Both are kept in twice the digits of a number.
///
/// Free rates z are the rates that rods would have without their multipliers τ:
///   ξ̇_i = z_i + e_i − e_{i−1},  e_i = (τ_i ξ_i − τ_{i+1} ξ_{i+1})/m_i,  e_0 = 0.
/// They have a gauge freedom: z_i → z_i + ε_i − ε_{i−1}, with ε made of any λ as e is of τ, changes τ → τ − λ and not
/// the motion. In a state just started τ = 0, and z is the rate itself.
template <class Space, int N = Eigen::Dynamic, class Num = double>
class RodState : public RodBlocks<Space, N, Num> {
  using Base = RodBlocks<Space, N, Num>;

 public:
  using Base::D, Base::block, Base::block_size, Base::for_blocks, Base::for_numbers, Base::links;
  template <class T>
  using Numbers = typename Base::template Numbers<T>;
  using C = ConstantOf<Num>;
  using Vector = std::array<Num, D>;

  /// Number type of directions in conversions between angles and rods.
  using Wide = std::conditional_t<is_batch<Num> || std::is_same_v<C, double> || std::is_same_v<C, float>, LongReal, C>;

  /// A state as a value.
  struct FullState {
    explicit FullState(int links = 0) : along(links), along_low(links), free(links), free_low(links) {}
    Numbers<Num> along, along_low;  ///< ξ  [m], and what it lost to rounding
    Numbers<Num> free, free_low;    ///< z  [m/s]
  };

  explicit RodState(int count)
      : Base(count),
        at_(count),
        inverse_mass_(count),
        inverse_mass_low_(count),
        product_(count),
        rows_(count),
        rates_(count) {}

  /// Sets the mass of bob i, as 1/m.
  void set_mass(int i, const Twofold<C>& inverse_mass) {
    std::fill_n(inverse_mass_[i], D, inverse_mass.value);
    std::fill_n(inverse_mass_low_[i], D, inverse_mass.low);
  }

  const FullState& place() const { return at_; }
  FullState& place() { return at_; }
  const Num* along(int i) const { return at_.along[i]; }  ///< ξ_i, (dimension)
  const Num* along_low(int i) const { return at_.along_low[i]; }
  const Num* free(int i) const { return at_.free[i]; }  ///< z_i, (dimension)
  const Num* free_low(int i) const { return at_.free_low[i]; }
  Num* along(int i) { return at_.along[i]; }
  Num* free(int i) { return at_.free[i]; }
  const C* inverse_mass(int i) const { return inverse_mass_[i]; }  ///< 1/m_i, (dimension), the same number
  const Num& product(int i) const { return product_[i]; }  ///< ξ_i·z_i without their low parts, of the last gauge
  const Num* products() const { return &product_[0]; }

  /// Starts link i of a member in this direction, at this rate.
  void start(int member, int i, const Wide& length, const Heading<Space, Wide>& heading) {
    for (std::size_t k = 0; k < D; ++k) {
      split(member, length * heading.u[k], at_.along[i][k], at_.along_low[i][k]);
      split(member, length * heading.u_dot[k], at_.free[i][k], at_.free_low[i][k]);
    }
  }

  /// Direction of a member's link and its rate, from which angles follow.
  Heading<Space, Wide> heading(int member, int i, const Vector& rate) const {
    const auto number = [member](const Num& x) { return get(detail::value_of(x), member); };
    using Number = std::decay_t<decltype(number(rate[0]))>;
    std::array<Number, D> rod, low, turning;
    for (std::size_t k = 0; k < D; ++k) {
      rod[k] = number(at_.along[i][k]);
      low[k] = number(at_.along_low[i][k]);
      turning[k] = number(rate[k]);
    }
    return heading_of(rod, low, turning);
  }

  /// The same for any rod + low.
  template <class Number>
  static Heading<Space, Wide> heading_of(const std::array<Number, D>& rod, const std::array<Number, D>& low,
                                         const std::array<Number, D>& rate) {
    Heading<Space, Wide> heading;
    Wide squared(0);
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = Wide(rod[k]) + Wide(low[k]);
      squared += heading.u[k] * heading.u[k];
    }
    using std::sqrt;
    const Wide inverse = 1 / sqrt(squared);
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] *= inverse;
      heading.u_dot[k] = Wide(rate[k]) * inverse;
    }
    return heading;
  }

  template <class MemberNumbers>
  void member(MemberNumbers& numbers) {
    for (int i = 0; i < links(); ++i) {
      for (auto* part : {&at_.along, &at_.along_low, &at_.free, &at_.free_low}) numbers.range((*part)[i], D);
    }
  }

  /// Calls visit(i, ξ̇_i, τ_i) for all rods, from the pivot out. constants[i]: LinkConstants.
  template <class Constants, class Visit>
  void for_each_rate(const Constants& constants, Visit visit) const {
    eliminate(constants, [&](int i) { return -exact_product_of(i); });
    for_each_bond(constants, [&](int i, const Vector& change, const Num& tau) {
      visit(i, sum(vector(at_.free[i]), change), tau);
    });
  }

  /// Calls visit(i, ξ̇_i, ξ̈_i) for all rods, where only gravity acts. ξ̈_i follows from weight and multipliers λ as ξ̇_i
  /// does from z_i and τ; |ξ̇|² + ξ·ξ̈ = 0 determines λ.
  template <class Constants, class Visit>
  void for_each_acceleration(const Constants& constants, const C& gravity, Visit visit) const {
    for_each_rate(constants, [&](int i, const Vector& rate, const Num&) { rates_[i] = rate; });
    const auto fallen = [&](int i) { return i == 0 ? C(-gravity) : C(0.0); };
    eliminate(constants, [&](int i) { return -(dot(rates_[i], rates_[i]) + at_.along[i][D - 1] * fallen(i)); });
    for_each_bond(constants, [&](int i, Vector change, const Num&) {
      change[D - 1] = change[D - 1] + Num(fallen(i));
      visit(i, rates_[i], change);
    });
  }

  /// Changes the gauge by multiplier(i) = λ_i, and finds every ξ·z; calls shifted(i) as soon as link i is done.
  template <class Multiplier, class Shifted>
  void shift_gauge(Multiplier multiplier, Shifted shifted) {
    Gauge gauge;
    std::fill_n(gauge.bond + block_size, D, Num(0.0));
    std::fill_n(gauge.bond_low + block_size, D, Num(0.0));
    gauge.set_lambda(block, multiplier(0));
    for_blocks([&](auto begin) PENDULA_WRITTEN_OUT {
      gauge.set_lambda(0, gauge.lambda_of(block_size));
      for (int i = begin; i < begin + block; ++i) {
        gauge.set_lambda(i - begin + 1, i + 1 < links() ? multiplier(i + 1) : Num(0.0));
      }
      shift_block(begin, gauge);
      const int end = std::min(begin + block, links());
      for (int i = begin; i < end; ++i) {
        const auto at = static_cast<std::size_t>(i - begin) * D;
        product_[i] = total(gauge.product + at, gauge.product_low + at);
        shifted(i);
      }
    });
  }

  /// Finds ξ·z of every link as shift_gauge does, where `which` is true.
  template <class Who>
  void find_products(const Who& which) {
    for (int i = 0; i < links(); ++i) product_[i] = select(which, exact_product_of_values(i), product_[i]);
  }

  /// Moves a block of rods from `begin` on, where `accepted` is true: ξ by h z (z without its low part) + `moved`, and
  /// z by `pushed`. It calls another function, because GCC heeds __restrict of parameters only.
  template <class Who>
  void advance(int begin, const C& h, const Who& accepted, const Num* moved, const Num* pushed) {
    advance(h, accepted, moved, pushed, at_.along[begin], at_.along_low[begin], at_.free[begin], at_.free_low[begin]);
  }

  /// Adds gravity over a time h. All bobs fall alike, so that only the free rate of the first rod changes.
  template <class Who>
  void fall(const C& h, const C& gravity, const Who& accepted) {
    Num &free = at_.free[0][D - 1], &low = at_.free_low[0][D - 1];
    const Twofold<C> change = exact_product(h, gravity);
    const Twofold<Num> fallen = exact_sum(free, Num(-change.value));
    free = select(accepted, fallen.value, free);
    low = select(accepted, low + (fallen.low - Num(change.low)), low);
  }

  /// Makes |ξ_i| = l_i again, where rounding has changed it and `which` is true.
  template <class Constants, class Who>
  void restore_lengths(const Constants& constants, const Who& which) {
    for (int i = 0; i < links(); ++i) {
      const C& length = constants[i].length;
      const Twofold<C> right = exact_product(length, length);
      Twofold<Num> missing{Num(right.value), Num(right.low)};
      for (std::size_t k = 0; k < D; ++k) {
        const Num &x = at_.along[i][k], &low = at_.along_low[i][k];
        const Twofold<Num> square = exact_product(x, x);
        const Twofold<Num> less = exact_sum(missing.value, -square.value);
        missing = {less.value, less.low + ((missing.low - square.low) - C(2.0) * (x * low))};
      }
      const Num factor = C(0.5) * (missing.value + missing.low) * constants[i].inverse_square;
      for (std::size_t k = 0; k < D; ++k) {
        Num &x = at_.along[i][k], &low = at_.along_low[i][k];
        const Twofold<Num> restored = ordered_sum(x, fma(x, factor, low));
        x = select(which, restored.value, x);
        low = select(which, restored.low, low);
      }
    }
  }

  /// Goes to `place` where `which` is true.
  template <class Who>
  void go_to(const FullState& place, const Who& which) {
    for (int i = 0; i < links(); ++i) {
      for (auto part : {&FullState::along, &FullState::along_low, &FullState::free, &FullState::free_low}) {
        Num* here = (at_.*part)[i];
        const Num* there = (place.*part)[i];
        for (std::size_t k = 0; k < D; ++k) here[k] = select(which, there[k], here[k]);
      }
    }
  }

  static Vector vector(const Num* from) {
    return components<D>([&](std::size_t k) { return from[k]; });
  }
  Vector rod(int i) const { return vector(at_.along[i]); }

  // --- Parts of sweeps ---

  /// ξ_i·z_i with their low parts.
  Num exact_product_of(int i) const {
    Vector product, low;
    for (std::size_t k = 0; k < D; ++k) {
      const Twofold<Num> exact = exact_product(at_.along[i][k], at_.free[i][k]);
      product[k] = exact.value;
      low[k] = exact.low + (at_.along[i][k] * at_.free_low[i][k] + at_.along_low[i][k] * at_.free[i][k]);
    }
    return total(product.data(), low.data());
  }

  /// Eliminates the multipliers, where right(i) is the right-hand side of their equations (multipliers.hpp).
  template <class Constants, class Right>
  void eliminate(const Constants& constants, Right right) const {
    MultiplierRow<Num> row;
    Num beyond(0.0);
    for (int i = links(); i-- > 0;) {
      const Vector rod = vector(at_.along[i]);
      const Num before =
          i == 0 ? Num(0.0) : Num(-constants[i - 1].inverse_mass.value * dot(vector(at_.along[i - 1]), rod));
      rows_[i] = row = row.next(constants[i].inverse_masses * dot(rod, rod), beyond, before, right(i));
      beyond = before;
    }
  }

  /// Calls visit(i, e_i − e_{i−1}, multiplier of rod i) from the pivot out: the changes of rates by multipliers.
  template <class Constants, class Visit>
  void for_each_bond(const Constants& constants, Visit visit) const {
    Num multiplier = rows_[0].offset;
    Vector before = components<D>([](std::size_t) { return Num(0.0); });
    for (int i = 0; i < links(); ++i) {
      const bool last = i + 1 == links();
      const Num next = last ? Num(0.0) : Num(rows_[i + 1].offset - rows_[i + 1].coupling * multiplier);
      Vector pull = scaled(multiplier, vector(at_.along[i]));
      if (!last) pull = difference(pull, scaled(next, vector(at_.along[i + 1])));
      const Vector bond = scaled(constants[i].inverse_mass.value, pull);
      visit(i, difference(bond, before), multiplier);
      before = bond;
      multiplier = next;
    }
  }
  /// Room for the rate of a rod.
  Vector& rate_room(int i) const { return rates_[i]; }

 private:
  // The gauge change of a block of links, preceded by what the link before the block adds to it.
  struct Gauge {
    static constexpr std::size_t copies = is_batch<Num> ? 1 : D;  // in one motion, one for each component
    alignas(pack_alignment) Num lambda[(block + 1) * copies];
    alignas(pack_alignment) Num bond[block_size + D], bond_low[block_size + D];  // from the link before on
    alignas(pack_alignment) Num product[block_size], product_low[block_size];

    void set_lambda(int link, const Num& value) {
      std::fill_n(lambda + static_cast<std::size_t>(link) * copies, copies, value);
    }
    const Num& lambda_of(std::size_t component) const { return lambda[copies == D ? component : component / D]; }
  };

  void shift_block(int begin, Gauge& __restrict gauge) {
    std::copy_n(gauge.bond + block_size, D, gauge.bond);
    std::copy_n(gauge.bond_low + block_size, D, gauge.bond_low);
    const Num* __restrict along = at_.along[begin], * __restrict along_low = at_.along_low[begin];
    const C* __restrict inverse = inverse_mass_[begin], * __restrict inverse_low = inverse_mass_low_[begin];
    for_numbers([&](auto at) PENDULA_WRITTEN_OUT {
      const std::size_t k = at;
      const Twofold<Num> pull = exact_product(gauge.lambda_of(k), along[k]);
      const Twofold<Num> next = exact_product(gauge.lambda_of(k + D), along[k + D]);
      const Twofold<Num> both = exact_sum(pull.value, Num(-next.value));
      const Num low = both.low + ((pull.low + gauge.lambda_of(k) * along_low[k]) -
                                  (next.low + gauge.lambda_of(k + D) * along_low[k + D]));
      const Twofold<Num> bond = exact_product(inverse[k], both.value);
      gauge.bond[k + D] = bond.value;
      gauge.bond_low[k + D] = bond.low + (inverse[k] * low + inverse_low[k] * both.value);
    });
    Num* __restrict free = at_.free[begin], * __restrict free_low = at_.free_low[begin];
    for_numbers([&](auto at) PENDULA_WRITTEN_OUT {
      const std::size_t k = at;
      const Twofold<Num> shift = exact_sum(gauge.bond[k + D], Num(-gauge.bond[k]));
      const Num shift_low = shift.low + (gauge.bond_low[k + D] - gauge.bond_low[k]);
      const Twofold<Num> raw = exact_sum(free[k], shift.value);
      const Twofold<Num> z = ordered_sum(raw.value, raw.low + (free_low[k] + shift_low));
      free[k] = z.value;
      free_low[k] = z.low;
      const Twofold<Num> product = exact_product(along[k], z.value);
      gauge.product[k] = product.value;
      gauge.product_low[k] = product.low;
    });
  }

  template <class Who>
  static void advance(const C& h, const Who& accepted, const Num* __restrict moved, const Num* __restrict pushed,
                      Num* __restrict rod, Num* __restrict rod_low, Num* __restrict free, Num* __restrict free_low) {
    for_numbers([&](auto at) PENDULA_WRITTEN_OUT {
      const std::size_t k = at;
      const Twofold<Num> coasted = exact_product(h, free[k]);
      const Twofold<Num> near = exact_sum(rod[k], coasted.value);
      const Twofold<Num> added = exact_sum(near.low + (rod_low[k] + coasted.low), moved[k]);
      const Twofold<Num> there = exact_sum(near.value, added.value);
      const Twofold<Num> wanted = ordered_sum(pushed[k], free_low[k]);
      const Twofold<Num> z = exact_sum(free[k], wanted.value);
      rod[k] = select(accepted, there.value, rod[k]);
      rod_low[k] = select(accepted, there.low + added.low, rod_low[k]);
      free[k] = select(accepted, z.value, free[k]);
      free_low[k] = select(accepted, z.low + wanted.low, free_low[k]);
    });
  }

  // ξ·z of one link, from the exact products of its components.
  static Num total(const Num* product, const Num* low) {
    Twofold<Num> sum = exact_sum(product[0], product[1]);
    Num rest = sum.low + (low[0] + low[1]);
    if constexpr (D == 3) {
      sum = exact_sum(sum.value, product[2]);
      rest = rest + (sum.low + low[2]);
    }
    return sum.value + rest;
  }

  static void split(int member, const Wide& x, Num& value, Num& low) {
    if constexpr (!is_batch<Num>) {
      value = Num(x);
      low = Num(x - Wide(value));
    } else {
      const auto rounded = static_cast<double>(x);
      set(value_in(value), member, rounded);
      set(value_in(low), member, static_cast<double>(x - Wide(rounded)));
    }
  }
  static C& value_in(Num& x) {
    if constexpr (std::is_same_v<Num, C>) {
      return x;
    } else {
      return x.value;
    }
  }

  Num exact_product_of_values(int i) const {
    Vector product, low;
    for (std::size_t k = 0; k < D; ++k) {
      const Twofold<Num> exact = exact_product(at_.along[i][k], at_.free[i][k]);
      product[k] = exact.value;
      low[k] = exact.low;
    }
    return total(product.data(), low.data());
  }

  FullState at_;
  Numbers<C> inverse_mass_, inverse_mass_low_;
  detail::PerLink<Num, N> product_;
  mutable detail::PerLink<MultiplierRow<Num>, N> rows_;
  mutable detail::PerLink<Vector, N> rates_;
};

}  // namespace pendula
