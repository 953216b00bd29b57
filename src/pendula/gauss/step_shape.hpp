#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/numeric.hpp>

namespace pendula {

/// How fast the motion goes on.
template <class Num>
struct TempoOf {
  Num pace{0.0};        ///< R: 1/R is the time in which the motion changes  [1/s]
  Num quickening{0.0};  ///< d ln R/dt; of the motion backwards its opposite  [1/s]
};
using Tempo = TempoOf<double>;

/// How what a step shows of the motion decays from degree to degree, all squared: from that follows its error.
template <class Num>
struct StepDecay {
  /// The Legendre coefficients of the rates on the step, times h, relative to the size of the motion, squared  [rad²].
  std::array<Num, max_stages> squares;
  /// That of degree s, the first that s stages cannot show: by how much their polynomial misses the rates where the
  /// step starts. 0 where nobody looks.
  Num beyond{0.0};
  Num moved{0.0};      ///< (h R)², R in the middle
  Num imbalance{0.0};  ///< of energy, relative to what there is, not squared; 0 where nobody looks

  /// Whether the error of a step of so many stages depends on a coefficient.
  static constexpr bool needs(int degree, int stages) { return degree < 2 || degree + 4 >= stages; }

  /// The time in which the motion changes, in which the step goes on; where motion only begins, nothing says how fast
  /// it will be.
  Num time() const { return max(sqrt(moved), Num(shortest)); }

  /// The logarithm of the error of a step by a method of this order and so many stages, relative to the size of the
  /// motion and `time`.
  ///
  /// Coefficients of analytic motion decay geometrically, and the quadrature misses those from the degree `order` on.
  /// The last known ones are taken to go on as they have decayed from h R; or, in swings that are small beside a
  /// radian, as from the first coefficients, also where the swing turns; or as from those before them, where that is
  /// worse.
  Num log_error(int stages, int order) const {
    const Num log_moved = log_root(moved);
    const Num least = select(beyond > Num(0.0), Num(std::log(shortest_damped)), Num(std::log(shortest)));
    return log_of_step(log_moved, stages, order) - max(log_moved, least);
  }

  /// The logarithm of what no stage has seen of the rates at the start of the step, relative to those of the motion.
  /// The coefficients, however small, know nothing of what is damped before the first stage.
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
  static constexpr double jump = 10;  // from the last coefficients that are known to the next, as no motion has it
  // Coefficients that are smaller, relative to h R, may be rounding; what follows from them would not show.
  static constexpr double rounding = 1e-13;

  static Num log_root(const Num& square) { return Num(0.5) * log(max(square, Num(detail::almost_zero))); }
  const Num& at(int k) const { return squares[static_cast<std::size_t>(k)]; }

  Num log_of_step(const Num& log_moved, int stages, int order) const {
    if (stages == 1) return Num(3.0) * log_moved;
    const Num noise = log_moved + Num(std::log(rounding));
    const Num largest = max(at(0), at(1) / min(moved, Num(1.0)));
    const Num size = min(log_moved, log_root(largest) + Num(std::log(small)));
    // The coefficient that quadrature begins to miss, where they decay from `size` to that of degree k as they go on to
    // do.
    const auto extended = [&](const Num& coefficient, int k) {
      const Num error = fma(coefficient - size, Num((order - k) / double(k)), coefficient);
      return select(coefficient > noise, error, Num(never));
    };
    const Num last = log_root(at(stages - 1));
    Num error = extended(last, stages - 1);
    const Num next = log_root(at(stages - 2));
    if (stages > 2) error = max(error, extended(next, stages - 2));
    if (stages <= 3) {
      // Too few to show how what is damped decays beside a motion that is not; and with two all rests on one
      // coefficient, which vanishes where loads balance gravity.
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

/// What a step that was solved shows of its own error.
struct StepShape {
  /// Sizes of the Legendre coefficients of the rates on the step, times h, relative to the size of the motion  [rad].
  std::array<double, max_stages> decay{};
  double beyond = 0;     ///< StepDecay::beyond; 0 where there are no loads, which alone damp
  double pace = 0;       ///< R in the middle  [1/s]
  double imbalance = 0;  ///< of energy, relative to what there is; 0 where nobody looks

  /// A coefficient that is smaller, relative to its coordinate, may be what that is rounded by.
  static constexpr double visible = 8 * std::numeric_limits<double>::epsilon();

  /// What a defect is compared with where hardly anything moves: this share of v² that forces bring.
  static constexpr double slow_squared = 0.01;

  /// Of a step h.
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
