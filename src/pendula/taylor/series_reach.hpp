#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <pendula/explicit/error_size.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/series_info.hpp>
#include <pendula/taylor/series_expansion.hpp>
#include <pendula/taylor/series_limits.hpp>
#include <span>
#include <type_traits>

namespace pendula {

/// Finds the longest step that the Taylor series of a kernel allows, by its last terms.
template <class Num>
class SeriesReach {
 public:
  using L = Num;
  using Mask = MaskOf<L>;
  using Series = SeriesExpansion<L>;
  static constexpr std::size_t looked_at = 4;  // last terms

  /// The order that needs the fewest operations for a tolerance.
  static int order_for(double tolerance) {
    const double order = 4 - 1.25 * std::log10(std::max(tolerance, detail::finest_of_series));
    return std::clamp(static_cast<int>(std::lround(order)), least_order, most_order);
  }

  SeriesReach(const Series& series, std::span<const bool> is_angle, double tolerance)
      : is_angle_(is_angle),
        log_reach_(std::log2(std::max(tolerance, detail::finest_of_series)) / series.order()),
        scales_(series.row()),
        rate_scales_(series.row()) {}

  /// The longest step, from the decay of the last terms, relative to the size of the motion  [s]; 0 if one is not
  /// finite. Several terms are used: motions that start at rest, and symmetric ones, have only every second or fourth.
  L longest_step(const Series& series) {
    find_scales(series);
    const std::size_t first = static_cast<std::size_t>(series.order()) - looked_at + (series.has_momenta() ? 0 : 1);
    std::array<L, looked_at> terms;
    const Mask are_finite = find_terms(series, first, terms);
    L log_radius(detail::largest_log_radius);
    for (std::size_t k = 0; k < looked_at; ++k) {
      const L log_term = log2_near(max(terms[k], L(detail::almost_zero)));
      log_radius = min(log_radius, L(-1.0 / static_cast<double>(first + k)) * log_term);
    }
    return select(are_finite, min(step_of(series, log_radius), longest_turn(series)), L(0.0));
  }

  /// The step for a radius of convergence, log₂ in units of time.
  L step_of(const Series& series, const L& log_radius) const {
    return exp(L(std::numbers::ln2) * min(log_radius + L(log_reach_), L(600.0))) * series.unit();
  }

  /// Multiplies an error of rate i, times the unit of time, to make it relative to the motion of the last series.
  L rate_scale(std::size_t i) const { return from_row<L>(rate_scales_[i]); }

 private:
  static constexpr int least_order = 6, most_order = 32;
  static constexpr double most_turn = 3;  // rad within a step, so that it is not from hill to hill

  /// Finds the largest term of each order from `first` on. Returns for which members all are finite.
  Mask find_terms(const Series& series, std::size_t first, std::array<L, looked_at>& terms) const {
    terms.fill(L(0.0));
    L none(0.0);
    series.for_each_part([&]<class Lanes>(std::size_t part, std::type_identity<Lanes>) {
      if (is_batch<L> && series.has_momenta() && part >= series.coordinates()) return;  // momenta are not compared
      const Lanes scale = from_row<Lanes>(scales_[part]), rate_scale = from_row<Lanes>(rate_scales_[part]);
      Lanes lost(0.0);
      for (std::size_t j = 0; j < looked_at; ++j) {
        const std::size_t order = first + j;
        const Lanes place = series.template coefficients<Lanes>(order, part) * scale;
        Lanes largest = abs(place);
        lost = lost + (place - place);
        if (series.has_momenta()) {
          const Lanes weight(static_cast<double>(order + 1));
          const Lanes rate = series.template coefficients<Lanes>(order + 1, part) * (weight * rate_scale);
          largest = max(largest, abs(rate));
          lost = lost + (rate - rate);
        }
        for_each_number(largest, [&](const L& one) { terms[j] = max(terms[j], one); });
      }
      for_each_number(lost, [&](const L& one) { none = none + one; });
    });
    return none == L(0.0);
  }

  /// Calls visit(number) for each number of one motion in a register, or once for a register of several members.
  template <class Lanes, class Visit>
  [[gnu::always_inline]] static void for_each_number(const Lanes& lanes, Visit visit) {
    if constexpr (std::is_same_v<Lanes, L>) {
      visit(lanes);
    } else {
      alignas(pack_alignment) std::array<double, Lanes::size> numbers;
      lanes.store(numbers.data());
      for (const double number : numbers) visit(number);
    }
  }

  /// The time in which no angle turns by more than `most_turn`, as fast as it does now  [s].
  L longest_turn(const Series& series) const {
    L fastest(detail::almost_zero);
    for (std::size_t i = 0; i < series.coordinates(); ++i) {
      if (is_angle_[i]) fastest = max(fastest, abs(series.rate(0, i)));
    }
    return L(most_turn) * series.unit() / fastest;
  }

  /// Terms are relative to each coordinate itself, plus 1 rad or the size of the whole motion if that is smaller, so
  /// that oscillations of 1e-9 rad are resolved like any other; rates, times the unit of time, likewise. Full turns
  /// that an angle has made count for nothing.
  void find_scales(const Series& series) {
    const std::size_t n = series.coordinates();
    L q(0.0), v(0.0), a(0.0);
    for (std::size_t i = 0; i < n; ++i) {
      q = max(q, abs(series.coefficient(0, i)));
      v = max(v, abs(series.rate(0, i)));
      a = max(a, abs(series.rate(1, i)));
    }
    const auto within = [](const L& x) { return min(max(x, L(ErrorSize::nothing)), L(1.0)); };
    const L places = within(max(q, v)), speeds = within(max(max(v, a), L(ErrorSize::rounding) * q));
    for (std::size_t i = 0; i < n; ++i) {
      const L place = abs(series.coefficient(0, i)), size = is_angle_[i] ? min(place, L(1.0)) : place;
      const L of_rate = L(1.0) / (speeds + abs(series.rate(0, i)));
      to_row(L(1.0) / (places + size), scales_[i]);
      to_row(of_rate, rate_scales_[i]);
      if (!series.has_momenta()) to_row(series.unit() * of_rate, scales_[n + i]);
    }
  }

  std::span<const bool> is_angle_;
  double log_reach_;  // step size relative to the estimated radius of convergence, log₂
  // Factors that make terms relative: of coordinates and of rates times the unit of time; of rates themselves.
  PackRows<width_of<L>> scales_, rate_scales_;
};

}  // namespace pendula
