#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <pendula/chain/chain_links.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/moving_part.hpp>
#include <pendula/system/system_table.hpp>
#include <pendula/taylor/series_controller.hpp>
#include <pendula/taylor/series_expansion.hpp>
#include <pendula/taylor/series_looks.hpp>
#include <pendula/taylor/series_reach.hpp>
#include <pendula/taylor/series_tangent.hpp>
#include <type_traits>
#include <utility>

namespace pendula {

/// The constants that ExplicitSystem needs of a method. Forces are looked at during a step as densely as by a
/// quadrature of order error_order.
struct TaylorSeries {
  static constexpr int error_order = 14;
  static constexpr bool is_blind = false;
  static constexpr bool looks_itself = true;  // SeriesLooks checks the step
};

/// Steps by the Taylor series of a kernel, of one motion (the stepper of SingleIntegrator) or of several members at
/// once, one in each lane (a stepper of MemberQueue). The order follows from the tolerance, the step size from the last
/// terms of the series. The state is kept in twice the digits, so that what many steps add is not lost to rounding.
template <class Num>
class SeriesSteps {
 public:
  using L = Num;
  using Mask = MaskOf<L>;
  using SpaceType = CoordinateSpace;
  using Subject = MemberSystems<L>&;
  using Chain = SeriesSteps;
  static constexpr std::size_t D = 1;
  static constexpr int stages = 1, links_known = Eigen::Dynamic;
  static constexpr bool is_implicit = false, can_choose = true, has_tangent = false;
  using Part = MovingPart<L, D>;
  using Parts = detail::PerLink<Part, links_known>;
  using Controller = SeriesController<L>;

  struct Options {
    double tolerance = 1e-9;  ///< error of a step relative to the size of the motion
  };

  /// `systems` must outlive this object, and have series.
  SeriesSteps(MemberSystems<L>& systems, Options options)
      : systems_(systems),
        n_(static_cast<std::size_t>(systems.coordinates())),
        series_(systems, SeriesReach<L>::order_for(options.tolerance)),
        ahead_(series_),
        reach_(series_, systems.info().is_angle, options.tolerance),
        looks_(systems, series_, options.tolerance),
        now_{PackRows<W>(series_.row()), PackRows<W>(series_.row()), Parts(systems.coordinates())},
        trial_(now_),
        rises_(series_.row()),
        seen_(2 * n_),
        rates_(n_ + 2) {
    for (int i = 0; i < count(); ++i) now_.parts[i] = trial_.parts[i] = Part::zero();
  }

  SeriesSteps& chain() { return *this; }
  const SeriesSteps& chain() const { return *this; }
  /// Number of coordinates.
  int count() const { return static_cast<int>(n_); }
  const Parts& parts() const { return now_.parts; }

  /// A state, with everything that the next steps depend on.
  struct FullState {
    PackRows<width_of<L>> state, low;  // q, then p or v; and their rounding errors
    Parts parts;                       // q and v
    L unit{1.0};                       // of time, for the series about this state  [s]
  };
  /// A member starts in a lane, at q and v at `time`. The first one is put into all lanes, so that all of them have
  /// valid numbers.
  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v) {
    if (!is_seated_) {
      is_seated_ = true;
      for (int other = 0; other < static_cast<int>(W); ++other) start(other, time, system, q, v);
    }
    systems_.take(lane, system);
    set(time_, lane, time);
    for (int i = 0; i < count(); ++i) {
      set(now_.parts[i].place[0], lane, q[i]);
      set(now_.parts[i].rate[0], lane, v[i]);
      to_row(now_.parts[i].place[0], seen_[i]);
      to_row(now_.parts[i].rate[0], seen_[count() + i]);
    }
    systems_.here(time_, &SystemFunctions::acceleration, seen_[0], seen_[n_], rates_[0]);
    set(now_.unit, lane, first_unit(lane, q, v));
    if (has_momenta()) {
      systems_.here(time_, &SystemFunctions::momentum_from_velocity, seen_[0], seen_[n_], rates_[0]);
    }
    for (std::size_t k = 0; k < n_; ++k) {
      const double* const rate = has_momenta() ? rates_[k] : seen_[n_ + k];
      now_.state[k][lane] = q[k];
      now_.state[n_ + k][lane] = rate[lane];
      now_.low[k][lane] = now_.low[n_ + k][lane] = 0;
    }
    is_expanded_ = is_begun_ = false;
    if constexpr (!is_batch<L>) {
      if (tangent_) tangent_->forget();
    }
  }

