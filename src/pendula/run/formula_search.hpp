#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <optional>
#include <pendula/numeric/reach.hpp>
#include <pendula/numeric/sampled_polynomial.hpp>
#include <pendula/run/event_location.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// Finds every sign change of a formula within a step, however narrow, from enclosures of its quantities along the step
/// and interval arithmetic.
///
/// A few samples bound the quantities over the whole step, and the formula is enclosed with these bounds; most steps
/// end here. Otherwise the quantities are interpolated at nine places, on halves of the step where these do not resolve
/// them. On each part, Bernstein coefficients enclose the quantities and their slopes, and interval arithmetic encloses
/// the formula and its slope. Parts are halved until the formula has one sign or is monotone there, or until its
/// enclosure at one place is no narrower than that on the part. What is then undecided is examined more closely:
/// interpolated on shorter intervals by dense output, then at full order, and finally by its extremum. A formula of
/// time alone is known to rounding from the start.
///
/// `Sight` provides size(), time(u), resolution(), at(u, numbers), by dense output, at_full_order(u, numbers),
/// value(time, numbers) and reach(time, numbers); u runs from 0 to 1.
template <class Sight>
class FormulaSearch {
 public:
  using By = SeenBy;

  /// `degree` of the dense output: how fast its error falls with the length of the step.
  FormulaSearch(Sight& sight, int degree)
      : sight_(sight),
        degree_(static_cast<std::size_t>(std::clamp(degree, 1, 8))),
        numbers_(sight.size()),
        reaches_(sight.size()) {}

  /// As SignSearch::find.
  std::vector<SignChange> find(double first, double last, int sign, By by = By::polynomial) {
    is_finite_ = true;
    samples_left_ = most_samples;
    parts_left_ = most_parts;
    missed_.assign(sight_.size(), 0);
    largest_.assign(sight_.size(), 0);
    last_.assign(sight_.size(), 0);
    line_.begin(first, sign);
    if (sight_.size() == 0) {
      Doubtful doubtful;
      follow({}, {0, 1}, By::full_order, 0, doubtful);
      close(doubtful, 1, By::full_order, most_fits);
    } else if (by == By::full_order || !is_far_from_zero()) {
      if (by == By::polynomial) measure();
      search(0, 1, by, 0, 1);
    }
    if (std::isfinite(last)) {
      line_.go_on(1, sign_of(last));
    } else {
      line_.forget(1);
    }
    return is_told() ? line_.take() : changes_by_ends(sign, sign_of(last));
  }

  /// As in SignSearch.
  bool is_finite() const { return is_finite_; }
  bool is_told() const { return samples_left_ > 0 && parts_left_ > 0; }

 private:
  static constexpr std::size_t points = BernsteinPolynomial::size;
  static constexpr double epsilon = std::numeric_limits<double>::epsilon();
  static constexpr int most_samples = 512, most_parts = 20'000, most_fits = 10, most_fits_at_full_order = 5;
  using Samples = BernsteinPolynomial::Numbers;
  using Defined = Reach::Defined;

  /// A quantity of the formula on an interval of the step, with error bounds of its value and slope.
  struct Number {
    BernsteinPolynomial values, slopes;
    double band, slope_band;
  };

  /// All quantities on an interval.
  struct Fit {
    double from = 0, to = 1;
    std::vector<Number> numbers = {};
    /// Error bound of interpolation between the samples, relative to the largest value; 0 if closer samples would not
    /// help.
    double roughness = 0;
    bool is_resolved = true;  // the interpolants are accurate to resolved_tail
    bool is_blurred = false;  // the error of an interpolant is comparable to its variation

    double width() const { return to - from; }
    double at(double x) const { return x == 1 ? to : from + x * width(); }
    double local(double u) const { return (u - from) / width(); }
  };

  /// A subinterval of a fit, as places in [0, 1].
  struct Subinterval {
    double low, high;
  };

  /// A run of consecutive parts in which the formula may be zero.
  struct Doubtful {
    bool open = false;
    double from = 0;
    int slope = 0;                    // common sign of their slopes, or 0
    double roughness = 0, width = 0;  // largest ones of the fits
  };

  // --- Samples ---

