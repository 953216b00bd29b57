#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <pendula/numeric/sampled_polynomial.hpp>
#include <utility>
#include <vector>

namespace pendula {

inline int sign_of(double value) {
  return value > 0 ? 1 : value < 0 ? -1 : 0;
}

/// A single sign change of an event's function within a step; times are fractions of the step.
struct SignChange {
  double from = 0, to = 0;
  int sign = 0;                 ///< sign after the change
  std::optional<double> guess;  ///< approximate root, with the slope there; none at a jump
  double slope = 0;             ///< per step
};

/// How states within a step are computed: by its dense output, or by a step at full order.
enum class SeenBy { polynomial, full_order };

/// Where the dense output of a step, a polynomial of a degree from 1 to 8, has its largest error: at the node next to
/// the middle, because the derivative of the error vanishes at all nodes.
inline double place_of_miss(std::size_t degree) {
  constexpr std::array<double, 9> next_to_middle{0.5, 0.5, 0.2113, 0.5, 0.33, 0.5, 0.3807, 0.5, 0.4083};
  return next_to_middle[degree];
}

/// The largest error of an interpolant, relative to its variation, with which it still shows sign changes.
inline constexpr double resolved_tail = 1e-3;

/// The sign change implied by the signs at both ends of a step.
inline std::vector<SignChange> changes_by_ends(int first, int last) {
  if (first * last >= 0) return {};
  return {{0, 1, last, std::nullopt, 0}};
}

/// Collects the signs of a function at increasing places of a step, and the changes between them.
class SignLine {
 public:
  /// `first` is the value at the beginning, `sign` the last nonzero sign before it, or 0.
  void begin(double first, int sign) {
    changes_.clear();
    last_ = {0, sign, first == 0};
    go_on(0, sign_of(first));
  }

  /// Adds the sign at a place, 0 where it is unknown. Returns the change that it shows, or null.
  SignChange* go_on(double u, int sign) {
    if (sign == 0) return nullptr;
    const Node before = std::exchange(last_, {u, sign, false});
    if (before.sign == 0 || before.sign == sign) return nullptr;
    return &changes_.emplace_back(SignChange{before.at, before.is_zero ? before.at : u, sign, std::nullopt, 0});
  }

  /// Adds a place where the function has no value, or where nothing relates it to earlier signs.
  void forget(double u) { last_ = {u, 0, false}; }

  /// The last sign, 0 if unknown.
  int sign() const { return last_.sign; }

  std::vector<SignChange> take() { return std::exchange(changes_, {}); }

 private:
  struct Node {
    double at = 0;
    int sign = 0;
    bool is_zero = false;  // then `sign` is the sign before it
  };

  std::vector<SignChange> changes_;
  Node last_;
};

/// Searches for a place of the other sign between two places of the same sign, where the function approaches zero and
/// turns back, by golden-section minimisation. A minimum that is zero to rounding is a touched root, and gives nothing.
/// `value` evaluates the function, `goes_on` tells whether further evaluations are allowed.
template <class Value, class GoesOn>
std::optional<double> other_sign(double from, double to, int sign, Value value, GoesOn goes_on) {
  constexpr double golden = 0.38196601125010515, nearest = 4 * std::numeric_limits<double>::epsilon();
  constexpr int most_turns = 48;
  if (sign == 0 || sign_of(value(to)) != sign) return {};
  double low = from, high = to, u = low + golden * (high - low), height = sign * value(u);
  for (int tries = 0; tries < most_turns && height >= 0 && goes_on() && high - low > nearest; ++tries) {
    const bool is_left = u - low > high - u;  // the longer part
    const double other = is_left ? u - golden * (u - low) : u + golden * (high - u);
    const double there = sign * value(other);
    if (there < height) {
      (is_left ? high : low) = u;
      u = other;
      height = there;
    } else {
      (is_left ? low : high) = other;
    }
  }
  return height < 0 ? std::optional(u) : std::nullopt;
}

/// Finds every sign change of a function within a step from the step's dense output.
///
/// Steps in which the function stays far from zero are dismissed by six samples: five at Chebyshev points, whose
/// variation, doubled, is less than the distance from zero, and a sixth elsewhere against aliasing. Otherwise the
/// function is interpolated at nine points, on halves of the interval where these do not resolve it. Bernstein
/// coefficients, subdivided as needed, show pieces on which the function is certainly nonzero or certainly monotone, by
/// a margin that covers the errors of interpolation and of dense output. The latter is bounded by the last two
/// coefficients of the polynomial, and if that does not decide, measured at one place. Pieces left undecided,
/// near-tangent roots, are sampled and interpolated at full order, and finally decided by the extremum there.
///
/// `Sight` provides value(u), by dense output, and exact_value(u), at full order; u runs from 0 to 1.
template <class Sight>
class SignSearch {
 public:
  using By = SeenBy;