  /// Visits the numbers of one motion, as MemberNumbers does.
  template <class Numbers>
  void member(Numbers& numbers) requires(!is_batch<L>) {
    numbers(now_.state, now_.low, now_.unit, time_);
    for (int i = 0; i < count(); ++i) numbers(now_.parts[i].place, now_.parts[i].rate);
    is_expanded_ = is_begun_ = false;
  }

  std::array<LongReal, 1> exact_place(int i) const requires(!is_batch<L>) { return {sum_of(i)}; }
  std::array<LongReal, 1> exact_rate(int i) const requires(!is_batch<L>) {
    if (!has_momenta()) return {sum_of(count() + i)};
    return {now_.parts[i].rate[0]};
  }
  const std::array<L, D>& along(int i) const { return now_.parts[i].place; }

  /// Calls visit(i, q̇_i, …) for all coordinates.
  template <class Visit>
  void for_each_rate(Visit visit) const {
    for (int i = 0; i < count(); ++i) visit(i, now_.parts[i].rate, L(0.0));
  }

  /// T + U  [J].
  L energy() {
    for (int i = 0; i < count(); ++i) {
      to_row(now_.parts[i].place[0], seen_[i]);
      to_row(now_.parts[i].rate[0], seen_[count() + i]);
    }
    double *const kinetic = rates_[n_], *const total = rates_[n_ + 1];
    systems_.here(time_, &SystemFunctions::energies, seen_[0], seen_[n_], kinetic, total);
    const L T = from_row<L>(kinetic), energy = from_row<L>(total);
    energy_sum_ = abs(T) + abs(energy - T);
    return energy;
  }
  /// |T| + |U| at the last call of energy()  [J].
  const L& energy_sum() const { return energy_sum_; }

  /// The largest steps that the series about the current states allow.
  L longest_step() {
    if (!is_expanded_) expand();
    return longest_;
  }