  const std::vector<double>& sample(double u, By by) {
    --samples_left_;
    if (by == By::polynomial) {
      sight_.at(u, numbers_);
    } else {
      sight_.at_full_order(u, numbers_);
    }
    for (std::size_t n = 0; n < numbers_.size(); ++n) {
      if (std::abs(numbers_[n]) > largest_[n]) largest_[n] = std::abs(numbers_[n]);
    }
    return numbers_;
  }

  double value(double u) {
    if (sight_.size() > 0) sample(u, By::full_order);
    return sight_.value(sight_.time(u), numbers_);
  }

  /// Uses samples at five Chebyshev points, including both ends of the step, and a sixth against aliasing. Assumes that
  /// no quantity varies by more than twice what the samples show.
  bool is_far_from_zero() {
    std::vector<std::array<double, 5>> seen(sight_.size());
    for (std::size_t k = 0; k < 5; ++k) {
      sample(sample_place(2 * k), k % 4 == 0 ? By::full_order : By::polynomial);
      for (std::size_t n = 0; n < seen.size(); ++n) seen[n][k] = numbers_[n];
    }
    sample(odd_place, By::polynomial);
    for (std::size_t n = 0; n < seen.size(); ++n) {
      const auto& [first, second, third, fourth, fifth] = seen[n];
      const std::array<double, 5> sizes = chebyshev_sizes<5>(seen[n]);
      const double middle = ((first + fifth) / 2 + second + third + fourth) / 4;
      const double varies = sizes[1] + sizes[2] + sizes[3] + sizes[4] + 16 * epsilon * sizes[0];
      if (!(std::abs(numbers_[n] - expected_at_odd_place(seen[n])) <= 0.5 * varies)) return false;
      reaches_[n] = Reach({middle - 2 * varies, middle + 2 * varies}, Interval::all());
    }
    const Reach reach = sight_.reach(Reach({sight_.time(0), sight_.time(1)}, Interval::all()), reaches_);
    Doubtful none;
    return decide(reach, reach.value, {}, {0, 1}, By::polynomial, 0, none);
  }

  /// Measures the error of dense output: at the ends, where its rates are off; where its error is largest; and at a
  /// third place, because a quantity may have an extremum at one of these.
  void measure() {
    const double place = place_of_miss(degree_);
    for (const double end : {0.0, 1.0}) compare(end, 1);
    for (const double within : {place, place == 0.5 ? 0.25 : 1 - place}) compare(within, 2);
  }
  void compare(double u, double safety) {
    const std::vector<double> shown = sample(u, By::polynomial);
    sample(u, By::full_order);
    for (std::size_t n = 0; n < shown.size(); ++n) {
      const double off = std::abs(shown[n] - numbers_[n]);
      if (std::isfinite(off)) missed_[n] = std::max(missed_[n], safety * off);
    }
  }

  // --- Interpolation of the quantities ---

  Fit fitted(double from, double to, By by) {
    Fit fit{from, to};
    std::vector<Samples> values(sight_.size());
    for (std::size_t k = 0; k < points; ++k) {
      sample(fit.at(sample_place(k)), by);
      for (std::size_t n = 0; n < values.size(); ++n) values[n][k] = numbers_[n];
    }
    if (by == By::polynomial) sample(fit.at(odd_place), by);
    for (std::size_t n = 0; n < values.size(); ++n) {
      const Samples sizes = chebyshev_sizes(values[n]);
      const double variation = std::accumulate(sizes.begin() + 1, sizes.end(), 0.0);
      const BernsteinPolynomial polynomial = BernsteinPolynomial::through(values[n]);
      const double noise = 64 * epsilon * largest_[n];
      double tail = 2 * (sizes[points - 2] + sizes[points - 1]), miss = 0;
      if (by == By::polynomial) {
        const double whole = 1 / std::pow(fit.width(), static_cast<double>(degree_));  // scales to the whole step
        tail = std::max(tail, std::abs(numbers_[n] - polynomial(odd_place)));
        if (sizes[degree_] > noise) last_[n] = std::max(last_[n], sizes[degree_] * whole);
        miss = missed_[n] + last_[n];
      }
      fit.is_resolved &= tail <= resolved_tail * variation + noise;
      fit.is_blurred |= tail > 1e-2 * variation + noise;
      if (tail > noise + miss) fit.roughness = std::max(fit.roughness, tail / largest_[n]);
      // Bound of the derivative of a polynomial, by Markov's inequality.
      const auto steepest = [](double value, double degree) { return 2 * degree * degree * value; };
      fit.numbers.push_back(
          {polynomial, polynomial.slopes(), tail + noise + miss,
           steepest(tail + noise, points - 1) + fit.width() * steepest(miss, static_cast<double>(degree_ + 1))});
    }
    return fit;
  }

