#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <pendula/gauss/member_layout.hpp>
#include <pendula/gauss/momentum_form.hpp>
#include <pendula/gauss/stage_tangents.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/system_motion.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/moving_part.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

/// Systems of one kernel, one in each lane, and the stages of their Gauss steps (SystemMotion); if asked for, with a
/// tangent of each member (StageTangents), whose stages are solved after those of the motion.
template <int S, class Register = MemberRegister, bool with_tangent = false>
class SystemMembers
    : public SystemMotion<MembersInLanes<S, LanePack<Register>>, MemberSystems<LanePack<Register>>&, MomentumForm> {
  using Base = SystemMotion<MembersInLanes<S, LanePack<Register>>, MemberSystems<LanePack<Register>>&, MomentumForm>;

 public:
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using SpaceType = CoordinateSpace;
  using Subject = MemberSystems<L>&;
  static constexpr int stages = S, links_known = Eigen::Dynamic;
  static constexpr bool has_tangent = with_tangent;
  static constexpr int sequences = 2;         ///< FixedPointStop's
  static constexpr int most_iterations = 25;  ///< in an adaptive step
  static constexpr std::size_t D = 1;
  using Vector = std::array<L, D>;
  using typename Base::Columns;

  /// `dynamics` must outlive it.
  explicit SystemMembers(MemberSystems<L>& dynamics)
      : Base(dynamics, Family::gauss, S), saved_(Base::place()), tangent_(dynamics, columns_) {
    for (const bool is_angle : dynamics.info().is_angle) may_miss_ = may_miss_ || !is_angle;
  }

  /// Coordinates of the system.
  int count() const { return static_cast<int>(count_); }

  // --- One member ---

  /// A member comes into a lane, with its numbers, at q and v at `time`; its next step starts cold.
  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v) {
    dynamics_.take(lane, system);
    const SystemModel model(dynamics_.table(), system);
    SystemAt<1> here(model);
    here.set_time(time);
    std::vector<double> p(count_);
    here(&SystemFunctions::momentum_from_velocity, q, v, p.data());
    Pace<double> pace(model.info());
    pace.start(here, q, v);
    MassScale<double> masses(model.info());
    masses.start(here, q);
    pace_.start(lane, pace);
    masses_.start(lane, masses);
    loaded_.set(lane, model.loaded() ? 1 : 0);
    time_.set(lane, time);
    fastest_.set(lane, 0);
    for (std::size_t k = 0; k < count_; ++k) Base::start(lane, k, q[k], p[k]);
    Base::read_masses();
    if constexpr (has_tangent) tangent_.start(lane, time, q, v);
  }

  // --- All members ---

  /// Coordinate i, with all turns that were made.
  Vector along(int i) const { return {Base::coordinate(static_cast<std::size_t>(i))}; }

  /// visit(i, q̇_i, …) of all coordinates.
  template <class Visit>
  void for_each_rate(Visit visit) {
    Base::find_rates(time_);
    for (int i = 0; i < count(); ++i) visit(i, Vector{Base::rate(static_cast<std::size_t>(i))}, L(0.0));
  }

  /// Whether convergence of the fixed point may need shorter steps than errors do: always, since any force is possible.
  Mask may_be_stiff() const { return L(0.0) == L(0.0); }
  /// Whether loads may bring or take energy.
  Mask loaded() const { return loaded_ > L(0.0); }

  /// T + U  [J].
  L energy() {
    Base::find_rates(time_);
    const auto found = Base::energies(time_);
    energy_sum_ = found.size();
    kinetic_ = found.kinetic;
    return found.total;
  }
  /// |T| + |U| where the energy was asked for last  [J].
  const L& energy_sum() const { return energy_sum_; }

  /// The energy that the end of the solved step should have: the present one and the work of loads  [J].
  L energy_due() {
    const L energy = this->energy();
    brought_ = brought();
    kinetic_before_ = kinetic_;
    return energy + brought_;
  }
  /// Energy errors are relative to this: the largest kinetic energy so far, and the work of loads  [J].
  L energy_scale(const L& /*due*/) const { return max(max(kinetic_before_, kinetic_), 0.5 * fastest_) + abs(brought_); }

  /// R and d ln R/dt, as Pace.
  void tempo(L& pace, L& quickening) const {
    const TempoOf<L> found = Base::tempo();
    pace = found.pace;
    quickening = found.quickening;
  }

  /// The longest step in which stages integrate the sines on inputs to a tolerance  [s].
  L longest_step(double tolerance) const {
    return L(SineTurn(S, 2 * S).within(tolerance)) / dynamics_.fastest_drives();
  }

  // --- A step ---

  /// Predicts the stages of a step of `h` from `time`, `ratio` times as long as the one that it is predicted from.
  void prepare(const L& time, const L& h, const L& ratio, const StagePrediction<L>& from) {
    columns_.prepare(h);
    for (int j = 0; j < S; ++j) (time + columns_.hc(j)).store(Base::call(j, 4));
    Base::predict(time, ratio, from);
    if constexpr (has_tangent) {
      if (any(from.cold)) Base::find_rates(time_);
      tangent_.prepare(from, time_, Base::room(0), Base::room(2));
    }
    find_scale();
  }

  /// One fixed-point iteration for the members that are `active`. Returns the square of what changed; compare with
  /// scale().
  PENDULA_IN_REGISTERS [[gnu::noinline]] L iterate(const Mask& active) {
    find_stages();
    L change(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L& weight = masses_.inertia(k);
      change = fma(weight, replace(2, k, active), change);
      change = fma(columns_.h() * columns_.h() / weight, replace(3, k, active), change);
    }
    return change;
  }
  const L& scale() const { return scale_; }  ///< size of the step, squared

  /// Places the stages of the motion where the iteration of each member ended, however long those of others took.
  /// Returns the scale of changes of tangents, squared.
  const L& start_tangents() requires with_tangent {
    find_stages();
    return tangent_.scale();
  }
  /// One fixed-point iteration of the tangents at these stages.
  L iterate_tangent(const Mask& active) requires with_tangent {
    return tangent_.iterate(active,
                            [this](int j, int which) { return Base::call(j, which == 0 ? 4 : 2 * (which - 1)); });
  }

  /// Evaluates the solved stages; the state stays as it is. Call before `turn`, `pace_squared`, `decay` and `accept`.
  void finish() {
    Base::keep_stages();
    Base::find_speeds();
    turn_ = L(0.0);
    Base::for_each_turn([&](std::size_t, const L& turn) { turn_ = max(turn_, turn); });
    if constexpr (has_tangent) tangent_.finish();
  }

  /// The largest turn of any angle in the step, squared  [rad²]. The turn of an angle with almost no inertia is
  /// doubled; with none it is infinite.
  L turn() const {
    const L infinite(std::numeric_limits<double>::infinity());
    return select(masses_.is_singular(), infinite, turn_ * turn_);
  }
  /// With larger turns the solution of the stage equations may not be the motion  [rad]. `chosen`: steps are adaptive.
  double largest_turn(bool chosen) const { return detail::largest_turn_of(chosen || dynamics_.constant_masses()); }

  /// R in the middle of the step, squared, times h².
  L pace_squared() const { return (columns_.h() * columns_.h()) * pace_squared_; }

  /// The coefficient of the Legendre polynomial P_n in the rates, times h, relative to the size of the motion, squared;
  /// 0 where it may be rounding of coordinates. With a share of that of the tangent.
  L decay(int n) const {
    const L fastest = Base::fastest();
    L squared(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L a = columns_.legendre(n, pasts_[k][newest_]);
      squared = fma(masses_.inertia(k) * a, a, squared);
    }
    const L shown = seen(squared, fastest);
    if constexpr (has_tangent) return fma(L(tangent_share * tangent_share), tangent_.decay(n), shown);
    return shown;
  }

  /// By how much the polynomial through the rates misses those at the start of the step, times h, relative to the size
  /// of the motion, squared; 0 where it may be rounding of coordinates.
  L missed_at_start() const {
    Base::find_rates(time_);
    const L fastest = Base::fastest();
    L squared(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L missed = columns_.at_start(pasts_[k][newest_]) - columns_.h() * Base::rate(k);
      squared = fma(masses_.inertia(k) * missed, missed, squared);
    }
    return seen(squared, fastest);
  }

  /// The relative error of the energy at the end of the step, if lengths are among the coordinates: motion may then be
  /// singular between the stages. Otherwise 0.
  L imbalance() const { return may_miss_ ? Base::imbalance(brought()) : L(0.0); }

  /// Coordinates and rates of the members whose step was accepted, when `share` of it was done, by the polynomial
  /// through its stages; visit(i, q_i, q̇_i).
  template <class Visit>
  void for_each_at(double share, Visit visit) {
    const typename Columns::Shares& weights = columns_.shares(share);
    const L inverse_h = L(1.0) / columns_.h();
    for (int i = 0; i < count(); ++i) {
      const auto& advance = pasts_[static_cast<std::size_t>(i)][newest_];
      L ahead(0.0), rate(0.0);
      for (int j = 0; j < S; ++j) {
        const auto at = static_cast<std::size_t>(j);
        ahead = fma(L(weights.ahead[at]), advance[j], ahead);
        rate = fma(L(weights.values[at]), advance[j], rate);
      }
      visit(i, Vector{along(i)[0] - ahead}, Vector{rate * inverse_h});
    }
  }

  /// save() keeps the states of all members. restore(which) puts these members back to them.
  void save() {
    Base::keep(saved_);
    if constexpr (has_tangent) tangent_.save();
  }
  void restore(const Mask& which) {
    Base::go_to(saved_, which);
    if constexpr (has_tangent) tangent_.restore(which);
    Base::read_masses();
  }

  /// Moves the members that are `accepted` to the end of the step; the others stay where they are.
  void accept(const Mask& accepted) {
    Base::move(accepted);
    if (!dynamics_.constant_masses()) Base::read_masses();
    if constexpr (has_tangent) tangent_.accept(accepted);
  }

  /// StageTangents::take_growth.
  L take_growth(const Mask& which) requires with_tangent { return tangent_.take_growth(which); }

 private:
  using Base::columns_, Base::count_, Base::dynamics_, Base::fastest_, Base::masses_, Base::newest_, Base::pace_,
      Base::pace_squared_, Base::pasts_, Base::size_squared_, Base::time_, Base::U_;

  struct NoTangent {
    NoTangent(MemberSystems<L>& /*dynamics*/, const Columns& /*columns*/) {}
  };

  // A squared increment relative to the size of the motion; 0 if it may be rounding of coordinates.
  L seen(const L& squared, const L& fastest) const {
    constexpr double visible = StepShape::visible;
    const L share = squared * (pace_squared_ / fastest);
    return select((squared > L(visible * visible) * size_squared_) & (fastest > L(0.0)), share, L(0.0));
  }

  void find_scale() {
    L step(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L& weight = masses_.inertia(k);
      const L push_weight = columns_.h() * columns_.h() / weight;
      for (int j = 0; j < S; ++j) {
        const L &moved = U_[k][j], &pushed = U_[count_ + k][j];
        step = fma(weight * moved, moved, step);
        step = fma(push_weight * pushed, pushed, step);
      }
    }
    scale_ = max(step, L(Base::invisible * Base::invisible) * size_squared_);
  }

  [[gnu::always_inline]] void find_stages() {
    for (std::size_t k = 0; k < count_; ++k) {
      Base::place_stages(k, 0);
      Base::place_stages(k, 1);
    }
    for (int j = 0; j < S; ++j) {
      dynamics_.call(Base::call(j, 4), &SystemFunctions::hamiltonian_form, Base::call(j, 0), Base::call(j, 1),
                     Base::call(j, 2), Base::call(j, 3));
    }
  }

  // Replaces the increments of coordinate k, or of its momentum, by those found at the stages. Returns the square of
  // what changed.
  [[gnu::always_inline]] L replace(int which, std::size_t k, const Mask& active) {
    auto& increments = U_[which == 2 ? k : count_ + k];
    L changed(0.0);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
      const L found = columns_.hb(j) * L::load(Base::call(j, which, k)), change = found - increments[j];
      changed = fma(change, change, changed);
      increments.set(j, select(active, found, increments[j]));
    });
    return changed;
  }

  // The work of loads in the solved step  [J].
  L brought() const { return any(loaded()) ? select(loaded(), Base::work(), L(0.0)) : L(0.0); }

  typename Base::FullState saved_;
  bool may_miss_ = false;  // lengths are among the coordinates
  L loaded_{0.0};
  L scale_{0.0}, turn_{0.0};
  L energy_sum_{0.0}, kinetic_{0.0}, kinetic_before_{0.0}, brought_{0.0};
  [[no_unique_address]] std::conditional_t<with_tangent, StageTangents<S, L>, NoTangent> tangent_;
};

}  // namespace pendula