  /// `degree` of the dense output: how fast its error falls with the length of the step.
  SignSearch(Sight& sight, int degree) : sight_(sight), degree_(static_cast<std::size_t>(std::clamp(degree, 1, 8))) {}

  /// The changes in order. `first` and `last` are the values at both ends, `sign` is the last nonzero sign before the
  /// step, 0 if there was none. A root at the beginning belongs to this step, one at the end to the next.
  std::vector<SignChange> find(double first, double last, int sign, By by = By::polynomial) {
    is_finite_ = true;
    samples_left_ = most_samples;
    first_value_ = first;
    last_value_ = last;
    missed_ = 0;
    is_measured_ = false;
    line_.begin(first, sign);
    search({0, 1, first, last, sign_of(last)}, 0, by);
    return is_told() ? line_.take() : changes_by_ends(sign, sign_of(last));
  }

  /// Whether the function was finite at all samples.
  bool is_finite() const { return is_finite_; }

  /// Whether the samples sufficed to resolve the function. If not, as for mere rounding noise, only the change between
  /// its signs at the ends is returned.
  bool is_told() const { return samples_left_ > 0; }

 private:
  static constexpr std::size_t points = BernsteinPolynomial::size;
  static constexpr int most_samples = 512, most_halvings = 10, most_piece_halvings = 30;
  static constexpr double epsilon = std::numeric_limits<double>::epsilon();
  static constexpr double safety = 4;  // errors of up to 1.3 times what the last coefficients tell were seen
  using Samples = BernsteinPolynomial::Numbers;

  /// A part of the step, and the values at its ends; `sign` is the certain sign of the last one.
  struct Interval {
    double from, to, first, last;
    int sign;

    double at(double x) const { return x == 1 ? to : from + x * (to - from); }
    double middle() const { return at(0.5); }
  };

  /// Bounds of the error of a polynomial and of its derivative.
  struct Band {
    double value, slope;
  };

  /// A run of consecutive pieces that may contain zeros.
  struct Doubtful {
    bool open = false;
    double from = 0;
    int slope = 0;  // common sign of their slopes, or 0
  };

  /// The polynomial that interpolates the function between two nodes.
  struct Curve {
    const BernsteinPolynomial& polynomial;
    const Interval& interval;

    double local(double u) const { return (u - interval.from) / (interval.to - interval.from); }
  };

  double sample(double u, By by) {
    const double value = by == By::polynomial ? sight_.value(u) : sight_.exact_value(u);
    --samples_left_;
    is_finite_ &= std::isfinite(value);
    return value;
  }

  void search(const Interval& interval, int halvings, By by) {
    Samples values;
    values.front() = interval.first;
    values.back() = interval.last;
    for (const std::size_t k : {2U, 4U, 6U}) values[k] = sample(interval.at(sample_place(k)), by);
    if (halvings == 0 && is_far_from_zero(values, interval, by)) return node(interval.to, interval.sign);
    if (halvings == 0 && by == By::polynomial) take_ends(values);
    for (const std::size_t k : {1U, 3U, 5U, 7U}) values[k] = sample(interval.at(sample_place(k)), by);
    const auto finite = std::ranges::count_if(values, [](double value) { return std::isfinite(value); });
    if (finite == 0) return node(interval.to, interval.last);
    if (finite < std::ssize(values)) return unresolved(interval, values, halvings, by);
    const Samples sizes = chebyshev_sizes(values);
    double variation = 0;
    for (std::size_t k = 1; k < points; ++k) variation += sizes[k];
    const BernsteinPolynomial polynomial = BernsteinPolynomial::through(values);
    const double tail = std::max(2 * (sizes[points - 2] + sizes[points - 1]), off_at_sixth(polynomial, interval, by));
    const double width = interval.to - interval.from;
    const double whole = 1 / std::pow(width, static_cast<double>(degree_));  // scales a coefficient to the whole step
    const double last_two = degree_ == 1 ? variation : std::max(sizes[degree_], sizes[degree_ - 1]);
    const double missed = by == By::polynomial ? missed_ + last_two * whole : 0;
    if (sizes[0] > variation + safety * (tail + missed)) return node(interval.to, interval.sign);
    const double largest = std::abs(*std::ranges::max_element(values, {}, [](double v) { return std::abs(v); }));
    const double noise = 4 * epsilon * largest;
    if (tail > resolved_tail * variation + noise) return unresolved(interval, values, halvings, by);
    // Derivatives of polynomials by Markov's inequality, on an interval of length 1.
    const auto steepest = [](double value, double degree) { return 2 * degree * degree * value; };
    const auto band = [&](double miss) {
      return Band{safety * (tail + miss) + noise,
                  steepest(tail + noise, points - 1) + width * steepest(miss, static_cast<double>(degree_ + 1))};
    };
    if (by == By::full_order) return resolved(interval, polynomial, by, band(0));
    if (!is_measured_) {
      const SignLine before = line_;
      is_unsure_ = false;
      resolved(interval, polynomial, by, band(missed_ + last_two * whole));
      if (!is_unsure_) return;
      line_ = before;
      measure();
    }
    resolved(interval, polynomial, by, band(missed_ + sizes[degree_] * whole));
  }