  /// Enclosure of the formula on a part of a fit, or at one place of it.
  Reach reach(const Fit& fit, const Subinterval& part) {
    const bool is_place = part.low == part.high;
    const auto within = [&](const BernsteinPolynomial& polynomial, double band) -> Interval {
      const Interval range = is_place ? polynomial(part.low) : polynomial.part(part.low, part.high).range();
      return {range.low - band, range.high + band};
    };
    for (std::size_t n = 0; n < reaches_.size(); ++n) {
      const Number& number = fit.numbers[n];
      const Interval slope = within(number.slopes, number.slope_band);
      reaches_[n] = Reach(within(number.values, number.band), {slope.low / fit.width(), slope.high / fit.width()});
    }
    const double begin = sight_.time(0), end = sight_.time(1);
    return sight_.reach(
        Reach({sight_.time(fit.at(part.low)), sight_.time(fit.at(part.high))}, Interval(end) - Interval(begin)),
        reaches_);
  }

  // --- Sign changes ---

  /// `roughness` is that of the wider fit that contains this interval.
  void search(double from, double to, By by, int level, double roughness) {
    Doubtful doubtful;
    search(from, to, by, level, roughness, doubtful);
    close(doubtful, to, by, level);
  }
  void search(double from, double to, By by, int level, double roughness, Doubtful& doubtful) {
    Fit fit = fitted(from, to, by);
    // Roughness that closer samples do not reduce is noise: each state at full order comes from a step of its own.
    // Where noise is as large as the variation, samples say nothing about the sign.
    const bool is_fine = by == By::full_order && fit.roughness < 1e-6;
    const bool is_noise = is_fine && fit.roughness > roughness / 4;
    if (is_noise || (is_fine && fit.is_blurred)) fit.roughness = 0;
    if (is_fine && fit.is_blurred) return open(fit, from, 0, doubtful);
    if (fit.is_resolved || is_noise || level >= most_fits || !is_told()) {
      return follow(fit, {0, 1}, by, level, doubtful);
    }
    search(from, fit.at(0.5), by, level + 1, fit.roughness, doubtful);
    search(fit.at(0.5), to, by, level + 1, fit.roughness, doubtful);
  }

  void follow(const Fit& fit, const Subinterval& part, By by, int level, Doubtful& doubtful) {
    --parts_left_;
    const double from = fit.at(part.low), to = fit.at(part.high), middle = (part.low + part.high) / 2;
    const Reach whole = reach(fit, part);
    if (decide(whole, whole.value, fit, part, by, level, doubtful)) return;
    const Reach there = reach(fit, {middle, middle});
    int slope = 0;
    if (whole.defined == Defined::everywhere) {
      slope = whole.slope.side();
      const double half = (to - from) / 2;
      const Interval nearer = common(whole.value, there.value + whole.slope * Interval(-half, half));
      if (decide(whole, nearer, fit, part, by, level, doubtful)) return;
    }
    if (slope == 0 && to - from > sight_.resolution() && is_wider(whole, there) && is_told()) {
      follow(fit, {part.low, middle}, by, level, doubtful);
      if (there.defined == Defined::everywhere) settle(fit, middle, there.value.side(), by, level, doubtful);
      return follow(fit, {middle, part.high}, by, level, doubtful);
    }
    open(fit, from, slope, doubtful);
  }

  static void open(const Fit& fit, double from, int slope, Doubtful& doubtful) {
    if (!doubtful.open) doubtful = {true, from, slope};
    if (doubtful.slope != slope) doubtful.slope = 0;
    doubtful.roughness = std::max(doubtful.roughness, fit.roughness);
    doubtful.width = std::max(doubtful.width, fit.width());
  }

