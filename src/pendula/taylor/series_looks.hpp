#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/explicit/error_size.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/system_table.hpp>
#include <pendula/taylor/series_expansion.hpp>
#include <pendula/taylor/series_reach.hpp>
#include <span>

namespace pendula {

/// Checks whether steps of a Taylor series solve the equations on the way. Its terms do not show a force that almost
/// vanishes, with all its derivatives, where the step begins, such as a hill of a high power.
template <class Num>
class SeriesLooks {
 public:
  using L = Num;
  using Mask = MaskOf<L>;
  using Series = SeriesExpansion<L>;

  /// `systems` must outlive this object.
  SeriesLooks(MemberSystems<L>& systems, const Series& series, double tolerance)
      : systems_(systems),
        look_(most_looks, 2, systems.info().argument_is_base),
        largest_defect_(0.25 * series.order() * series.order() * std::max(tolerance, 1e-15)),
        moved_(series.row()),
        turned_(series.row()),
        seen_(2 * series.coordinates()),
        found_(series.coordinates()),
        arguments_(3 * systems.info().argument_is_base.size() + 1) {}

  /// A step that is tried: its series, the time where it begins and its size, and the series that has begun at its end.
  struct Step {
    const Series& series;
    const SeriesReach<L>& reach;
    const Series& ahead;
    L time, size;  // s
  };

  /// Returns which of these members solve the equations on the way. `rises_at_end` are Series::rises at the end.
  Mask hold(const Step& step, const PackRows<width_of<L>>& rises_at_end, const Mask& wanted) {
    const std::size_t n = step.series.coordinates();
    const L tau = step.size / step.series.unit();
    for (std::size_t i = 0; i < n; ++i) to_row(step.ahead.acceleration(i), found_[i]);
    Mask held = wanted & bends_so(step, tau);
    if (!look_.has_to_look() || !any(held)) return held;
    see(step.series, tau, rises_at_end);
    find_arguments(step.time + step.size, 2);
    const Mask is_far = held & goes_far(step);
    for (int k = 1; k < looks && any(held & is_far); ++k) {
      held = held & (solves(step, L(static_cast<double>(k) / looks)) | !is_far);
    }
    for (std::size_t i = 0; i < n; ++i) {
      to_row(step.series.coefficient(0, i), seen_[i]);
      to_row(step.series.velocity(i), seen_[n + i]);
    }
    find_arguments(step.time, 0);
    const L middle = fma(L(0.5), step.size, step.time);
    see(step.series, L(0.5) * tau);
    find_arguments(middle, 1);
    const Change change = change_of_arguments();
    const Mask is_larger = held & !change.is_small, is_close = is_larger & !change.is_even;
    if (any(is_larger & !is_close)) {
      find_accelerations(middle);
      held = held & (bends_so(step, L(0.5) * tau) | !(is_larger & !is_close));
    }
    return any(held & is_close) ? held & solves_closely(step, held & is_close) : held;
  }

 private:
  static constexpr std::size_t W = width_of<L>;
  // Every step compares accelerations at its end; one that goes far at so many places, the end among them. Functions
  // that may be narrow are looked at as closely as by a Gauss method of `most_looks` nodes.
  static constexpr int looks = 3, most_looks = 8;
  static constexpr double far_turn = 0.5, far_way = 0.25;  // rad; of the largest length
  static constexpr double largest_ratio = 10;  // of the largest to the smallest base of a power that changes evenly

  /// In which members the step goes so far that forces on the way may not show at its end.
  Mask goes_far(const Step& step) const {
    L turn(0.0), way(0.0), size(0.0);
    for (std::size_t i = 0; i < step.series.coordinates(); ++i) {
      const L from = step.series.coefficient(0, i), to = step.ahead.coefficient(0, i), moved = abs(to - from);
      if (systems_.info().is_angle[i]) {
        turn = max(turn, moved);
      } else {
        way = max(way, moved);
        size = max(size, max(abs(from), abs(to)));
      }
    }
    return (turn > L(far_turn)) | (way > L(far_way) * size);
  }

  /// Finds the motion of the series at a time.
  void see(const Series& series, const L& tau) {
    const std::size_t n = series.coordinates();
    series.sum_all(tau, Series::rises, moved_, 0, series.has_momenta() ? n : 2 * n);
    see(series, tau, moved_);
  }
  void see(const Series& series, const L& tau, const PackRows<W>& rises) {
    const std::size_t n = series.coordinates();
    const L inverse = L(1.0) / series.unit();
    if (series.has_momenta()) series.sum_all(tau, Series::slopes, turned_, 0, n);
    for (std::size_t i = 0; i < n; ++i) {
      to_row(fma(tau, from_row<L>(rises[i]), series.coefficient(0, i)), seen_[i]);
      to_row(series.has_momenta() ? from_row<L>(turned_[i]) * inverse
                                  : fma(tau, from_row<L>(rises[n + i]), series.coefficient(0, n + i)),
             seen_[n + i]);
    }
  }

  /// Whether accelerations at a fraction of the step are those of the series.
  Mask solves(const Step& step, const L& share) {
    const L tau = share * step.size / step.series.unit();
    see(step.series, tau);
    find_accelerations(fma(share, step.size, step.time));
    return bends_so(step, tau);
  }

