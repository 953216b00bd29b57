#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/chain/multipliers.hpp>
#include <pendula/numeric/compensated.hpp>
#include <type_traits>

namespace pendula {

/// The state of a chain without angles: rods ξ_i = l_i û_i and, in place of momenta y, free rates z = M⁻¹ y.
///
/// With multipliers τ that keep every |ξ_i| (multipliers.hpp),
///   ξ̇_i = z_i + e_i − e_{i−1},  e_i = (τ_i ξ_i − τ_{i+1} ξ_{i+1})/m_i,  e_0 = 0.
/// y_i → y_i + λ_i ξ_i, which is z_i → z_i + ε_i − ε_{i−1} with ε made of λ as e is of τ, changes no motion: τ → τ − λ.
/// Of a state just started τ = 0, and z is the rate itself. Both are kept in twice the digits of Real.
///
/// Numbers stand component after component, link after link, and are worked on a block of links at a time, whole
/// registers of them: behind the last link there are zeros.
template <class Space, int N = Eigen::Dynamic, class Real = double>
class RodState {
 public:
  static constexpr std::size_t D = Space::dimension;
  using Vector = std::array<Real, D>;
  using Links = ChainLinks<Space, N, Real>;

  explicit RodState(const Links& links)
      : links_(links.links()),
        along_(links_),
        along_low_(links_),
        free_(links_),
        free_low_(links_),
        gained_(links_),
        inverse_mass_(links_),
        inverse_mass_low_(links_),
        product_(links_),
        rows_(links_),
        rates_(links_) {
    for (int i = 0; i < links_; ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        inverse_mass_[i][k] = links[i].inverse_mass.value;
        inverse_mass_low_[i][k] = links[i].inverse_mass.low;
      }
    }
  }

  const Real* along(int i) const { return along_[i]; }          ///< ξ_i, (dimension)  [m]
  const Real* along_low(int i) const { return along_low_[i]; }  ///< what it lost to rounding
  const Real* free(int i) const { return free_[i]; }            ///< z_i  [m/s]
  const Real* free_low(int i) const { return free_low_[i]; }
  const Real& product(int i) const { return product_[i]; }  ///< ξ_i·z_i without their low parts, of the last gauge

  Vector direction(int i, const Real& inverse_length) const {
    return components<D>([&](std::size_t k) { return along_[i][k] * inverse_length; });
  }

  /// Takes over link i, from angles and rates.
  void start(int i, const Real& length, const std::array<Real, Space::dof>& q, const std::array<Real, Space::dof>& v) {
    const Heading<Space, Wide> heading(widened(q), widened(v));
    for (std::size_t k = 0; k < D; ++k) {
      split(Wide(length) * heading.u[k], along_[i][k], along_low_[i][k]);
      split(Wide(length) * heading.u_dot[k], free_[i][k], free_low_[i][k]);
      gained_[i][k] = 0;
    }
  }

  /// Direction and rate of link i, in more digits than Real where there is such a type, for angles to be read from.
  auto heading(int i, const Vector& rate) const { return heading_of(along_[i], along_low_[i], rate); }