  /// Measures the error of dense output where it is largest.
  void measure() {
    const double place = place_of_miss(degree_);
    const double off = std::abs(sample(place, By::polynomial) - sample(place, By::full_order));
    if (std::isfinite(off)) missed_ = std::max(missed_, 2 * off);
    is_measured_ = true;
  }

  /// Replaces the true values at the ends of the step by those of dense output. Its coordinates are exact there and its
  /// rates are not; the difference measures its error.
  void take_ends(Samples& values) {
    values.front() = sample(0, By::polynomial);
    values.back() = sample(1, By::polynomial);
    missed_ = std::max(std::abs(values.front() - first_value_), std::abs(values.back() - last_value_));
    if (!std::isfinite(missed_)) missed_ = 0;
  }

  /// False if a sample is not finite.
  bool is_far_from_zero(const Samples& values, const Interval& interval, By by) {
    const std::array<double, 5> seen{values[0], values[2], values[4], values[6], values[8]};
    const std::array<double, 5> sizes = chebyshev_sizes<5>(seen);
    if (!(sizes[0] > 2 * (sizes[1] + sizes[2] + sizes[3] + sizes[4]))) return false;
    return std::abs(sample(interval.at(odd_place), by) - expected_at_odd_place(seen)) < 0.1 * sizes[0];
  }

  /// Error of the interpolant at the sixth place. Not measured at full order: that is used on short intervals only,
  /// where the sample would cost more than it tells.
  double off_at_sixth(const BernsteinPolynomial& interpolant, const Interval& interval, By by) {
    if (by == By::full_order) return 0;
    return std::abs(sample(interval.at(odd_place), by) - interpolant(odd_place));
  }

  /// Halves the interval. If it is too short for anything but a jump or a corner, or too many samples were taken, uses
  /// the signs of the samples.
  void unresolved(const Interval& interval, const Samples& values, int halvings, By by) {
    if (halvings < most_halvings && is_told()) {
      const double middle = interval.middle(), value = values[4];
      const bool is_near = !(std::abs(value) > 0.05 * (std::abs(interval.first) + std::abs(interval.last)));
      const double certain = by == By::polynomial && is_near ? sample(middle, By::full_order) : value;
      search({interval.from, middle, values.front(), value, sign_of(certain)}, halvings + 1, by);
      search({middle, interval.to, value, values.back(), interval.sign}, halvings + 1, by);
      return;
    }
    for (std::size_t k = 1; k + 1 < points; ++k) node(interval.at(sample_place(k)), values[k]);
    node(interval.to, std::isfinite(interval.last) ? interval.sign : interval.last);
  }

  void resolved(const Interval& interval, const BernsteinPolynomial& polynomial, By by, const Band& band) {
    const Curve curve{polynomial, interval};
    Doubtful doubtful;
    walk(curve, polynomial, 0, 1, 0, by, band, doubtful);
    close(doubtful, interval.to, by);
    node(interval.to, interval.sign, &curve);
  }

  /// `piece` is the curve from `low` to `high`, mapped to [0, 1].
  void walk(const Curve& curve, const BernsteinPolynomial& piece, double low, double high, int halvings, By by,
            const Band& band, Doubtful& doubtful) {
    if (const int side = piece.side(band.value); side != 0) {
      const double from = curve.interval.at(low);
      close(doubtful, from, by);
      node(from, side, &curve);
      return node(curve.interval.at(high), side, &curve);
    }
    const int slope = piece.slope_side(band.slope * (high - low));
    if (slope == 0 && !piece.is_within(band.value) && halvings < most_piece_halvings) {
      const auto [left, right] = piece.halves();
      const double middle = (low + high) / 2;
      walk(curve, left, low, middle, halvings + 1, by, band, doubtful);
      return walk(curve, right, middle, high, halvings + 1, by, band, doubtful);
    }
    if (!doubtful.open) {
      doubtful = {true, curve.interval.at(low), slope};
    } else if (doubtful.slope != slope) {
      doubtful.slope = 0;
    }
  }

