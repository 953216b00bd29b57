#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <pendula/chain/chain_links.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/moving_part.hpp>
#include <pendula/system/series_info.hpp>
#include <pendula/system/system_table.hpp>
#include <vector>

namespace pendula {

/// How the steps of Taylor series are checked for forces that their coefficients do not show: as those of a method with
/// so many nodes.
struct TaylorSeries {
  static constexpr int error_order = 14;
  static constexpr bool is_blind = false;
};

/// The sizes of Taylor steps: as the series allow, unless a step failed.
class SeriesSizes {
 public:
  explicit SeriesSizes(double /*tolerance*/) {}

  template <class Stepper>
  void start(bool /*which*/, Stepper& /*stepper*/) {
    longest_ = unlimited;
  }
  template <class Stepper>
  double step(Stepper& stepper) const {
    return std::min(longest_, stepper.longest_step());
  }
  template <class Stepper>
  bool accepts(bool /*which*/, double /*h*/, Stepper& /*stepper*/) const {
    return true;
  }
  void shrink(bool /*which*/, double h, double factor) { longest_ = factor * h; }
  template <class Stepper>
  void move_on(bool /*which*/, double /*h*/, Stepper& /*stepper*/) {
    longest_ = unlimited;
  }
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(longest_);
  }

 private:
  static constexpr double unlimited = 1e300;

  double longest_ = unlimited;
};

/// Steps of one motion of a system by the Taylor series of its kernel; the stepper of SingleIntegrator. The order
/// follows from the tolerance, the step size from the last terms of the series. The state is kept in twice the digits,
/// so that what many steps add is not lost to rounding.
class SeriesSteps {
 public:
  static constexpr bool can_choose = true;
  using Part = MovingPart<double, 1>;
  using Parts = detail::PerLink<Part, Eigen::Dynamic>;
  using Controller = SeriesSizes;

  struct Options {
    double tolerance = 1e-9;  ///< error of a step relative to the size of the motion
  };

  /// `systems` must outlive this object, and have series.
  SeriesSteps(MemberSystems<double>& systems, Options options)
      : systems_(systems),
        info_(systems.info().series),
        n_(static_cast<std::size_t>(systems.coordinates())),
        row_(series_state_row(n_, 1)),
        order_(order_for(options.tolerance)),
        looks_(is_smooth(systems.info()) ? 1 : most_looks),
        largest_defect_(0.25 * order_ * order_ * std::max(options.tolerance, 1e-15)),
        log_reach_(std::log2(std::max(options.tolerance, finest)) / order_),
        // Orders up to one that is a multiple of four, beyond the last one zero: sums are taken four by four.
        state_((static_cast<std::size_t>(order_) + 5) * row_),
        kept_(static_cast<std::size_t>(info_.kept) + 1),
        operands_(static_cast<std::size_t>(order_) * series_operand_row(info_, 1) + 1),
        inputs_((static_cast<std::size_t>(order_) + 1) * systems.info().inputs.size() + 1),
        now_{PackRows<1>(row_), PackRows<1>(row_), Parts(systems.coordinates()), 0},
        trial_(now_),
        begin_(now_),
        seen_(2 * n_),
        rates_(n_),
        scales_(2 * n_) {}

  int links() const { return static_cast<int>(n_); }
  const Parts& parts() const { return now_.parts; }