  /// The same of any rod, as the sum of two.
  static auto heading_of(const Real* along, const Real* along_low, const Vector& rate) {
    Heading<Space, Wide> heading;
    Wide squared(0);
    for (std::size_t k = 0; k < D; ++k) {
      heading.u[k] = Wide(along[k]) + Wide(along_low[k]);
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

  template <class Numbers>
  void member(Numbers& numbers) {
    for (int i = 0; i < links_; ++i) {
      for (auto* part : {&along_, &along_low_, &free_, &free_low_, &gained_}) numbers.range((*part)[i], D);
    }
  }

  /// The rates ξ̇ of all rods, from the pivot out: visit(i, ξ̇_i, τ_i).
  template <class Visit>
  void for_each_rate(const Links& links, Visit visit) const {
    eliminate(links, [&](int i) { return -exact_product_of(i); });
    for_each_bond(links,
                  [&](int i, const Vector& change, const Real& tau) { visit(i, sum(vector(free_[i]), change), tau); });
  }

  /// The rates and accelerations of all rods where nothing but gravity acts: visit(i, ξ̇_i, ξ̈_i). With multipliers λ
  /// that keep |ξ̇|² + ξ·ξ̈ = 0, ξ̈_i is made of weight and λ as ξ̇_i is of z_i and τ.
  template <class Visit>
  void for_each_acceleration(const Links& links, const Real& gravity, Visit visit) const {
    for_each_rate(links, [&](int i, const Vector& rate, const Real&) { rates_[i] = rate; });
    const auto fallen = [&](int i) { return i == 0 ? Real(-gravity) : Real(0); };
    eliminate(links, [&](int i) { return -(dot(rates_[i], rates_[i]) + along_[i][D - 1] * fallen(i)); });
    for_each_bond(links, [&](int i, Vector change, const Real&) {
      change[D - 1] += fallen(i);
      visit(i, rates_[i], change);
    });
  }

  /// Takes multipliers λ(i) into the free rates, and keeps every ξ·z; shifted(i, λ_i, change of z_i since the start of
  /// the last step).
  template <class Multiplier, class Shifted>
  void shift_gauge(Multiplier multiplier, Shifted shifted) {
    Gauge gauge{};
    set_multiplier(gauge.lambda + block_size, multiplier(0));
    for (int begin = 0; begin < links_; begin += block) {
      std::copy_n(gauge.lambda + block_size, D, gauge.lambda);
      for (int i = begin; i < begin + block; ++i) {
        set_multiplier(gauge.lambda + static_cast<std::size_t>(i - begin + 1) * D,
                       i + 1 < links_ ? multiplier(i + 1) : Real(0));
      }
      shift_block(begin, gauge);
      const int end = std::min(begin + block, links_);
      for (int i = begin; i < end; ++i) {
        const auto at = static_cast<std::size_t>(i - begin) * D;
        product_[i] = total(gauge.product + at, gauge.product_low + at);
        shifted(i, gauge.lambda[at], gauge.change + at);
      }
    }
  }

  /// Moves a block of rods from `begin` on by h z, z without its low part, and what their stages add to ξ and z.
  void advance(int begin, const Real& h, const Real* moved, const Real* pushed) {
    Real* __restrict rod = along_[begin], * __restrict rod_low = along_low_[begin];
    Real* __restrict free = free_[begin], * __restrict free_low = free_low_[begin];
    Real* __restrict gained = gained_[begin];
    for (std::size_t k = 0; k < block_size; ++k) {
      const Twofold<Real> coasted = exact_product(h, free[k]);
      const Twofold<Real> near = exact_sum(rod[k], coasted.value);
      const Real rest = near.low + (rod_low[k] + coasted.low);
      const Twofold<Real> added = exact_sum(rest, moved[k]);
      const Twofold<Real> there = exact_sum(near.value, added.value);
      rod[k] = there.value;
      rod_low[k] = there.low + added.low;
      const Twofold<Real> wanted = exact_sum(free_low[k], pushed[k]);
      const Twofold<Real> z = exact_sum(free[k], wanted.value);
      free[k] = z.value;
      free_low[k] = z.low + wanted.low;
      gained[k] = pushed[k];
    }
  }

  /// Weight acts on the first rod's free rate alone: all bobs fall alike.
  void fall(const Real& h, const Real& gravity) {
    const Twofold<Real> change = exact_product(h, gravity);
    const Twofold<Real> free = exact_sum(free_[0][D - 1], Real(-change.value));
    free_[0][D - 1] = free.value;
    free_low_[0][D - 1] += free.low - change.low;
    gained_[0][D - 1] -= change.value;
  }

  /// |ξ_i| = l_i again, where rounding has changed it.
  void restore_length(int i, const Real& length) {
    Twofold<Real> missing = exact_product(length, length);
    for (std::size_t k = 0; k < D; ++k) {
      const Twofold<Real> x{along_[i][k], along_low_[i][k]};
      missing = missing - x * x;
    }
    const Real factor = missing.rounded() / (2 * length * length);
    for (std::size_t k = 0; k < D; ++k) {
      const Twofold<Real> x = exact_sum(along_[i][k], along_low_[i][k] + along_[i][k] * factor);
      along_[i][k] = x.value;
      along_low_[i][k] = x.low;
    }
  }

  /// Keeps the state in one of two places, to go back to it.
  void save(std::size_t place) {
    for (std::size_t k = 0; k < 4; ++k) saved_[place][k] = *held()[k];
  }
  void restore(std::size_t place) {
    for (std::size_t k = 0; k < 4; ++k) *held()[k] = saved_[place][k];
  }

  /// Keeps the state as what glances and looks go back to; the first time allocates.
  void remember() {
    if (!remembered_) remembered_.emplace(std::array{along_, along_low_, free_, free_low_});
    for (std::size_t k = 0; k < 4; ++k) (*remembered_)[k] = *held()[k];
  }
  void return_to_remembered() {
    for (std::size_t k = 0; k < 4; ++k) *held()[k] = (*remembered_)[k];
    for (int i = 0; i < links_; ++i) {
      Vector product, low;
      for (std::size_t k = 0; k < D; ++k) {
        const Twofold<Real> exact = exact_product(along_[i][k], free_[i][k]);
        product[k] = exact.value;
        low[k] = exact.low;
      }
      product_[i] = total(product.data(), low.data());
    }
  }
  const Real* remembered_along(int i) const { return (*remembered_)[0][i]; }
  const Real* remembered_free(int i) const { return (*remembered_)[2][i]; }

  static constexpr int block = D == 2 ? 4 : 8;  ///< links that are worked on at a time
  static constexpr std::size_t block_size = block * D;

 private:
  using Wide = std::conditional_t<std::is_same_v<Real, double> || std::is_same_v<Real, float>, long double, Real>;

  /// Numbers of all links, and zeros behind them to the end of a block and for one more link.
  class Numbers {
    static constexpr int held(int links) { return (links + block - 1) / block * block + block; }

   public:
    explicit Numbers(int links) : numbers_(held(links)) {
      std::fill_n(numbers_.data(), static_cast<std::size_t>(held(links)) * D, Real(0));
    }
    Real* operator[](int link) { return numbers_[link]; }
    const Real* operator[](int link) const { return numbers_[link]; }

   private:
    detail::LinkArray<D, N == Eigen::Dynamic ? N : held(N), Real> numbers_;
  };

  // A block of a gauge, behind what the link before it left.
  struct Gauge {
    alignas(pack_alignment) Real lambda[block_size + D];
    alignas(pack_alignment) Real bond[block_size + D], bond_low[block_size + D];  // from the link before on
    alignas(pack_alignment) Real change[block_size], product[block_size], product_low[block_size];
  };

  static Vector vector(const Real* from) {
    return components<D>([&](std::size_t k) { return from[k]; });
  }

  static void set_multiplier(Real* to, const Real& multiplier) { std::fill_n(to, D, multiplier); }

  void shift_block(int begin, Gauge& __restrict gauge) {
    std::copy_n(gauge.bond + block_size, D, gauge.bond);
    std::copy_n(gauge.bond_low + block_size, D, gauge.bond_low);
    const Real* __restrict along = along_[begin], * __restrict along_low = along_low_[begin];
    const Real* __restrict inverse = inverse_mass_[begin], * __restrict inverse_low = inverse_mass_low_[begin];
    for (std::size_t k = 0; k < block_size; ++k) {
      const Twofold<Real> pull = exact_product(gauge.lambda[k], along[k]);
      const Twofold<Real> next = exact_product(gauge.lambda[k + D], along[k + D]);
      const Twofold<Real> both = exact_sum(pull.value, Real(-next.value));
      const Real low = both.low + ((pull.low + gauge.lambda[k] * along_low[k]) -
                                   (next.low + gauge.lambda[k + D] * along_low[k + D]));
      const Twofold<Real> bond = exact_product(inverse[k], both.value);
      gauge.bond[k + D] = bond.value;
      gauge.bond_low[k + D] = bond.low + (inverse[k] * low + inverse_low[k] * both.value);
    }
    Real* __restrict free = free_[begin], * __restrict free_low = free_low_[begin];
    const Real* __restrict gained = gained_[begin];
    for (std::size_t k = 0; k < block_size; ++k) {
      const Twofold<Real> shift = exact_sum(gauge.bond[k + D], Real(-gauge.bond[k]));
      const Real shift_low = shift.low + (gauge.bond_low[k + D] - gauge.bond_low[k]);
      const Twofold<Real> raw = exact_sum(free[k], shift.value);
      const Twofold<Real> z = exact_sum(raw.value, raw.low + (free_low[k] + shift_low));
      free[k] = z.value;
      free_low[k] = z.low;
      gauge.change[k] = gained[k] + shift.value;
      const Twofold<Real> product = exact_product(along[k], z.value);
      gauge.product[k] = product.value;
      gauge.product_low[k] = product.low;
    }
  }

  // Of one link, from the parts of its components.
  static Real total(const Real* product, const Real* low) {
    Twofold<Real> sum = exact_sum(product[0], product[1]);
    Real rest = sum.low + (low[0] + low[1]);
    if constexpr (D == 3) {
      sum = exact_sum(sum.value, product[2]);
      rest += sum.low + low[2];
    }
    return sum.value + rest;
  }

  static std::array<Wide, Space::dof> widened(const std::array<Real, Space::dof>& x) {
    std::array<Wide, Space::dof> wide;
    for (std::size_t a = 0; a < x.size(); ++a) wide[a] = Wide(x[a]);
    return wide;
  }

  static void split(const Wide& x, Real& value, Real& low) {
    value = Real(x);
    low = Real(x - Wide(value));
  }

  Real exact_product_of(int i) const {
    Vector product, low;
    for (std::size_t k = 0; k < D; ++k) {
      const Twofold<Real> exact = exact_product(along_[i][k], free_[i][k]);
      product[k] = exact.value;
      low[k] = exact.low + (along_[i][k] * free_low_[i][k] + along_low_[i][k] * free_[i][k]);
    }
    return total(product.data(), low.data());
  }

  // The rows of the multipliers, right(i) being what their equations have on the right (multipliers.hpp).
  template <class Right>
  void eliminate(const Links& links, Right right) const {
    MultiplierRow<Real> row;
    Real beyond(0);
    for (int i = links_; i-- > 0;) {
      const Vector rod = vector(along_[i]);
      const Real before = i == 0 ? Real(0) : Real(-links[i - 1].inverse_mass.value * dot(vector(along_[i - 1]), rod));
      rows_[i] = row = row.next(links[i].inverse_masses * dot(rod, rod), beyond, before, right(i));
      beyond = before;
    }
  }

  // What multipliers move the rods by, from the pivot out: visit(i, e_i − e_{i−1}, multiplier of rod i).
  template <class Visit>
  void for_each_bond(const Links& links, Visit visit) const {
    Real multiplier = rows_[0].offset;
    Vector before{};
    for (int i = 0; i < links_; ++i) {
      const bool last = i + 1 == links_;
      const Real next = last ? Real(0) : rows_[i + 1].offset - rows_[i + 1].coupling * multiplier;
      Vector pull = scaled(multiplier, vector(along_[i]));
      if (!last) pull = difference(pull, scaled(next, vector(along_[i + 1])));
      const Vector bond = scaled(links[i].inverse_mass.value, pull);
      visit(i, difference(bond, before), multiplier);
      before = bond;
      multiplier = next;
    }
  }

  std::array<Numbers*, 4> held() { return {&along_, &along_low_, &free_, &free_low_}; }

  int links_;
  Numbers along_, along_low_, free_, free_low_;
  Numbers gained_;  // by z in the last step, all gauges apart
  Numbers inverse_mass_, inverse_mass_low_;
  std::array<std::array<Numbers, 4>, 2> saved_{{{along_, along_, along_, along_}, {along_, along_, along_, along_}}};
  std::optional<std::array<Numbers, 4>> remembered_;
  detail::PerLink<Real, N> product_;
  mutable detail::PerLink<MultiplierRow<Real>, N> rows_;
  mutable detail::PerLink<Vector, N> rates_;
};

}  // namespace pendula