  /// Whether the enclosure on a part of a fit is wider than that at one place of it.
  static bool is_wider(const Reach& part, const Reach& place) {
    if (place.defined != Defined::everywhere || place.value.width() == Interval::infinity) return false;
    return part.defined != Defined::everywhere || part.value.width() > 2 * place.value.width();
  }

  /// Whether the formula, enclosed by `value`, certainly does not change sign in a part of a fit.
  bool decide(const Reach& reach, const Interval& value, const Fit& fit, const Subinterval& part, By by, int level,
              Doubtful& doubtful) {
    if (reach.defined == Defined::nowhere) {
      close(doubtful, fit.at(part.low), by, level);
      line_.forget(fit.at(part.high));
      is_finite_ = false;
      return true;
    }
    if (reach.defined == Defined::partly) return false;
    const int side = value.side();
    if (side == 0) {
      const int sign = line_.sign();
      const bool stays = (value.low >= 0 && (sign >= 0 || value.high == 0)) || (value.high <= 0 && sign <= 0);
      return stays && !doubtful.open;
    }
    settle(fit, part.low, side, by, level, doubtful);
    settle(fit, part.high, side, by, level, doubtful);
    return true;
  }

  /// Adds the sign at a place of a fit, 0 if it is not certain.
  void settle(const Fit& fit, double place, int side, By by, int level, Doubtful& doubtful) {
    if (side == 0) return;
    const double u = fit.at(place);
    close(doubtful, u, by, level);
    SignChange* const change = line_.go_on(u, side);
    if (change != nullptr && change->from >= fit.from && change->from < change->to) guess(fit, *change);
  }

  /// A monotone run has a root if its ends differ in sign; any other run is examined more closely.
  void close(Doubtful& doubtful, double to, By by, int level) {
    const Doubtful seen = std::exchange(doubtful, {});
    if (!seen.open || seen.slope != 0 || !is_told()) return;
    if (seen.roughness > 0 && level < most_fits && to - seen.from > sight_.resolution()) {
      closer(seen, to, by, level + 1);
    } else if (by == By::polynomial) {
      closer(seen, to, By::full_order, most_fits - most_fits_at_full_order);
    } else {
      const auto other = other_sign(
          seen.from, to, line_.sign(), [&](double u) { return value(u); }, [&] { return is_told(); });
      if (other) line_.go_on(*other, -line_.sign());
    }
  }
  /// Searches again with narrower fits.
  void closer(const Doubtful& seen, double to, By by, int level) {
    const double roughness = seen.roughness > 0 ? seen.roughness : 1;
    if (to - seen.from < 0.75 * seen.width) return search(seen.from, to, by, level, roughness);
    const double middle = (seen.from + to) / 2;
    Doubtful doubtful;
    search(seen.from, middle, by, level, roughness, doubtful);
    search(middle, to, by, level, roughness, doubtful);
    close(doubtful, to, by, level);
  }

  // --- Approximate roots ---

  /// The formula evaluated with the interpolants of a fit.
  struct Shown {
    FormulaSearch& search;
    const Fit& fit;

    double exact_value(double u) {
      for (std::size_t n = 0; n < fit.numbers.size(); ++n) search.numbers_[n] = fit.numbers[n].values(fit.local(u));
      return search.sight_.value(search.sight_.time(u), search.numbers_);
    }
  };

  void guess(const Fit& fit, SignChange& change) {
    if (fit.numbers.empty()) return;
    Shown shown{*this, fit};
    if (sign_of(shown.exact_value(change.from)) != -change.sign) return;
    const std::optional<double> zero = locate(shown, change, 1e-9 * (change.to - change.from));
    if (!zero) return;
    const Interval slope = reach(fit, {fit.local(*zero), fit.local(*zero)}).slope;
    if (!std::isfinite(slope.low + slope.high)) return;
    change.guess = zero;
    change.slope = (slope.low + slope.high) / 2;
  }

  Sight& sight_;
  std::size_t degree_;
  SignLine line_;
  std::vector<double> numbers_;  // the last sample
  std::vector<Reach> reaches_;
  // For each quantity: the largest absolute value seen, the measured error of dense output, and the last coefficient of
  // its polynomial.
  std::vector<double> largest_, missed_, last_;
  bool is_finite_ = true;
  int samples_left_ = 0, parts_left_ = 0;
};

}  // namespace pendula
