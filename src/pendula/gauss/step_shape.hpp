#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// The pace of a motion, and how the pace changes.
template <class Num>
struct TempoOf {
  Num pace{0.0};        ///< R: 1/R is the time in which the motion changes  [1/s]
  Num quickening{0.0};  ///< d ln R/dt; the opposite for the motion backwards  [1/s]
};
using Tempo = TempoOf<double>;

/// The Legendre coefficients of a step. Their decay from degree to degree tells the error of the step.
template <class Num>
struct StepDecay {
  /// The Legendre coefficients of the rates on the step, times h, relative to the size of the motion, squared  [rad²].
  std::array<Num, max_stages> squares;
  /// The square of the coefficient of degree s, the first that s stages cannot show: by how much their polynomial
  /// misses the rates at the start of the step. 0 if not computed.
  Num beyond{0.0};
  Num moved{0.0};      ///< (h R)², R in the middle
  Num imbalance{0.0};  ///< relative error of the energy in the step, not squared; 0 if not computed

  /// Whether the error of a step of so many stages depends on a coefficient.
  static constexpr bool needs(int degree, int stages) { return degree < 2 || degree + 4 >= stages; }

  /// The length of the step relative to 1/R, the time in which the motion changes; at least a little, because where
  /// motion only begins, R does not tell how fast it will be.
  Num time() const { return max(sqrt(moved), Num(shortest)); }

  /// The logarithm of the error of a step by a method of this order and so many stages, relative to the size of the
  /// motion and `time`.
  ///
  /// Coefficients of analytic motion decay geometrically, and the quadrature misses those from degree `order` on. They
  /// are extrapolated from the last known ones, by the mean decay from h R to these. For swings that are small beside a
  /// radian the decay counts from the first coefficients. Where the decay among the last four coefficients is slower,
  /// it counts instead.
  Num log_error(int stages, int order) const {
    const Num log_moved = log_root(moved);
    const Num least = select(beyond > Num(0.0), Num(std::log(shortest_damped)), Num(std::log(shortest)));
    return log_of_step(log_moved, stages, order) - max(log_moved, least);
  }

  /// The logarithm of the part of the rates at the start of the step that no stage sees, relative to the rates of the
  /// motion: motion that is damped before the first stage does not show in the coefficients.
  Num log_unseen(int stages) const {
    if (!any(beyond > Num(0.0))) return Num(never);
    const Num missed = log_root(beyond) - log_root(moved);
    const Num& last = at(stages - 1);
    const Num shown = stages == 1 ? last : max(last, at(stages - 2));
    return select((beyond > Num(jump * jump) * shown) & (missed > Num(std::log(rounding))), missed, Num(never));
  }

  static constexpr double never = -700;  ///< a logarithm below those of all errors

 private:
  static constexpr double shortest = 1e-3;
  static constexpr double shortest_damped = 1e-9;  // where rates may be damped far faster than anything else happens
  static constexpr double small = 10;              // h R over the largest coefficient
  static constexpr double jump = 10;  // from the last known coefficients to the next: larger than in any smooth motion
  // Coefficients that are smaller, relative to h R, may be rounding, and errors that follow from them do not matter.
  static constexpr double rounding = 1e-13;

  static Num log_root(const Num& square) { return Num(0.5) * log(max(square, Num(detail::almost_zero))); }
  const Num& at(int k) const { return squares[static_cast<std::size_t>(k)]; }

  Num log_of_step(const Num& log_moved, int stages, int order) const {
    if (stages == 1) return Num(3.0) * log_moved;
    const Num noise = log_moved + Num(std::log(rounding));
    const Num largest = max(at(0), at(1) / min(moved, Num(1.0)));
    const Num size = min(log_moved, log_root(largest) + Num(std::log(small)));
    // The first coefficient that the quadrature misses, of degree `order`, if the decay from `size` to degree k goes
    // on.
    const auto extended = [&](const Num& coefficient, int k) {
      const Num error = fma(coefficient - size, Num((order - k) / double(k)), coefficient);
      return select(coefficient > noise, error, Num(never));
    };
    const Num last = log_root(at(stages - 1));
    Num error = extended(last, stages - 1);
    const Num next = log_root(at(stages - 2));
    if (stages > 2) error = max(error, extended(next, stages - 2));
    if (stages <= 3) {
      // Few stages do not show a damped part beside an undamped one. With two, all depends on one coefficient, which
      // vanishes where loads balance gravity.
      const Num unseen = log_root(beyond), ratio = min(Num(0.0), unseen - last);
      return select(unseen > noise, max(error, fma(ratio, Num(double(order - stages)), unseen)), error);
    }
    const Num later = max(at(stages - 1), Num(detail::almost_zero)) + max(at(stages - 2), Num(detail::almost_zero));
    const Num before = max(at(stages - 3), Num(detail::almost_zero)) + at(stages - 4);
    const Num ratio = min(Num(0.0), Num(0.25) * log(later / before));  // from degree to degree
    const Num goes_on = fma(ratio, Num(double(order - stages + 1)), max(last, ratio + next));
    return select(error > Num(never), max(error, goes_on), error);
  }
};

/// What the stages of a solved step show of its error.
struct StepShape {
  /// Sizes of the Legendre coefficients of the rates on the step, times h, relative to the size of the motion  [rad].
  std::array<double, max_stages> decay{};
  double beyond = 0;     ///< root of StepDecay::beyond; 0 without loads, since only they damp
  double pace = 0;       ///< R in the middle  [1/s]
  double imbalance = 0;  ///< relative error of the energy in the step; 0 if not computed

  /// A coefficient that is smaller, relative to its coordinate, may be rounding of the coordinate.
  static constexpr double visible = 8 * std::numeric_limits<double>::epsilon();

  /// Where hardly anything moves, a defect is compared with this share of the v² that forces give.
  static constexpr double slow_squared = 0.01;

  /// The squares for a step of size h.
  StepDecay<double> of(double h) const {
    StepDecay<double> squared;
    std::ranges::transform(decay, squared.squares.begin(), [](double size) { return size * size; });
    squared.beyond = beyond * beyond;
    squared.moved = (h * pace) * (h * pace);
    squared.imbalance = imbalance;
    return squared;
  }
};

}  // namespace pendula
