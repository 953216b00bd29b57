#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/system/moving_part.hpp>

namespace pendula {

/// Taylor series of the motions of several chains, one in each lane, about their current states. They are computed for
/// rods, whose equations contain only products, so that each coefficient is a sum of products of earlier ones. Chains
/// must have no loads. `Rods` is ChainAccelerations, with or without a tangent of each member.
template <class Rods>
class ChainSeries {
 public:
  using L = typename Rods::L;
  using Number = typename Rods::Number;
  using Part = typename Rods::Part;
  using Parts = typename Rods::Parts;
  static constexpr std::size_t D = Rods::D;
  static constexpr int most_order = 24;

  /// Series of rates up to t^order, of rods up to one order more; order ≤ most_order. Their unit of time is 1/pace.
  ChainSeries(const Rods& rods, int order)
      : order_(order), links_(rods.links()), sums_(Rods::is_short ? 1 : rods.links()) {}

  int order() const { return order_; }

  /// Computes the series about `parts`, a state of `rods`; pace  [1/s].
  PENDULA_IN_REGISTERS [[gnu::noinline]] void expand(const Rods& rods, const Parts& parts, const L& pace) {
    const L unit = L(1.0) / pace;
    for (std::size_t k = 1; k <= static_cast<std::size_t>(order_) + 1; ++k)
      inverses_[k] = L(1.0 / static_cast<double>(k)) * unit;
    begin(rods, parts);
    for (std::size_t k = 0; k < static_cast<std::size_t>(order_); ++k) {
      if constexpr (Rods::is_short) {
        detail::PerLink<Sums, Rods::links_known> sums(Rods::links_known);
        add_order(rods, k, sums);
      } else {
        add_order(rods, k, sums_);
      }
    }
    const auto last = static_cast<std::size_t>(order_) + 1;
    rods.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      for (std::size_t d = 0; d < D; ++d) at(i).place[d][last] = inverses_[last] * at(i).rate[d][last - 1];
    });
  }

  /// Coefficient of (pace t)^k.
  Part term(int i, int k) const {
    const Link& link = at(i);
    const auto order = static_cast<std::size_t>(k);
    Part term;
    for (std::size_t d = 0; d < D; ++d) {
      term.place[d] = link.place[d][order];
      term.rate[d] = link.rate[d][order];
    }
    return term;
  }

  /// The change in the time t/pace, over t.
  [[gnu::always_inline]] Part rise(int i, const L& t) const {
    const auto last = static_cast<std::size_t>(order_);
    const Link& link = at(i);
    Part rise;
    for (std::size_t d = 0; d < D; ++d) rise.place[d] = link.place[d][last + 1];
    for (std::size_t d = 0; d < D; ++d) rise.rate[d] = link.rate[d][last];
    for (std::size_t d = 0; d < D; ++d) rise.place[d] = fma(t, rise.place[d], link.place[d][last]);
    for (std::size_t k = last; k-- > 1;) {
      for (std::size_t d = 0; d < D; ++d) {
        rise.place[d] = fma(t, rise.place[d], link.place[d][k]);
        rise.rate[d] = fma(t, rise.rate[d], link.rate[d][k]);
      }
    }
    return rise;
  }

  /// Value after the time t/pace.
  [[gnu::always_inline]] Part sum(int i, const L& t) const {
    const Link& link = at(i);
    Part there = rise(i, t);
    for (std::size_t d = 0; d < D; ++d) {
      there.place[d] = fma(t, there.place[d], link.place[d][0]);
      there.rate[d] = fma(t, there.rate[d], link.rate[d][0]);
    }
    return there;
  }

 private:
  using Terms = std::array<Number, static_cast<std::size_t>(most_order) + 2>;
  using Vector = std::array<Number, D>;

  struct Link {
    std::array<Terms, D> place, rate;  // ξ, ξ̇
    Terms tau;
    Terms beyond;              // −ξ_i·ξ_{i+1}/m_i
    Number inverse, coupling;  // MultiplierRow, the same for all orders
  };

  // Contributions of earlier coefficients to those of order k, for a rod and the next one.
  struct Sums {
    Vector pull = none(), across = none(), squares = none();
    Number here{0.0}, there{0.0};  // contributions of ξ_i·ξ_{i+1} to the right-hand sides of both
    Number right{0.0}, tau{0.0};
  };

  Link& at(int i) { return Rods::at(links_, i); }
  const Link& at(int i) const { return Rods::at(links_, i); }

  static Number total(const Vector& sums) {
    Number total = sums[0];
    for (std::size_t d = 1; d < D; ++d) total = total + sums[d];
    return total;
  }
  static Vector none() {
    Vector zero;
    zero.fill(Number(0.0));
    return zero;
  }

  void begin(const Rods& rods, const Parts& parts) {
    rods.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      for (std::size_t d = 0; d < D; ++d) {
        at(i).place[d][0] = Rods::at(parts, i).place[d];
        at(i).rate[d][0] = Rods::at(parts, i).rate[d];
      }
    });
    Number coupled(0.0);  // what the link beyond subtracts
    rods.for_parts_inward([&](auto i) PENDULA_WRITTEN_OUT {
      Link& link = at(i);
      const Number square = rods.link(i).inverse_masses * dot(Rods::at(parts, i).place, Rods::at(parts, i).place);
      link.inverse = Number(1.0) / (square - coupled);
      if (i == 0) return;
      Link& before = at(i - 1);
      before.beyond[0] =
          -rods.link(i - 1).inverse_mass.value * dot(Rods::at(parts, i - 1).place, Rods::at(parts, i).place);
      link.coupling = before.beyond[0] * link.inverse;
      coupled = before.beyond[0] * link.coupling;
    });
  }

  template <class AllSums>
  [[gnu::always_inline]] void add_order(const Rods& rods, std::size_t k, AllSums& sums) {
    add_all_pairs(rods, k, sums);
    rods.for_parts([&](auto i) PENDULA_WRITTEN_OUT { add_unpaired(rods, i, k, sums); });
    solve(rods, k, sums);
    raise_order(rods, k, sums);
  }

  // Products of orders j and k − j, without those of order 0. Pairs with the most recent factors come last.
  template <class AllSums>
  [[gnu::always_inline]] void add_all_pairs(const Rods& rods, std::size_t k, AllSums& sums) {
    if constexpr (Rods::is_short) {
      for (std::size_t j = (k + 1) / 2; j-- > 1;) add_pairs<Rods::links_known, false>(0, j, k - j, sums);
    } else {
      const int last = rods.links() - 1;
      for (int i = 0; i < last; ++i) {
        detail::PerLink<Sums, 1> sum(1);
        for (std::size_t j = (k + 1) / 2; j-- > 1;) add_pairs<1, true>(i, j, k - j, sum);
        sums[i] = sum[0];
      }
      detail::PerLink<Sums, 1> sum(1);
      for (std::size_t j = (k + 1) / 2; j-- > 1;) add_pairs<1, false>(last, j, k - j, sum);
      sums[last] = sum[0];
    }
  }

  // Products of orders j and l = k − j, for `Count` rods from `first` on, and for the last of them with the next rod.
  template <int Count, bool goes_on, class SomeSums>
  [[gnu::always_inline]] void add_pairs(int first, std::size_t j, std::size_t l, SomeSums& sums) {
    constexpr std::size_t held = Count + (goes_on ? 1 : 0);
    Number place[held][D], place_later[held][D], tau[held], tau_later[held];
    detail::unrolled<static_cast<int>(held)>([&](auto number) PENDULA_WRITTEN_OUT {
      constexpr auto i = static_cast<std::size_t>(number);
      const Link& link = at(first + number);
      for (std::size_t d = 0; d < D; ++d) {
        place[i][d] = in_register(link.place[d][j]);
        place_later[i][d] = in_register(link.place[d][l]);
      }
      tau[i] = in_register(link.tau[j]);
      tau_later[i] = in_register(link.tau[l]);
    });
    detail::unrolled<Count>([&](auto number) PENDULA_WRITTEN_OUT {
      constexpr auto i = static_cast<std::size_t>(number);
      const Link& link = at(first + number);
      Sums& sum = sums[number];
      for (std::size_t d = 0; d < D; ++d) {
        sum.pull[d] = fma(tau[i], place_later[i][d], fma(tau_later[i], place[i][d], sum.pull[d]));
        sum.squares[d] = fma(link.rate[d][j], link.rate[d][l], sum.squares[d]);
      }
      if constexpr (i + 1 < held) {
        for (std::size_t d = 0; d < D; ++d) {
          const Number added = fma(place_later[i][d], place[i + 1][d], sum.across[d]);
          sum.across[d] = fma(place[i][d], place_later[i + 1][d], added);
        }
        const Number beyond = in_register(link.beyond[j]), beyond_later = in_register(link.beyond[l]);
        sum.here = fma(beyond, tau_later[i + 1], fma(beyond_later, tau[i + 1], sum.here));
        sum.there = fma(beyond, tau_later[i], fma(beyond_later, tau[i], sum.there));
      }
    });
  }

  // Adds the middle term, which has no partner, and terms whose factor of order 0 has a known partner.
  template <class AllSums>
  [[gnu::always_inline]] void add_unpaired(const Rods& rods, int i, std::size_t k, AllSums& sums) {
    const bool is_even = k % 2 == 0;
    Link& link = at(i);
    auto& sum = Rods::at(sums, i);
    if (k > 0) {
      for (std::size_t d = 0; d < D; ++d) {
        sum.squares[d] = fma(link.rate[d][0], link.rate[d][k], sum.squares[d]);
        sum.pull[d] = fma(link.tau[0], link.place[d][k], sum.pull[d]);
        if (is_even) sum.pull[d] = fma(link.tau[k / 2], link.place[d][k / 2], sum.pull[d]);
      }
    }
    for (std::size_t d = 0; d < D; ++d) {
      sum.squares[d] = sum.squares[d] + sum.squares[d];
      if (is_even) sum.squares[d] = fma(link.rate[d][k / 2], link.rate[d][k / 2], sum.squares[d]);
    }
    sum.right = sum.right - total(sum.squares);
    if (i == 0) sum.right = fma(link.place[D - 1][k], rods.gravity(), sum.right);
    if (k == 0 || i + 1 == rods.links()) return;
    Link& next = at(i + 1);
    if (is_even) {
      for (std::size_t d = 0; d < D; ++d) {
        sum.across[d] = fma(link.place[d][k / 2], next.place[d][k / 2], sum.across[d]);
      }
      sum.here = fma(link.beyond[k / 2], next.tau[k / 2], sum.here);
      sum.there = fma(link.beyond[k / 2], link.tau[k / 2], sum.there);
    }
    for (std::size_t d = 0; d < D; ++d) {
      sum.across[d] = fma(link.place[d][0], next.place[d][k], sum.across[d]);
      sum.across[d] = fma(link.place[d][k], next.place[d][0], sum.across[d]);
    }
    const Number beyond = -rods.link(i).inverse_mass.value * total(sum.across);
    link.beyond[k] = beyond;
    sum.right = sum.right - fma(beyond, next.tau[0], sum.here);
    Rods::at(sums, i + 1).right = Rods::at(sums, i + 1).right - fma(beyond, link.tau[0], sum.there);
  }

  template <class AllSums>
  [[gnu::always_inline]] void solve(const Rods& rods, std::size_t k, AllSums& sums) {
    Number offset(0.0);
    rods.for_parts_inward([&](auto i) PENDULA_WRITTEN_OUT {
      auto& sum = Rods::at(sums, i);
      if (i + 1 < rods.links()) sum.right = fma(-at(i).beyond[0], offset, sum.right);
      offset = sum.right * at(i).inverse;
      sum.tau = offset;
    });
    Number tau(0.0);
    rods.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      Link& link = at(i);
      auto& sum = Rods::at(sums, i);
      tau = i == 0 ? sum.tau : fma(-link.coupling, tau, sum.tau);
      link.tau[k] = tau;
      for (std::size_t d = 0; d < D; ++d) sum.pull[d] = fma(tau, link.place[d][0], sum.pull[d]);
    });
  }

  // Integrates to order k + 1.
  template <class AllSums>
  [[gnu::always_inline]] void raise_order(const Rods& rods, std::size_t k, AllSums& sums) {
    const L& inverse = inverses_[k + 1];
    Vector before = none();
    if (k == 0) before[D - 1] = Number(rods.gravity());
    rods.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      Link& link = at(i);
      for (std::size_t d = 0; d < D; ++d) {
        Number pulled = Rods::at(sums, i).pull[d];
        if (i + 1 < rods.links()) pulled = pulled - Rods::at(sums, i + 1).pull[d];
        const Number bond = rods.link(i).inverse_mass.value * pulled;
        link.rate[d][k + 1] = inverse * (bond - before[d]);
        link.place[d][k + 1] = inverse * link.rate[d][k];
        before[d] = bond;
      }
    });
  }

  int order_;
  std::array<L, static_cast<std::size_t>(most_order) + 2> inverses_;  // 1/(k pace)
  detail::PerLink<Link, Rods::links_known> links_;
  detail::PerLink<Sums, Rods::is_short ? 1 : Rods::links_known> sums_;
};

}  // namespace pendula
