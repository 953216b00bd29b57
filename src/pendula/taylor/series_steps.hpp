#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <pendula/chain/chain_links.hpp>
#include <pendula/explicit/error_size.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/moving_part.hpp>
#include <pendula/system/series_info.hpp>
#include <pendula/system/system_table.hpp>
#include <pendula/taylor/series_controller.hpp>
#include <pendula/taylor/series_limits.hpp>
#include <pendula/taylor/series_tangent.hpp>
#include <span>
#include <type_traits>
#include <utility>

namespace pendula {

/// What ExplicitSystem asks of a method: forces are looked at during a step as densely as by a quadrature of this
/// order.
struct TaylorSeries {
  static constexpr int error_order = 14;
  static constexpr bool is_blind = false;
  static constexpr bool looks_itself = true;  // at its own polynomial: SeriesSteps::solve
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
        info_(systems.info().series),
        n_(static_cast<std::size_t>(systems.coordinates())),
        row_(series_state_row(n_, W) / W),
        order_(order_for(options.tolerance)),
        look_(most_looks, 2, systems.info().argument_is_base),
        largest_defect_(0.25 * order_ * order_ * std::max(options.tolerance, 1e-15)),
        log_reach_(std::log2(std::max(options.tolerance, detail::finest_of_series)) / order_),
        series_(info_, systems.info().inputs.size(), order_, row_),
        ahead_(series_),
        moved_(row_),
        turned_(row_),
        bent_(row_),
        now_{PackRows<W>(row_), PackRows<W>(row_), Parts(systems.coordinates())},
        trial_(now_),
        seen_(2 * n_),
        rates_(n_ + 2),
        arguments_(3 * systems.info().argument_is_base.size() + 1),
        scales_(row_),
        rate_scales_(row_),
        unit_row_(1) {
    for (int i = 0; i < count(); ++i) now_.parts[i] = trial_.parts[i] = Part::zero();
  }

  SeriesSteps& chain() { return *this; }
  const SeriesSteps& chain() const { return *this; }
  /// Coordinates of the system.
  int count() const { return static_cast<int>(n_); }
  const Parts& parts() const { return now_.parts; }