  /// A monotone run has a root if its ends differ in sign; any other run is examined more closely.
  void close(Doubtful& doubtful, double to, By by) {
    const bool is_known = !doubtful.open || doubtful.slope != 0;
    const double from = doubtful.from;
    doubtful = {};
    if (is_known) return;
    if (by == By::full_order) return turn(from, to);
    if (!is_measured_) {
      is_unsure_ = true;
      return;
    }
    const double first = from == 0 ? first_value_ : sample(from, By::full_order);
    const double last = to == 1 ? last_value_ : sample(to, By::full_order);
    search({from, to, first, last, sign_of(last)}, most_halvings / 2, By::full_order);
  }

  void turn(double from, double to) {
    const auto value = [&](double u) { return sample(u, By::full_order); };
    const auto other = other_sign(from, to, line_.sign(), value, [&] { return is_told(); });
    if (other) node(*other, -line_.sign());
  }

  /// Adds the sign at a place. A value that is not finite makes all earlier signs irrelevant.
  void node(double u, double value) {
    if (!std::isfinite(value)) {
      line_.forget(u);
    } else {
      node(u, sign_of(value));
    }
  }
  void node(double u, int sign, const Curve* curve = nullptr) {
    SignChange* const change = line_.go_on(u, sign);
    if (change == nullptr || curve == nullptr || change->from < curve->interval.from) return;
    const double from = curve->local(change->from), to = curve->local(change->to);
    if (sign_of(curve->polynomial(from)) * sign_of(curve->polynomial(to)) >= 0) return;
    const double zero = curve->polynomial.zero(from, to);
    change->guess = curve->interval.at(zero);
    change->slope = curve->polynomial.derivative(zero) / (curve->interval.to - curve->interval.from);
  }

  Sight& sight_;
  std::size_t degree_;
  SignLine line_;
  int samples_left_ = 0;
  bool is_finite_ = true;
  double first_value_ = 0, last_value_ = 0;  // at the ends of the step
  double missed_ = 0;                        // error of dense output, at the ends and where it was measured
  bool is_measured_ = false, is_unsure_ = false;
};

/// The instant of a sign change: its root to within `tolerance`, or for a jump the first place seen behind it. Newton's
/// method with the slope of the guess, then secants, with bisection as the safeguard. The place returned is the last
/// one at which `sight` was evaluated. Nothing if the change does not exist at full order.
template <class Sight>
std::optional<double> locate(Sight& sight, const SignChange& change, double tolerance) {
  double from = change.from, to = change.to;
  double u = change.guess.value_or((from + to) / 2), slope = change.guess ? change.slope : 0;
  double moved = to - from, before = 0, value_before = 0;
  for (int tries = 0; tries < 100; ++tries) {
    const double value = sight.exact_value(u);
    if (value == 0 || to == 0) return u;
    if (!std::isfinite(value) || from == to) return std::nullopt;
    (sign_of(value) == change.sign ? to : from) = u;
    if (tries > 0 && std::abs(u - before) > 1e4 * tolerance) slope = (value - value_before) / (u - before);
    before = u;
    value_before = value;
    const double next = u - value / slope;
    if (change.guess && std::abs(next - u) <= tolerance) return u;  // a jump may be near without a small value
    const bool leads = next > from && next < to && std::abs(next - u) < moved / 2;
    if (!leads && to - from <= tolerance) break;
    u = leads ? next : (from + to) / 2;
    moved = std::abs(u - before);
  }
  if (from == change.from && sign_of(sight.exact_value(from)) == change.sign) return std::nullopt;
  if (sign_of(sight.exact_value(to)) != change.sign) return std::nullopt;
  return to;
}

/// Like locate, for a change that may lie beside the interval in which it was seen, as jumps do where states at full
/// order are rounded: close to it, and within [low, high].
template <class Sight>
std::optional<double> locate_beside(Sight& sight, SignChange change, double low, double high, double tolerance) {
  constexpr double furthest = 1e-6;
  for (double more = 8 * tolerance + change.to - change.from; more < furthest; more *= 32) {
    change = {std::max(low, change.from - more), std::min(high, change.to + more), change.sign, std::nullopt, 0};
    if (sign_of(sight.exact_value(change.from)) != -change.sign) continue;
    if (sign_of(sight.exact_value(change.to)) == change.sign) return locate(sight, change, tolerance);
  }
  return std::nullopt;
}

}  // namespace pendula