  /// A state, with everything that the next steps depend on.
  struct Place {
    PackRows<1> state, low;  // q, then p or v; and their rounding errors
    Parts parts;             // q and v
    double last = 0;         // size of the step that led here; 0: none  [s]
  };
  Place place() const { return now_; }
  void go_to(const Place& place) {
    now_ = place;
    is_expanded_ = false;
  }

  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v) {
    systems_.take(lane, system);
    time_ = time;
    for (std::size_t k = 0; k < row_; ++k) *now_.state[k] = *now_.low[k] = 0;
    for (int i = 0; i < links(); ++i) now_.parts[i] = {{q[i]}, {v[i]}};
    std::copy_n(q, n_, now_.state[0]);
    std::copy_n(v, n_, now_.state[n_]);
    if (info_.has_momenta) {
      systems_.here(time, &SystemFunctions::momentum_from_velocity, now_.state[0], v, now_.state[n_]);
    }
    now_.last = 0;
    is_expanded_ = false;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(now_.state, now_.low, now_.last, time_);
    for (int i = 0; i < links(); ++i) numbers(now_.parts[i].place, now_.parts[i].rate);
    is_expanded_ = false;
  }

  std::array<long double, 1> exact_place(int i) const { return {sum_of(i)}; }
  std::array<long double, 1> exact_rate(int i) const {
    if (!info_.has_momenta) return {sum_of(links() + i)};
    return {now_.parts[i].rate[0]};
  }

  /// The largest step that the series about the current state allows.
  double longest_step() {
    if (!is_expanded_) expand();
    return longest_;
  }

  /// Tries a step of `h` from `time`. Returns whether its end is finite, and the series solves the equations on the
  /// way: its last terms know nothing of what is narrow and ahead. The state is unchanged.
  bool solve(double time, double h, bool /*wanted*/) {
    time_ = time;
    if (!is_expanded_) expand();
    tried_ = h;
    const double tau = h / unit_;
    bool is_finite = true;
    for (std::size_t k = 0; k < 2 * n_; ++k) {
      const double x = *now_.state[k], change = tau * rise(k, tau) + *now_.low[k], there = x + change;
      *trial_.state[k] = there;
      *trial_.low[k] = change - (there - x);
      is_finite &= std::isfinite(there);
    }
    read_rates(time + h, trial_.state, trial_.parts);
    for (int i = 0; i < links(); ++i) is_finite &= std::isfinite(trial_.parts[i].rate[0]);
    trial_.last = h;
    if (!is_finite) return false;
    for (int k = 1; k <= looks_; ++k) {
      if (!solves(time, h, static_cast<double>(k) / looks_)) return false;
    }
    return true;
  }

  const Parts& tried() const { return trial_.parts; }

  /// The first coordinate of the tried step that is not finite; −1: none.
  int part_not_finite() const {
    for (int i = 0; i < links(); ++i) {
      const Part& part = trial_.parts[i];
      if (!std::isfinite(part.place[0]) || !std::isfinite(part.rate[0])) return i;
    }
    return -1;
  }

  /// Moves to the end of the tried step. Its series stays for dense output, until the next one is expanded.
  void accept(bool /*which*/) {
    std::swap(begin_, now_);
    std::swap(now_, trial_);
    begin_time_ = time_;
    time_ += tried_;
    step_ = tried_;
    is_expanded_ = false;
  }

  /// A coordinate and its rate at the fraction `share` of the last step, by the series of the coordinate.
  Part glance(int i, double share) const {
    const double tau = share * step_ / unit_;
    const auto k = static_cast<std::size_t>(i);
    const double place = coefficient(0, k) + tau * rise(k, tau);
    return {{place}, {info_.has_momenta ? slope(k, tau) / unit_ : coefficient(0, n_ + k) + tau * rise(n_ + k, tau)}};
  }

  /// Calls visit(i, q, v) for all coordinates: rates are those of the momenta there.
  template <class Visit>
  void for_each_look(double share, Visit visit) {
    const double tau = share * step_ / unit_;
    for (std::size_t k = 0; k < 2 * n_; ++k) *trial_.state[k] = coefficient(0, k) + tau * rise(k, tau);
    read_rates(begin_time_ + share * step_, trial_.state, trial_.parts);
    for (int i = 0; i < links(); ++i) visit(i, trial_.parts[i].place, trial_.parts[i].rate);
  }

  const Place& begin() const { return begin_; }
  void set_step(const Place& begin, double time, double h) {
    begin_ = begin;
    begin_time_ = time;
    step_ = h;
  }

 private:
  static constexpr double finest = 1e-17, tiny = 1e-300, nothing = 1e-16, rounded = 1e-14;
  static constexpr int least_order = 6, most_order = 32, looked_at = 4, most_units = 8, most_looks = 4;

  /// Whether nothing but sines, powers and logarithms stands in the equations, and no time.
  static bool is_smooth(const SystemInfo& info) {
    return !info.depends_on_time && std::ranges::all_of(info.argument_is_base, std::identity());
  }

  /// The order that needs the fewest operations for a tolerance.
  static int order_for(double tolerance) {
    const double order = 4 - 1.25 * std::log10(std::max(tolerance, finest));
    return std::clamp(static_cast<int>(std::lround(order)), least_order, most_order);
  }

  long double sum_of(int k) const { return static_cast<long double>(*now_.state[k]) + *now_.low[k]; }

  double coefficient(std::size_t order, std::size_t k) const { return *state_[order * row_ + k]; }

  /// Σ c_(k+1) τ^k, in four strands that do not wait for one another.
  double rise(std::size_t k, double tau) const {
    const double tau2 = tau * tau, tau4 = tau2 * tau2;
    std::size_t order = (static_cast<std::size_t>(order_) + 3) / 4 * 4;
    double a = coefficient(order - 3, k), b = coefficient(order - 2, k), c = coefficient(order - 1, k),
           d = coefficient(order, k);
    for (order -= 4; order > 0; order -= 4) {
      a = std::fma(a, tau4, coefficient(order - 3, k));
      b = std::fma(b, tau4, coefficient(order - 2, k));
      c = std::fma(c, tau4, coefficient(order - 1, k));
      d = std::fma(d, tau4, coefficient(order, k));
    }
    return std::fma(std::fma(d, tau, c), tau2, std::fma(b, tau, a));
  }

  /// Σ (k+1) c_(k+1) τ^k
  double slope(std::size_t k, double tau) const {
    double sum = 0;
    for (auto order = static_cast<std::size_t>(order_); order > 0; --order) {
      sum = std::fma(sum, tau, static_cast<double>(order) * coefficient(order, k));
    }
    return sum;
  }

  /// Σ (k+2) (k+1) c_(k+2) τ^k
  double bend(std::size_t k, double tau) const {
    double sum = 0;
    for (auto order = static_cast<std::size_t>(order_); order > 1; --order) {
      sum = std::fma(sum, tau, static_cast<double>(order * (order - 1)) * coefficient(order, k));
    }
    return sum;
  }

  void read_rates(double time, PackRows<1>& state, Parts& parts) {
    const double* v = state[n_];
    if (info_.has_momenta) {
      systems_.here(time, &SystemFunctions::velocity_from_momentum, state[0], state[n_], rates_.data());
      v = rates_.data();
    }
    for (int i = 0; i < links(); ++i) parts[i] = {{*state[i]}, {v[i]}};
  }

  /// Whether accelerations at a fraction of the step are those of the series, to what terms beyond its order may be.
  bool solves(double time, double h, double share) {
    const double tau = share * h / unit_;
    for (std::size_t i = 0; i < n_; ++i) {
      seen_[i] = coefficient(0, i) + tau * rise(i, tau);
      seen_[n_ + i] = info_.has_momenta ? slope(i, tau) / unit_ : coefficient(0, n_ + i) + tau * rise(n_ + i, tau);
    }
    systems_.here(time + share * h, &SystemFunctions::acceleration, seen_.data(), seen_.data() + n_, rates_.data());
    for (std::size_t i = 0; i < n_; ++i) {
      const double by_series = info_.has_momenta ? bend(i, tau) / (unit_ * unit_) : slope(n_ + i, tau) / unit_;
      if (!(h * std::abs(rates_[i] - by_series) * scales_[n_ + i] <= largest_defect_)) return false;
    }
    return true;
  }

  /// Computes the series in a unit of time near the step size, so that coefficients are neither huge nor tiny.
  void expand() {
    unit_ = now_.last > 0 ? now_.last : 1;
    for (int attempt = 0; attempt < most_units; ++attempt, unit_ *= 1e-6) {
      for (std::size_t k = 0; k < 2 * n_; ++k) *state_[k] = *now_.state[k];
      systems_.expand(time_, unit_, order_, inputs_,
                      {.unit = &unit_, .state = state_[0], .kept = kept_[0], .operands = operands_[0]});
      longest_ = size_by_terms();
      if (longest_ > 0) break;
    }
    is_expanded_ = true;
  }

  /// From the decay of the last terms, relative to the size of the motion; 0 if one is not finite. Several terms are
  /// used, because motions that start at rest, and symmetric ones, have only every second or fourth term.
  double size_by_terms() {
    const int last = order_ - (info_.has_momenta ? 1 : 0);
    double log_radius = 1e3;
    find_scales();
    for (int k = last - looked_at + 1; k <= last; ++k) {
      const double term = size_of_term(static_cast<std::size_t>(k));
      if (!(term <= std::numeric_limits<double>::max())) return 0;
      log_radius = std::min(log_radius, -std::log2(std::max(term, tiny)) / k);
    }
    return std::exp2(std::min(log_radius + log_reach_, 600.0)) * unit_;
  }

  /// Terms are relative to each coordinate or rate itself, plus 1 rad or 1/s, or the size of the whole motion if that
  /// is smaller, so that oscillations of 1e-9 rad are resolved like any other.
  void find_scales() {
    double q = 0, v = 0, a = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      q = std::max(q, std::abs(coefficient(0, i)));
      v = std::max(v, std::abs(rate(0, i)));
      a = std::max(a, std::abs(rate(1, i)));
    }
    const double places = std::clamp(std::max(q, unit_ * v), nothing, 1.0);
    const double speeds = std::clamp(std::max({v, a, rounded * q / unit_}), nothing, 1.0);
    for (std::size_t i = 0; i < n_; ++i) {
      scales_[i] = 1 / (places + std::abs(coefficient(0, i)));
      scales_[n_ + i] = 1 / (speeds + std::abs(rate(0, i)));
    }
  }

  double size_of_term(std::size_t order) const {
    double largest = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      const double moved = coefficient(order, i) * scales_[i], turned = rate(order, i) * scales_[n_ + i];
      if (!std::isfinite(moved) || !std::isfinite(turned)) return std::numeric_limits<double>::infinity();
      largest = std::max({largest, std::abs(moved), std::abs(turned)});
    }
    return largest;
  }

  /// A coefficient of a rate.
  double rate(std::size_t order, std::size_t i) const {
    if (!info_.has_momenta) return coefficient(order, n_ + i);
    return static_cast<double>(order + 1) * coefficient(order + 1, i) / unit_;
  }

  MemberSystems<double>& systems_;
  SeriesInfo info_;
  std::size_t n_, row_;
  int order_;
  int looks_;              // at the way of a step
  double largest_defect_;  // of accelerations, times h, relative to scales
  double log_reach_;       // step size relative to the estimated radius of convergence, as a logarithm
  PackRows<1> state_, kept_, operands_, inputs_;
  Place now_, trial_, begin_;
  std::vector<double> seen_;            // a motion on the way of a step
  std::vector<double> rates_, scales_;  // of the terms of coordinates, then of rates
  double time_ = 0, begin_time_ = 0;
  double tried_ = 0, step_ = 1;  // of the tried step, of the last one
  double unit_ = 1, longest_ = 0;
  bool is_expanded_ = false;
};

}  // namespace pendula