  /// Finds the accelerations of the state in seen_.
  void find_accelerations(const L& time) {
    systems_.here(time, &SystemFunctions::acceleration, seen_[0], seen_[seen_.rows() / 2], found_[0]);
  }

  /// Whether the second derivative of the series is the acceleration in found_, up to the allowed defect and to
  /// rounding of coordinates: where a motion dies away far from 0, only rounding is left.
  Mask bends_so(const Step& step, const L& tau) {
    const Series& series = step.series;
    const std::size_t n = series.coordinates();
    const L inverse = L(1.0) / series.unit();
    if (series.has_momenta()) {
      series.sum_all(tau, Series::bends, turned_, 0, n);
    } else {
      series.sum_all(tau, Series::slopes, turned_, n, 2 * n);
    }
    L farthest(0.0);
    for (std::size_t i = 0; i < n; ++i) farthest = max(farthest, abs(series.coefficient(0, i)));
    Mask held(L(0.0) == L(0.0));
    for (std::size_t i = 0; i < n; ++i) {
      const L by_series =
          series.has_momenta() ? from_row<L>(turned_[i]) * (inverse * inverse) : from_row<L>(turned_[n + i]) * inverse;
      const L off = step.size * series.unit() * abs(from_row<L>(found_[i]) - by_series);
      const L defect = max(off - L(ErrorSize::rounding) * farthest, L(0.0));
      held = held & (defect * step.reach.rate_scale(i) <= L(largest_defect_));
    }
    return held;
  }

  /// Finds the arguments of functions that may be narrow, at the state in seen_. Looks 0, 1 and 2 are the start, the
  /// middle and the end of the step.
  void find_arguments(const L& time, int look) {
    systems_.here(time, &SystemFunctions::call_arguments, seen_[0], seen_[seen_.rows() / 2], argument(look, 0));
  }
  double* argument(int look, std::size_t a) {
    return arguments_[static_cast<std::size_t>(look) * systems_.info().argument_is_base.size() + a];
  }

  /// How arguments change from look to look: by little; or evenly, where only bases of powers change by more, by less
  /// than `largest_ratio` in all, and do not turn near zero between the looks. The middle and the end show such powers.
  struct Change {
    Mask is_small, is_even;
  };
  Change change_of_arguments() {
    const std::span<const bool> is_base = systems_.info().argument_is_base;
    const Mask yes(L(0.0) == L(0.0));
    Change change{yes, yes};
    for (std::size_t a = 0; a < is_base.size(); ++a) {
      const L begin = from_row<L>(argument(0, a)), middle = from_row<L>(argument(1, a)),
              end = from_row<L>(argument(2, a));
      const L low = min(abs(middle), min(abs(begin), abs(end)));
      const L size = is_base[a] ? low : L(1.0), much = L(FieldLook::much) * size;
      const Mask is_small = max(abs(middle - begin), abs(end - middle)) <= much;
      change.is_small = change.is_small & is_small;
      if (!is_base[a]) {
        change.is_even = change.is_even & is_small;
        continue;
      }
      // The parabola through the looks turns at -slope/bend, in halves of the step from its middle.
      const L slope = L(0.5) * (end - begin), bend = begin - L(2.0) * middle + end;
      const L turn = select(abs(slope) < abs(bend), fma(L(-0.5) * slope, slope / bend, middle), middle);
      const L high = max(max(abs(begin), abs(end)), max(abs(middle), abs(turn)));
      const Mask has_one_sign = min(min(begin * middle, middle * end), middle * turn) > L(0.0);
      const Mask stays_away = abs(turn) >= L(0.5) * low, is_within = high <= L(largest_ratio) * low;
      change.is_even = change.is_even & (is_small | (has_one_sign & stays_away & is_within));
    }
    return change;
  }

  /// Checks the members in `which` wherever such functions change fast within the step. Returns false for those of them
  /// that do not solve the equations there, true for all others.
  Mask solves_closely(const Step& step, const Mask& which) {
    const L asked = select(which, L(1.0), L(0.0));
    L wrong(0.0);
    for (int lane = 0; lane < static_cast<int>(W); ++lane) {
      if (get(asked, lane) != 0 && !solves_closely(step, lane)) set(wrong, lane, 1);
    }
    return wrong == L(0.0);
  }
  bool solves_closely(const Step& step, int lane) {
    const auto arguments = [&](std::span<const double> shares, double* found) {
      for (const double share : shares) {
        see(step.series, L(share) * step.size / step.series.unit());
        find_arguments(fma(L(share), step.size, step.time), 0);
        for (std::size_t a = 0; a < systems_.info().argument_is_base.size(); ++a) *found++ = argument(0, a)[lane];
      }
    };
    return !look_.finds(arguments) || look_.holds_at_nodes([&](double share) {
      return get(select(solves(step, L(share)), L(1.0), L(0.0)), lane) != 0;
    });
  }

  MemberSystems<L>& systems_;
  FieldLook look_;
  double largest_defect_;       // of accelerations, times h, relative to scales
  PackRows<W> moved_, turned_;  // sums of coordinates and rates
  PackRows<W> seen_;            // a motion on the way of the step
  PackRows<W> found_;           // accelerations there
  PackRows<W> arguments_;       // of functions that may be narrow, at three places of the step
};

}  // namespace pendula