  /// A state, with everything that the next steps depend on.
  struct FullState {
    PackRows<width_of<L>> state, low;  // q, then p or v; and their rounding errors
    Parts parts;                       // q and v
    L unit{1.0};                       // of time, for the series about this state  [s]
  };
  /// A member comes into a lane, with its numbers, at q and v at `time`. The first one comes into all lanes, so that
  /// they have numbers to compute with.
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
    if (info_.has_momenta) {
      systems_.here(time_, &SystemFunctions::momentum_from_velocity, seen_[0], seen_[n_], rates_[0]);
    }
    for (std::size_t k = 0; k < n_; ++k) {
      const double* const rate = info_.has_momenta ? rates_[k] : seen_[n_ + k];
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
    if (!info_.has_momenta) return {sum_of(count() + i)};
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

  /// Tries a step of `h` from `time`. Returns of which `wanted` members its end is finite, and the series solves the
  /// equations on the way: its terms know nothing of what is ahead and vanishes with all its derivatives where the step
  /// begins, as a hill of a high power does. The state is unchanged.
  PENDULA_IN_REGISTERS [[gnu::noinline]] Mask solve(const L& time, const L& h, const Mask& wanted) {
    time_ = time;
    if (!is_expanded_) expand();
    tried_ = h;
    const L tau = h / unit_;
    sum_all(tau, rises, moved_);
    for_each_part([&]<class Lanes>(std::size_t k, std::type_identity<Lanes>) {
      const Lanes x = from_row<Lanes>(now_.state[k]),
                  change = fma(Lanes(tau), from_row<Lanes>(moved_[k]), from_row<Lanes>(now_.low[k])),
                  there = x + change;
      to_row(there, trial_.state[k]);
      to_row(change - (there - x), trial_.low[k]);
    });
    L none(0.0);
    // Near the size that its steps will have; a step that the end of a run has cut short says nothing of that.
    trial_.unit = select(longest_ <= most_growth * unit_, longest_, unit_);
    begin(time + h, trial_.unit, trial_, ahead_);
    is_begun_ = false;
    for (int i = 0; i < count(); ++i) {
      const L rate = info_.has_momenta ? ahead_.at(1, static_cast<std::size_t>(i)) / trial_.unit
                                       : from_row<L>(trial_.state[count() + i]);
      const L place = from_row<L>(trial_.state[i]);
      trial_.parts[i] = {{place}, {rate}};
      none = none + (place - place) + (rate - rate);
    }
    Mask found = wanted & (none == L(0.0));
    found = found & ends_as(h, tau);
    if (!look_.has_to_look() || !any(found)) return found;
    see(tau, true);
    find_arguments(time + h, 2);
    const Mask is_far = found & goes_far();
    for (int k = 1; k < looks && any(found & is_far); ++k) {
      found = found & (solves(time, h, L(static_cast<double>(k) / looks)) | !is_far);
    }
    see(L(0.5) * tau);
    find_arguments(fma(L(0.5), h, time), 1);
    for (std::size_t i = 0; i < n_; ++i) {
      to_row(coefficient(0, i), seen_[i]);
      to_row(now_.parts[static_cast<int>(i)].rate[0], seen_[n_ + i]);
    }
    find_arguments(time, 0);
    const Mask is_doubtful = found & arguments_change();
    return any(is_doubtful) ? found & solves_closely(time, h, is_doubtful) : found;
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

  /// From now on steps keep their derivative; nothing where the kernel has none.
  std::optional<SeriesTangent>& linearize(const SystemModel& model) requires(!is_batch<L>) {
    if (!tangent_ && SeriesTangent::is_had_of(model.table())) tangent_.emplace(model, order_).forget();
    is_expanded_ = false;
    return tangent_;
  }
  std::optional<SeriesTangent>& tangent() requires(!is_batch<L>) { return tangent_; }

  /// The largest z for which a step multiplies what decays as e^(−z) correctly to `error` of z: the series of e^(−z) is
  /// off by z^(order+1)/(order+1)!.
  double resolved_decay(double error) const requires(!is_batch<L>) {
    const double most = std::log(error) + std::lgamma(order_ + 2);
    double z = 0;
    for (double step = 64; step > 1e-3; step /= 2) {
      if (order_ * std::log(z + step) + (z + step) <= most) z += step;
    }
    return z;
  }

  /// A coordinate and its rate at the fraction `share` of the last step, by the series of the coordinate.
  Part at(int i, double share) const {
    const L tau = L(share) * step_ / unit_;
    const auto k = static_cast<std::size_t>(i);
    const L place = fma(tau, rise(k, tau), coefficient(0, k));
    return {{place}, {info_.has_momenta ? slope(k, tau) / unit_ : fma(tau, rise(n_ + k, tau), coefficient(0, n_ + k))}};
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
    constexpr double beyond = 4;  // last terms: what rates by momenta may differ by from those of the series
    const auto k = static_cast<std::size_t>(i);
    const auto last = static_cast<std::size_t>(order_) - (info_.has_momenta ? 1 : 0);
    const L tau = step_ / unit_;
    const L place = tau * sum(tau, [&](std::size_t order) { return abs(coefficient(order, k)); });
    const L turned = tau * sum(tau, [&](std::size_t order) { return abs(rate(order, k)); });
    const L rest = std::max(abs(rate(last, k)) * tau, abs(rate(last - 1, k))) * std::pow(tau, double(last - 1));
    return {{place}, {(turned + beyond * rest) / unit_}};
  }

  /// The same where rates are those of the momenta there.
  template <class Visit>
  void for_each_at_full_order(double share, Visit visit) {
    const L tau = L(share) * step_ / unit_;
    for (std::size_t k = 0; k < 2 * n_; ++k) {
      to_row(fma(tau, rise(k, tau), coefficient(0, k)), trial_.state[k]);
    }
    read_rates(fma(L(share), step_, begin_time_), trial_.state, trial_.parts);
    for (int i = 0; i < count(); ++i) visit(i, trial_.parts[i].place, trial_.parts[i].rate);
  }

 private:
  static constexpr std::size_t W = width_of<L>;
  static constexpr double most_growth = 1e3;  // of the unit from step to step: an equilibrium allows any
  static constexpr double shorter_unit = 1e-6;
  static constexpr int least_order = 6, most_order = 32, looked_at = 4, most_units = 30;
  // Places of a step that goes far where accelerations are compared, the end among them, as in every step; and how
  // closely functions that may be narrow are looked at, in nodes of a Gauss method.
  static constexpr int looks = 3, most_looks = 8;
  static constexpr double far_turn = 0.5, far_way = 0.25;  // rad; of the largest length
  static constexpr double most_turn = 3;                   // rad within a step, so that it is not from hill to hill

  /// A series of a motion, with what its kernel keeps for it.
  struct Series {
    // Orders up to one that is a multiple of four, beyond the last one zero: sums are taken four by four.
    Series(const SeriesInfo& info, std::size_t system_inputs, int order, std::size_t row_length)
        : row(row_length),
          state((static_cast<std::size_t>(order) + 5) * row),
          kept(static_cast<std::size_t>(info.kept) + 1),
          operands(static_cast<std::size_t>(order) * series_operand_row(info, W) / W + 1),
          inputs((static_cast<std::size_t>(order) + 1) * system_inputs + 1) {}

    L at(std::size_t order, std::size_t k) const { return from_row<L>(state[order * row + k]); }
    SeriesRows rows(const double* unit) {
      return {.unit = unit, .state = state[0], .kept = kept[0], .operands = operands[0]};
    }

    std::size_t row;
    PackRows<W> state, kept, operands, inputs;
  };

  Motion motion_of(const Parts& parts, double time) const requires(!is_batch<L>) {
    Motion motion{time, Eigen::VectorXd(count()), Eigen::VectorXd(count())};
    for (int i = 0; i < count(); ++i) {
      motion.q[i] = parts[i].place[0];
      motion.v[i] = parts[i].rate[0];
    }
    return motion;
  }

  /// The order that needs the fewest operations for a tolerance.
  static int order_for(double tolerance) {
    const double order = 4 - 1.25 * std::log10(std::max(tolerance, detail::finest_of_series));
    return std::clamp(static_cast<int>(std::lround(order)), least_order, most_order);
  }

  /// The time in which the motion changes by itself, or 1 rad; 1 s where nothing moves. `rates_` has accelerations.
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

  L coefficient(std::size_t order, std::size_t k) const { return series_.at(order, k); }

  /// Σ term(k+1) τ^k, in four strands that do not wait for one another.
  template <class Lanes, class Term>
  Lanes sum(const Lanes& tau, Term term) const {
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
    return sum(tau, [&](std::size_t order) { return coefficient(order, k); });
  }

  /// Σ (k+1) c_(k+1) τ^k
  L slope(std::size_t k, const L& tau) const {
    return sum(tau, [&](std::size_t order) { return L(static_cast<double>(order)) * coefficient(order, k); });
  }

  /// Weights w and orders d of Σ w c_(k+d) τ^(k−1), k = 1, 2, …: a polynomial less its constant, over τ; its first and
  /// second derivatives.
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

  /// Such a sum of all coordinates; of one motion as many at once as a row of its state has.
  template <class Which>
  void sum_all(const L& tau, Which which, PackRows<W>& to) const {
    const auto add = [&]<class Lanes>(const Lanes& at, std::size_t first, std::type_identity<Lanes>) {
      to_row(sum(at,
                 [&](std::size_t k) {
                   const Lanes row = from_row<Lanes>(series_.state[(k + which.ahead) * row_ + first]);
                   if constexpr (std::is_same_v<Which, Rises>) return row;
                   return Lanes(which.weight(k)) * row;
                 }),
             to[first]);
    };
    for_each_part(
        [&]<class Lanes>(std::size_t first, std::type_identity<Lanes> lanes) { add(Lanes(tau), first, lanes); });
  }

  /// Calls visit(first, type) for the parts of a row of states that registers hold: of one motion as many numbers as
  /// they have, of several each number of all.
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

  void read_rates(const L& time, PackRows<W>& state, Parts& parts) {
    if (info_.has_momenta) {
      systems_.here(time, &SystemFunctions::velocity_from_momentum, state[0], state[n_], rates_[0]);
    }
    for (int i = 0; i < count(); ++i) {
      parts[i] = {{from_row<L>(state[i])}, {from_row<L>(info_.has_momenta ? rates_[i] : state[count() + i])}};
    }
  }

  /// In which members the tried step is so long that it may have gone over something that its end is not beside.
  Mask goes_far() const {
    L turn(0.0), way(0.0), size(0.0);
    for (int i = 0; i < count(); ++i) {
      const L from = now_.parts[i].place[0], to = trial_.parts[i].place[0], moved = abs(to - from);
      if (systems_.is_angle(i)) {
        turn = max(turn, moved);
      } else {
        way = max(way, moved);
        size = max(size, max(abs(from), abs(to)));
      }
    }
    return (turn > L(far_turn)) | (way > L(far_way) * size);
  }

  /// Finds the motion of the series at a time; `is_summed`: from sums that are there.
  void see(const L& tau, bool is_summed = false) {
    const L inverse = L(1.0) / unit_;
    if (!is_summed) sum_all(tau, rises, moved_);
    if (info_.has_momenta) sum_all(tau, slopes, turned_);
    for (std::size_t i = 0; i < n_; ++i) {
      to_row(fma(tau, from_row<L>(moved_[i]), coefficient(0, i)), seen_[i]);
      to_row(info_.has_momenta ? from_row<L>(turned_[i]) * inverse
                               : fma(tau, from_row<L>(moved_[n_ + i]), coefficient(0, n_ + i)),
             seen_[n_ + i]);
    }
  }

  /// Whether accelerations at a fraction of the step are those of the series, but for what terms beyond its order may
  /// add, and for the rounding of coordinates: where a motion dies away far from 0, nothing else is left.
  Mask solves(const L& time, const L& h, const L& share) {
    const L tau = share * h / unit_;
    see(tau);
    systems_.here(fma(share, h, time), &SystemFunctions::acceleration, seen_[0], seen_[n_], rates_[0]);
    return bends_by_rates(h, tau);
  }
  /// The same at the end of the step, where the next series has begun.
  Mask ends_as(const L& h, const L& tau) {
    const L inverse = L(1.0) / trial_.unit;
    for (std::size_t i = 0; i < n_; ++i) {
      to_row(info_.has_momenta ? L(2.0) * ahead_.at(2, i) * (inverse * inverse) : ahead_.at(1, n_ + i) * inverse,
             rates_[i]);
    }
    return bends_by_rates(h, tau);
  }
  Mask bends_by_rates(const L& h, const L& tau) {
    const L inverse = L(1.0) / unit_;
    info_.has_momenta ? sum_all(tau, bends, bent_) : sum_all(tau, slopes, turned_);
    L farthest(0.0);
    for (std::size_t i = 0; i < n_; ++i) farthest = max(farthest, abs(coefficient(0, i)));
    Mask found(L(0.0) == L(0.0));
    for (std::size_t i = 0; i < n_; ++i) {
      const L by_series =
          info_.has_momenta ? from_row<L>(bent_[i]) * (inverse * inverse) : from_row<L>(turned_[n_ + i]) * inverse;
      const L defect =
          max(h * unit_ * abs(from_row<L>(rates_[i]) - by_series) - L(ErrorSize::rounding) * farthest, L(0.0));
      found = found & (defect * from_row<L>(rate_scales_[i]) <= L(largest_defect_));
    }
    return found;
  }

  /// Arguments of functions that may be narrow, at the motion that was seen: where the step begins (look 0), in its
  /// middle, and at its end.
  void find_arguments(const L& time, int look) {
    systems_.here(time, &SystemFunctions::call_arguments, seen_[0], seen_[n_], argument(look, 0));
  }
  double* argument(int look, std::size_t a) {
    return arguments_[static_cast<std::size_t>(look) * systems_.info().argument_is_base.size() + a];
  }

  /// Whether one of them changes much from look to look.
  Mask arguments_change() {
    const std::span<const bool> is_base = systems_.info().argument_is_base;
    Mask are_steady(L(0.0) == L(0.0));
    for (int look = 1; look < 3; ++look) {
      for (std::size_t a = 0; a < is_base.size(); ++a) {
        const L here = from_row<L>(argument(look, a)), before = from_row<L>(argument(look - 1, a));
        const L size = is_base[a] ? min(abs(here), abs(before)) : L(1.0);
        are_steady = are_steady & (abs(here - before) <= L(FieldLook::much) * size);
      }
    }
    return !are_steady;
  }

  /// Which of these members solve the equations wherever such functions change fast within the step; others do.
  Mask solves_closely(const L& time, const L& h, const Mask& which) {
    const L asked = select(which, L(1.0), L(0.0));
    L wrong(0.0);
    for (int lane = 0; lane < static_cast<int>(W); ++lane) {
      if (get(asked, lane) != 0 && !solves_closely(time, h, lane)) set(wrong, lane, 1);
    }
    return wrong == L(0.0);
  }
  bool solves_closely(const L& time, const L& h, int lane) {
    const auto arguments = [&](std::span<const double> shares, double* found) {
      for (const double share : shares) {
        see(L(share) * h / unit_);
        find_arguments(fma(L(share), h, time), 0);
        for (std::size_t a = 0; a < systems_.info().argument_is_base.size(); ++a) *found++ = argument(0, a)[lane];
      }
    };
    return !look_.finds(arguments) || look_.holds_at_nodes([&](double share) {
      return get(select(solves(time, h, L(share)), L(1.0), L(0.0)), lane) != 0;
    });
  }

  /// The orders of a series that are computed with order 0, since they give accelerations.
  int begun_orders() const { return info_.has_momenta ? 1 : 0; }

  /// Begins a series, which so has the accelerations.
  void begin(const L& time, const L& unit, const FullState& from, Series& series) {
    for (std::size_t k = 0; k < 2 * n_; ++k) to_row(from_row<L>(from.state[k]), series.state[k]);
    to_row(unit, unit_row_[0]);
    systems_.begin_series(time, unit, order_, begun_orders(), series.inputs, series.rows(unit_row_[0]));
  }

  /// Computes the series in a unit of time near the step size, so that coefficients are neither huge nor tiny. The end
  /// of the last step may have begun it.
  void expand() {
    unit_ = now_.unit;
    if (is_begun_) std::swap(series_, ahead_);
    for (int attempt = 0; attempt < most_units; ++attempt) {
      if (!std::exchange(is_begun_, false)) begin(time_, unit_, now_, series_);
      to_row(unit_, unit_row_[0]);
      systems_.end_series(time_, begun_orders() + 1, order_ - 1, series_.inputs, series_.rows(unit_row_[0]));
      longest_ = size_by_terms();
      if constexpr (!is_batch<L>) {
        if (tangent_) {
          tangent_->expand(time_, unit_, series_.state[0], series_.inputs[0]);
          longest_ = std::min(longest_, step_of(tangent_->log_radius(looked_at)));
        }
      }
      const Mask is_good = longest_ > L(0.0);
      if (all(is_good)) break;
      unit_ = select(is_good, unit_, L(shorter_unit) * unit_);
    }
    is_expanded_ = true;
  }

  /// From the decay of the last terms, relative to the size of the motion; 0 if one is not finite. Several terms are
  /// used, because motions that start at rest, and symmetric ones, have only every second or fourth term.
  L size_by_terms() {
    const int first = order_ - looked_at + (info_.has_momenta ? 0 : 1);
    find_scales();
    std::array<L, looked_at> terms;
    const Mask are_finite = find_terms(static_cast<std::size_t>(first), terms);
    L log_radius(detail::largest_log_radius);
    for (int k = 0; k < looked_at; ++k) {
      const L& term = terms[static_cast<std::size_t>(k)];
      log_radius = min(log_radius, L(-1.0 / (first + k)) * log2_near(max(term, L(detail::almost_zero))));
    }
    return select(are_finite, min(step_of(log_radius), longest_turn()), L(0.0));
  }

  /// The largest terms of some orders from `first` on. Returns of which members all are finite.
  Mask find_terms(std::size_t first, std::array<L, looked_at>& terms) const {
    terms.fill(L(0.0));
    L none(0.0);
    for_each_part([&]<class Lanes>(std::size_t part, std::type_identity<Lanes>) {
      if (is_batch<L> && info_.has_momenta && part >= n_) return;  // momenta are not compared
      const Lanes scale = from_row<Lanes>(scales_[part]), rate_scale = from_row<Lanes>(rate_scales_[part]);
      Lanes lost(0.0);
      for (std::size_t j = 0; j < looked_at; ++j) {
        const std::size_t order = first + j;
        const Lanes place = from_row<Lanes>(series_.state[order * row_ + part]) * scale;
        Lanes largest = abs(place);
        lost = lost + (place - place);
        if (info_.has_momenta) {
          const Lanes weight(static_cast<double>(order + 1));
          const Lanes rate = from_row<Lanes>(series_.state[(order + 1) * row_ + part]) * (weight * rate_scale);
          largest = max(largest, abs(rate));
          lost = lost + (rate - rate);
        }
        for_each_number(largest, [&](const L& one) { terms[j] = max(terms[j], one); });
      }
      for_each_number(lost, [&](const L& one) { none = none + one; });
    });
    return none == L(0.0);
  }

  /// Calls visit(number) for those of one motion that a register holds, or for that of several members.
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
  L longest_turn() const {
    L fastest(detail::almost_zero);
    for (std::size_t i = 0; i < n_; ++i) {
      if (systems_.info().is_angle[i]) fastest = max(fastest, abs(rate(0, i)));
    }
    return L(most_turn) * unit_ / fastest;
  }

  L step_of(const L& log_radius) const {
    return exp(L(std::numbers::ln2) * min(log_radius + L(log_reach_), L(600.0))) * unit_;
  }

  /// Terms are relative to each coordinate itself, plus 1 rad or the size of the whole motion if that is smaller, so
  /// that oscillations of 1e-9 rad are resolved like any other; rates, times the unit of time, likewise. Full turns
  /// that an angle has made count for nothing.
  void find_scales() {
    L q(0.0), v(0.0), a(0.0);
    for (std::size_t i = 0; i < n_; ++i) {
      q = max(q, abs(coefficient(0, i)));
      v = max(v, abs(rate(0, i)));
      a = max(a, abs(rate(1, i)));
    }
    const auto within = [](const L& x) { return min(max(x, L(ErrorSize::nothing)), L(1.0)); };
    const L places = within(max(q, v)), speeds = within(max(max(v, a), L(ErrorSize::rounding) * q));
    for (std::size_t i = 0; i < n_; ++i) {
      const L place = abs(coefficient(0, i)), size = systems_.info().is_angle[i] ? min(place, L(1.0)) : place;
      const L of_rate = L(1.0) / (speeds + abs(rate(0, i)));
      to_row(L(1.0) / (places + size), scales_[i]);
      to_row(of_rate, rate_scales_[i]);
      if (!info_.has_momenta) to_row(unit_ * of_rate, scales_[n_ + i]);
    }
  }

  /// A coefficient of a rate, times the unit of time.
  L rate(std::size_t order, std::size_t i) const {
    if (!info_.has_momenta) return unit_ * coefficient(order, n_ + i);
    return L(static_cast<double>(order + 1)) * coefficient(order + 1, i);
  }

  MemberSystems<L>& systems_;
  SeriesInfo info_;
  std::size_t n_, row_;
  int order_;
  FieldLook look_;
  double largest_defect_;  // of accelerations, times h, relative to scales
  double log_reach_;       // step size relative to the estimated radius of convergence, log₂
  Series series_, ahead_;  // about the state where the current or the last step begins; about the end of the tried one
  PackRows<W> moved_, turned_, bent_;  // sums of all coordinates
  FullState now_, trial_;
  PackRows<W> seen_;  // a motion on the way of a step
  PackRows<W> rates_;
  PackRows<W> arguments_;  // of functions that may be narrow, at three places of a step
  // What terms of coordinates are multiplied by, and of rates, times the unit of time; those of rates as they are.
  PackRows<W> scales_, rate_scales_;
  PackRows<W> unit_row_;
  L time_{0.0}, begin_time_{0.0};
  L tried_{0.0}, step_{1.0};  // of the tried step, of the last one
  L unit_{1.0}, longest_{0.0}, energy_sum_{0.0};
  bool is_expanded_ = false, is_begun_ = false, is_seated_ = false;  // is_begun_: ahead_ is about the current state
  std::conditional_t<is_batch<L>, std::false_type, std::optional<SeriesTangent>> tangent_;
};

}  // namespace pendula