  /// Tries a step of `h` from `time`. Returns for which of the `wanted` members its end is finite and the series solves
  /// the equations on the way. The state is unchanged.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    time_ = time;
    if (!is_expanded_) expand();
    tried_ = h;
    const L unit = series_.unit(), tau = h / unit;
    series_.sum_all(tau, Series::rises, rises_, 0, 2 * n_);
    series_.for_each_part([&]<class Lanes>(std::size_t k, std::type_identity<Lanes>) {
      const Lanes x = from_row<Lanes>(now_.state[k]),
                  change = fma(Lanes(tau), from_row<Lanes>(rises_[k]), from_row<Lanes>(now_.low[k])),
                  there = x + change;
      to_row(there, trial_.state[k]);
      to_row(change - (there - x), trial_.low[k]);
    });
    // The unit is near the size of the next step: longest_, since the end of a run may have cut this step short.
    trial_.unit = select(longest_ <= most_growth * unit, longest_, unit);
    ahead_.begin(systems_, time + h, trial_.unit, trial_.state);
    is_begun_ = false;
    L none(0.0);
    for (std::size_t i = 0; i < n_; ++i) {
      const L place = ahead_.coefficient(0, i), rate = ahead_.velocity(i);
      trial_.parts[static_cast<int>(i)] = {{place}, {rate}};
      none = none + (place - place) + (rate - rate);
    }
    return looks_.hold({series_, reach_, ahead_, time, h}, rises_, wanted & (none == L(0.0)));
  }

  const Parts& tried() const { return trial_.parts; }

  /// The first coordinate of the tried step that is not finite; −1: none.
  int part_not_finite() const requires(!is_batch<L>) {
    for (int i = 0; i < count(); ++i) {
      const Part& part = trial_.parts[i];
      if (!std::isfinite(part.place[0]) || !std::isfinite(part.rate[0])) return i;
    }
    return -1;
  }

  /// Moves these members to the end of the tried step. Their series stay for dense output, until the next ones are
  /// expanded.
  void accept(const Mask& which) {
    if constexpr (is_batch<L>) {
      for (auto rows : {std::pair(&trial_.state, &now_.state), {&trial_.low, &now_.low}}) {
        for (std::size_t k = 0; k < 2 * n_; ++k) {
          double* const to = (*rows.second)[k];
          to_row(select(which, from_row<L>((*rows.first)[k]), from_row<L>(to)), to);
        }
      }
      for (int i = 0; i < count(); ++i) {
        const Part& from = trial_.parts[i];
        Part& to = now_.parts[i];
        to = {{select(which, from.place[0], to.place[0])}, {select(which, from.rate[0], to.rate[0])}};
      }
      now_.unit = select(which, trial_.unit, now_.unit);
    } else {
      std::swap(now_, trial_);
      if (tangent_) {
        tangent_->keep(tried_, motion_of(trial_.parts, time_), motion_of(now_.parts, time_ + tried_));
      }
    }
    begin_time_ = select(which, time_, begin_time_);
    time_ = select(which, time_ + tried_, time_);
    step_ = select(which, tried_, step_);
    is_expanded_ = false;
    is_begun_ = all(which);
  }

  /// From now on steps keep their derivative. Empty if the kernel has none.
  std::optional<SeriesTangent>& linearize(const SystemModel& model) requires(!is_batch<L>) {
    if (!tangent_ && SeriesTangent::is_had_of(model.table())) tangent_.emplace(model, series_.order()).forget();
    is_expanded_ = false;
    return tangent_;
  }
  std::optional<SeriesTangent>& tangent() requires(!is_batch<L>) { return tangent_; }

  /// The largest z for which a step multiplies a tangent that decays as e^(−z) correctly to `error` in z: the error of
  /// the series of e^(−z) is z^(order+1)/(order+1)!.
  double resolved_decay(double error) const requires(!is_batch<L>) {
    const double most = std::log(error) + std::lgamma(series_.order() + 2);
    double z = 0;
    for (double step = 64; step > 1e-3; step /= 2) {
      if (series_.order() * std::log(z + step) + (z + step) <= most) z += step;
    }
    return z;
  }

  /// A coordinate and its rate at the fraction `share` of the last step, by the series of the coordinate.
  Part at(int i, double share) const {
    const L tau = L(share) * step_ / series_.unit();
    const auto k = static_cast<std::size_t>(i);
    return {{series_.sum(k, tau)}, {has_momenta() ? series_.slope(k, tau) / series_.unit() : series_.sum(n_ + k, tau)}};
  }
  /// Calls visit(i, q, v) for all coordinates.
  template <class Visit>
  void for_each_at(double share, Visit visit) const {
    for (int i = 0; i < count(); ++i) {
      const Part there = at(i, share);
      visit(i, there.place, there.rate);
    }
  }

  /// Bounds of how far a coordinate and its rate get within the last step from where they begin.
  Part excursion(int i) const requires(!is_batch<L>) {
    constexpr double beyond = 4;  // times the last terms: rates from momenta may differ by that from the series
    const auto k = static_cast<std::size_t>(i);
    const auto last = static_cast<std::size_t>(series_.order()) - (has_momenta() ? 1 : 0);
    const L unit = series_.unit(), tau = step_ / unit;
    const L place = tau * series_.sum_of(tau, [&](std::size_t order) { return abs(series_.coefficient(order, k)); });
    const L turned = tau * series_.sum_of(tau, [&](std::size_t order) { return abs(series_.rate(order, k)); });
    const L rest =
        std::max(abs(series_.rate(last, k)) * tau, abs(series_.rate(last - 1, k))) * std::pow(tau, double(last - 1));
    return {{place}, {(turned + beyond * rest) / unit}};
  }

  /// The same, with rates from the momenta there.
  template <class Visit>
  void for_each_at_full_order(double share, Visit visit) {
    const L tau = L(share) * step_ / series_.unit();
    for (std::size_t k = 0; k < 2 * n_; ++k) to_row(series_.sum(k, tau), trial_.state[k]);
    read_rates(fma(L(share), step_, begin_time_), trial_.state, trial_.parts);
    for (int i = 0; i < count(); ++i) visit(i, trial_.parts[i].place, trial_.parts[i].rate);
  }

 private:
  using Series = SeriesExpansion<L>;
  static constexpr std::size_t W = width_of<L>;
  static constexpr double most_growth = 1e3;  // of the unit from step to step: an equilibrium allows any
  static constexpr double shorter_unit = 1e-6;
  static constexpr int most_units = 30;

  bool has_momenta() const { return series_.has_momenta(); }

  Motion motion_of(const Parts& parts, double time) const requires(!is_batch<L>) {
    Motion motion{time, Eigen::VectorXd(count()), Eigen::VectorXd(count())};
    for (int i = 0; i < count(); ++i) {
      motion.q[i] = parts[i].place[0];
      motion.v[i] = parts[i].rate[0];
    }
    return motion;
  }

  /// The time in which a coordinate changes by its own size, or by 1; 1 s where nothing moves. `rates_` has
  /// accelerations  [s].
  double first_unit(int lane, const double* q, const double* v) const {
    double squared = 0;
    for (std::size_t k = 0; k < n_; ++k) {
      const double size = std::max(1.0, std::abs(q[k])), fast = v[k] / size;
      squared = std::max(squared, fast * fast + std::abs(rates_[k][lane]) / size);
    }
    const double unit = 1 / std::sqrt(squared);
    return unit > 0 && std::isfinite(unit) ? unit : 1;
  }

  LongReal sum_of(int k) const { return static_cast<LongReal>(*now_.state[k]) + *now_.low[k]; }

  void read_rates(const L& time, PackRows<W>& state, Parts& parts) {
    if (has_momenta()) {
      systems_.here(time, &SystemFunctions::velocity_from_momentum, state[0], state[n_], rates_[0]);
    }
    for (int i = 0; i < count(); ++i) {
      parts[i] = {{from_row<L>(state[i])}, {from_row<L>(has_momenta() ? rates_[i] : state[count() + i])}};
    }
  }

  /// Computes the series in a unit of time near the step size, so that coefficients are neither huge nor tiny. The end
  /// of the last step may have begun it.
  void expand() {
    L unit = now_.unit;
    if (is_begun_) std::swap(series_, ahead_);
    for (int attempt = 0; attempt < most_units; ++attempt) {
      if (!std::exchange(is_begun_, false)) series_.begin(systems_, time_, unit, now_.state);
      series_.finish(systems_, time_);
      longest_ = reach_.longest_step(series_);
      if constexpr (!is_batch<L>) {
        if (tangent_) {
          tangent_->expand(time_, unit, series_.numbers(), series_.inputs());
          longest_ = std::min(longest_, reach_.step_of(series_, tangent_->log_radius(reach_.looked_at)));
        }
      }
      const Mask is_good = longest_ > L(0.0);
      if (all(is_good)) break;
      unit = select(is_good, unit, L(shorter_unit) * unit);
    }
    is_expanded_ = true;
  }

  MemberSystems<L>& systems_;
  std::size_t n_;
  Series series_, ahead_;  // about the state where the current or the last step begins; about the end of the tried one
  SeriesReach<L> reach_;
  SeriesLooks<L> looks_;
  FullState now_, trial_;
  PackRows<W> rises_;         // of the series to the end of the tried step
  PackRows<W> seen_, rates_;  // a state, and the result of a kernel's function there
  L time_{0.0}, begin_time_{0.0};
  L tried_{0.0}, step_{1.0};  // of the tried step, of the last one
  L longest_{0.0}, energy_sum_{0.0};
  bool is_expanded_ = false, is_begun_ = false, is_seated_ = false;  // is_begun_: ahead_ is about the current state
  std::conditional_t<is_batch<L>, std::false_type, std::optional<SeriesTangent>> tangent_;
};

}  // namespace pendula
