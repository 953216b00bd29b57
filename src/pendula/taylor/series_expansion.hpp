#pragma once

#include <cstddef>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/series_info.hpp>
#include <pendula/system/system_table.hpp>
#include <type_traits>

namespace pendula {

/// The Taylor series of one motion about a state, or of several, one in each lane: coefficients in powers of τ, time
/// over a unit of time; the numbers that their kernel keeps; and sums of the series.
template <class Num>
class SeriesExpansion {
 public:
  using L = Num;
  static constexpr std::size_t W = width_of<L>;

  SeriesExpansion(const MemberSystems<L>& systems, int order)
      : info_(systems.info().series),
        n_(static_cast<std::size_t>(systems.coordinates())),
        row_(series_state_row(n_, W) / W),
        order_(order),
        // Room up to a multiple of four orders, zero beyond the last one: sums are taken four by four.
        state_((static_cast<std::size_t>(order) + 5) * row_),
        kept_(static_cast<std::size_t>(info_.kept) + 1),
        operands_(static_cast<std::size_t>(order) * series_operand_row(info_, W) / W + 1),
        inputs_((static_cast<std::size_t>(order) + 1) * systems.info().inputs.size() + 1),
        unit_(1) {}

  /// Number of coordinates; numbers in a row of states, with padding.
  std::size_t coordinates() const { return n_; }
  std::size_t row() const { return row_; }
  int order() const { return order_; }
  bool has_momenta() const { return info_.has_momenta; }
  L unit() const { return from_row<L>(unit_[0]); }
  double* numbers() { return state_[0]; }
  double* inputs() { return inputs_[0]; }

  /// Computes the first orders of the series about a state, as many as give the accelerations there.
  void begin(MemberSystems<L>& systems, const L& time, const L& unit, const PackRows<W>& state) {
    for (std::size_t k = 0; k < 2 * n_; ++k) to_row(from_row<L>(state[k]), state_[k]);
    to_row(unit, unit_[0]);
    systems.begin_series(time, unit, order_, begun_orders(), inputs_, rows());
  }
  /// Computes the remaining orders.
  void finish(MemberSystems<L>& systems, const L& time) {
    systems.end_series(time, begun_orders() + 1, order_ - 1, inputs_, rows());
  }

  L coefficient(std::size_t order, std::size_t k) const { return from_row<L>(state_[order * row_ + k]); }
  /// The coefficients in a part of a row (for_each_part).
  template <class Lanes>
  Lanes coefficients(std::size_t order, std::size_t part) const {
    return from_row<Lanes>(state_[order * row_ + part]);
  }
  /// A coefficient of a rate, times the unit of time.
  L rate(std::size_t order, std::size_t i) const {
    if (!info_.has_momenta) return unit() * coefficient(order, n_ + i);
    return L(static_cast<double>(order + 1)) * coefficient(order + 1, i);
  }

  /// A rate at the state, and an acceleration.
  L velocity(std::size_t i) const { return info_.has_momenta ? coefficient(1, i) / unit() : coefficient(0, n_ + i); }
  L acceleration(std::size_t i) const {
    const L inverse = L(1.0) / unit();
    return info_.has_momenta ? L(2.0) * coefficient(2, i) * (inverse * inverse) : coefficient(1, n_ + i) * inverse;
  }

  /// Σ term(k+1) τ^k, in four strands that do not wait for one another.
  template <class Lanes, class Term>
  Lanes sum_of(const Lanes& tau, Term term) const {
    const Lanes tau2 = tau * tau, tau4 = tau2 * tau2;
    std::size_t order = (static_cast<std::size_t>(order_) + 3) / 4 * 4;
    Lanes a = term(order - 3), b = term(order - 2), c = term(order - 1), d = term(order);
    for (order -= 4; order > 0; order -= 4) {
      a = fma(a, tau4, term(order - 3));
      b = fma(b, tau4, term(order - 2));
      c = fma(c, tau4, term(order - 1));
      d = fma(d, tau4, term(order));
    }
    return fma(fma(d, tau, c), tau2, fma(b, tau, a));
  }

  /// Σ c_(k+1) τ^k
  L rise(std::size_t k, const L& tau) const {
    return sum_of(tau, [&](std::size_t order) { return coefficient(order, k); });
  }

  /// Σ c_k τ^k
  L sum(std::size_t k, const L& tau) const { return fma(tau, rise(k, tau), coefficient(0, k)); }

  /// Σ (k+1) c_(k+1) τ^k
  L slope(std::size_t k, const L& tau) const {
    return sum_of(tau, [&](std::size_t order) { return L(static_cast<double>(order)) * coefficient(order, k); });
  }

  /// Weights w and orders d of sums Σ w c_(k+d) τ^(k−1), k = 1, 2, …. Rises: the polynomial less its constant, over τ;
  /// Slopes and Bends: its first and second derivatives.
  struct Rises {
    static constexpr std::size_t ahead = 0;
    static double weight(std::size_t /*k*/) { return 1; }
  };
  struct Slopes {
    static constexpr std::size_t ahead = 0;
    static double weight(std::size_t k) { return static_cast<double>(k); }
  };
  struct Bends {
    static constexpr std::size_t ahead = 1;
    static double weight(std::size_t k) { return static_cast<double>(k * (k + 1)); }
  };
  static constexpr Rises rises{};
  static constexpr Slopes slopes{};
  static constexpr Bends bends{};

  /// Computes such sums for the numbers of a state from `begin` to `end`; for one motion also for those that share a
  /// register with them.
  template <class Which>
  void sum_all(const L& tau, Which which, PackRows<W>& to, std::size_t begin, std::size_t end) const {
    const auto add = [&]<class Lanes>(const Lanes& at, std::size_t first, std::type_identity<Lanes>) {
      to_row(sum_of(at,
                    [&](std::size_t k) {
                      const Lanes row = coefficients<Lanes>(k + which.ahead, first);
                      if constexpr (std::is_same_v<Which, Rises>) return row;
                      return Lanes(which.weight(k)) * row;
                    }),
             to[first]);
    };
    for_each_part([&]<class Lanes>(std::size_t first, std::type_identity<Lanes> lanes) {
      constexpr std::size_t together = is_batch<L> ? 1 : static_cast<std::size_t>(Lanes::size);
      if (first < end && first + together > begin) add(Lanes(tau), first, lanes);
    });
  }

  /// Calls visit(first, type) for the parts of a row of states that fill a register: several numbers of one motion, or
  /// one number of all members.
  template <class Visit>
  [[gnu::always_inline]] void for_each_part(Visit visit) const {
    if constexpr (is_batch<L>) {
      for (std::size_t k = 0; k < row_; ++k) visit(k, std::type_identity<L>());
    } else if (row_ == 4) {
      visit(0, std::type_identity<Pack<4, RegisterFor<4>>>());
    } else {
      for (std::size_t k = 0; k < row_; k += 8) visit(k, std::type_identity<Pack<8, RegisterFor<8>>>());
    }
  }

 private:
  int begun_orders() const { return info_.has_momenta ? 1 : 0; }
  SeriesRows rows() { return {.unit = unit_[0], .state = state_[0], .kept = kept_[0], .operands = operands_[0]}; }

  SeriesInfo info_;
  std::size_t n_, row_;
  int order_;
  PackRows<W> state_, kept_, operands_, inputs_, unit_;
};

}  // namespace pendula
