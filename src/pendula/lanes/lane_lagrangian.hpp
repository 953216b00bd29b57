#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/lanes/lane_columns.hpp>
#include <pendula/lanes/lane_dynamics.hpp>
#include <pendula/lanes/lane_inertia.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/lanes/lane_part.hpp>
#include <pendula/lanes/lane_stage_tangent.hpp>
#include <pendula/lanes/lane_tangent.hpp>
#include <pendula/lanes/lane_turned.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/forcing_look.hpp>
#include <type_traits>
#include <vector>

namespace pendula {

/// Systems of one kernel, one in each lane, and the stages of a Gauss step of theirs in momentum form: equations,
/// rounding, and what is compared with what are those of LagrangianStages, the layout is not. All stages of one number
/// are S packs. With a tangent of each member (LaneStageTangent), whose stages are solved after the motion's.
template <int S, class Register = MemberRegister, bool with_tangent = false>
class LaneLagrangian {
 public:
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using SpaceType = CoordinateSpace;
  using Subject = LaneDynamics<L>&;
  static constexpr int stages = S, links_known = Eigen::Dynamic;
  static constexpr bool has_tangent = with_tangent;
  static constexpr int sequences = 2;         ///< of corrections of its fixed point, as LagrangianSolver's
  static constexpr int most_iterations = 25;  ///< of a step whose size is chosen
  static constexpr std::size_t D = 1;
  using Vector = std::array<L, D>;
  using Columns = LaneColumns<S, L>;
  using Stages = typename Columns::Stages;

  /// `dynamics` must outlive it.
  explicit LaneLagrangian(LaneDynamics<L>& dynamics)
      : dynamics_(dynamics),
        count_(dynamics.coordinates()),
        coordinates_(static_cast<std::size_t>(count_)),
        inertia_(dynamics),
        calls_(static_cast<std::size_t>(S * per_call())),
        state_(3 * coordinates_.size() + 4),
        tangent_(dynamics, columns_) {
    for (int k = 0; k < links(); ++k) {
      Coordinate& coordinate = at(k);
      coordinate.is_angle = dynamics.is_angle(k);
      coordinate.is_periodic = dynamics.is_periodic(k);
      may_miss_ = may_miss_ || !coordinate.is_angle;
    }
  }
  LaneLagrangian(const LaneLagrangian&) = delete;
  LaneLagrangian& operator=(const LaneLagrangian&) = delete;

  /// Coordinates.
  int links() const { return count_; }

  // --- One member ---

  /// A member comes into a lane, with its numbers, at q and v at `time`; its next step starts cold.
  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v) {
    dynamics_.take(lane, system);
    std::vector<double> p(coordinates_.size()), pivots(coordinates_.size());
    const LaneStart start = dynamics_.start(system, time, q, v, p.data(), pivots.data());
    now_.set(lane, time);
    slowest_squared_.set(lane, start.slowest_squared);
    natural_speed_squared_.set(lane, start.natural_speed_squared);
    loaded_.set(lane, start.loaded ? 1 : 0);
    fastest_.set(lane, 0);
    for (int k = 0; k < links(); ++k) {
      at(k).q.set(lane, q[k], at(k).is_periodic);
      at(k).p.value.set(lane, p[static_cast<std::size_t>(k)]);
      at(k).p.low.set(lane, 0);
      inertia_.start(lane, k, pivots[static_cast<std::size_t>(k)]);
    }
    read_inertia();
    if constexpr (has_tangent) tangent_.start(lane, time, q, v);
  }

  // --- All members ---

  /// Coordinate i, with all turns that were made.
  Vector along(int i) const { return {at(i).q.with_turns()}; }

  /// visit(i, q̇_i, …) of all coordinates.
  template <class Visit>
  void for_each_rate(Visit visit) {
    find_rates();
    for (int i = 0; i < links(); ++i) visit(i, Vector{L::load(state(1, i))}, L(0.0));
  }

  /// Whether fixed points may ask for shorter steps than errors do: forces and lengths may be anything.
  Mask may_be_stiff() const { return L(0.0) == L(0.0); }
  /// Whether energy may come from outside, or go there.
  Mask loaded() const { return loaded_ > L(0.0); }

  /// T + U  [J].
  L energy() {
    find_rates();
    const Energies found = energies();
    energy_sum_ = found.size();
    kinetic_ = found.kinetic;
    return found.total;
  }
  /// |T| + |U| where the energy was asked for last  [J].
  const L& energy_sum() const { return energy_sum_; }

  /// What the energy at the end of the step that was solved is to be, by what loads bring  [J].
  L energy_due() {
    const L energy = this->energy();
    brought_ = work();
    kinetic_before_ = kinetic_;
    return energy + brought_;
  }
  /// What energies are compared to: the kinetic one, the largest that there was  [J].
  L energy_scale(const L& /*due*/) const { return max(max(kinetic_before_, kinetic_), 0.5 * fastest_) + abs(brought_); }

  /// R and d ln R/dt, as Pace.
  void tempo(L& pace, L& quickening) {
    find_rates();
    dynamics_.accelerations(state(3), state(0), state(1), state(2));
    L sum(0.0), growth(0.0);
    for (int k = 0; k < links(); ++k) {
      if (!at(k).is_angle) continue;
      const L v = L::load(state(1, k)), squared = v * v, sixth = squared * squared * squared;
      sum = fma(sixth, squared, sum);
      growth = fma(sixth * v, L::load(state(2, k)), growth);
    }
    const L root = sqrt(sqrt(sum)), squared = slowest_squared_ + root;
    pace = sqrt(squared);
    quickening = select(sum > L(0.0), growth / (root * root * root * squared), L(0.0));
  }

  /// The longest step in which stages sum up what inputs are driven by, to a tolerance.
  L longest_step(double tolerance) const {
    return L(SineTurn(S, 2 * S).within(tolerance)) / dynamics_.fastest_drives();
  }

  // --- A step ---

  /// Predicts the stages of a step of `h` from `time`, `ratio` times as long as the one that they are known from.
  void prepare(const L& time, const L& h, const L& ratio, const StagePrediction<L>& from) {
    columns_.prepare(h);
    columns_.predict_at(select(from.again, L(0.0), L(1.0)), ratio, from.depth);
    now_ = time;
    for (int j = 0; j < S; ++j) (time + columns_.hc(j)).store(call(j, 4));
    for (Coordinate& coordinate : coordinates_) {
      predict(coordinate, &Past::moved, coordinate.moved);
      predict(coordinate, &Past::pushed, coordinate.pushed);
    }
    if (xsimd::any(from.cold)) start_cold(from.cold);
    if constexpr (has_tangent) tangent_.prepare(from, state(3), state(0), state(1));
    find_scale();
  }

  /// One fixed-point iteration for the members that are `active`, those of the others stay; what changed, squared,
  /// relative to the size of the step.
  PENDULA_IN_REGISTERS [[gnu::noinline]] L iterate(const Mask& active) {
    find_stages();
    L change(0.0);
    for (int k = 0; k < links(); ++k) {
      const L weight = inertia_.weight_squared(k);
      change = fma(weight, replace(2, k, active, at(k).moved), change);
      change = fma(columns_.h() * columns_.h() / weight, replace(3, k, active, at(k).pushed), change);
    }
    return change;
  }
  const L& scale() const { return scale_; }  ///< size of the step, squared

  /// Goes to the stages of the motion that was solved, each member's to its own, however long those of others took.
  /// Gives what changes of tangents are compared with, squared.
  const L& start_tangents() requires with_tangent {
    find_stages();
    return tangent_.scale();
  }
  /// The same iteration of the tangents there.
  L iterate_tangent(const Mask& active) requires with_tangent {
    return tangent_.iterate(active, [this](int j, int which) { return call(j, which == 0 ? 4 : 2 * (which - 1)); });
  }

  /// Sums up what the stages add to the state, which stays; after it `turn`, `pace_squared`, `decay` and `accept`.
  void finish() {
    newest_ = (newest_ + pasts - 1) % pasts;
    turn_ = L(0.0);
    Stages speeds;
    speeds.fill(L(0.0));
    L eighth_powers(0.0);
    const L inverse_h = L(1.0) / columns_.h();
    for (int k = 0; k < links(); ++k) {
      Coordinate& coordinate = at(k);
      Past& past = coordinate.past[newest_];
      L turn(0.0);
      detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
        past.moved[j] = L(columns_.inverse_b(j)) * coordinate.moved[j];
        past.pushed[j] = L(columns_.inverse_b(j)) * coordinate.pushed[j];
        const L v = inverse_h * past.moved[j];
        speeds[j] = fma(inertia_.weight_squared(k) * v, v, speeds[j]);
        turn = turn + abs(coordinate.moved[j]);
      });
      coordinate.moved_by = Columns::total(coordinate.moved);
      coordinate.pushed_by = Columns::total(coordinate.pushed);
      if (!coordinate.is_angle) continue;
      const L v = inverse_h * past.moved[S / 2], squared = v * v, fourth = squared * squared;
      eighth_powers = fma(fourth, fourth, eighth_powers);
      turn_ = max(turn_, turn * inertia_.turns_by(k));
    }
    fastest_here_ = speeds[0];
    for (const L& speed : speeds) fastest_here_ = max(fastest_here_, speed);
    pace_squared_ = slowest_squared_ + sqrt(sqrt(eighth_powers));
    if constexpr (has_tangent) tangent_.finish();
  }

  /// The most that an angle turns in the step, squared; twice as far where its inertia nearly vanishes  [rad²]. A
  /// member whose inertia has vanished turns beyond all bounds.
  L turn() const {
    const L infinite(std::numeric_limits<double>::infinity());
    return select(inertia_.singular(), infinite, turn_ * turn_);
  }
  /// From where on stages are no motion: where inertia may vanish, coordinates may move faster than all else  [rad].
  double largest_turn(bool chosen) const { return chosen || dynamics_.constant_masses() ? 3 : 0.25; }

  /// R in the middle of the step, squared, times h².
  L pace_squared() const { return (columns_.h() * columns_.h()) * pace_squared_; }

  /// The coefficient of the Legendre polynomial P_n in the rates, times h, relative to the size of the motion, squared;
  /// 0 where it may be what coordinates are rounded by. With a share of the tangent's.
  L decay(int n) const {
    const L fastest = max(max(fastest_, fastest_here_), natural_speed_squared_);
    L squared(0.0);
    for (int k = 0; k < links(); ++k) {
      const L a = columns_.legendre(n, at(k).past[newest_].moved);
      squared = fma(inertia_.weight_squared(k) * a, a, squared);
    }
    const L share = squared * (pace_squared_ / fastest);
    constexpr double visible = StepShape::visible;
    const L seen = select((squared > L(visible * visible) * size_squared_) & (fastest > L(0.0)), share, L(0.0));
    if constexpr (has_tangent) return fma(L(tangent_share * tangent_share), tangent_.decay(n), seen);
    return seen;
  }

  /// Energy that is missing at the end of the step or too much, relative to what there is, where lengths are among the
  /// coordinates: motion may then be singular beside the stages. 0 of others.
  L imbalance() {
    if (!may_miss_) return L(0.0);
    find_rates();
    const Energies before = energies();
    const L brought = work();
    write_state([](const Coordinate& k) { return (k.q.low + k.moved_by) + k.q.value; },
                [](const Coordinate& k) { return (k.p.low + k.pushed_by) + k.p.value; }, now_ + columns_.h());
    const Energies after = energies();
    const L scale = max(max(before.size(), after.size()), natural_speed_squared_) + abs(brought);
    return select(scale > L(0.0), abs(after.total - before.total - brought) / scale, L(0.0));
  }

  /// Coordinates and rates of the members whose step was accepted, when `share` of it was done, by the polynomial
  /// through its stages; visit(i, q_i, q̇_i).
  template <class Visit>
  void for_each_glance(double share, Visit visit) {
    const typename Columns::Shares& weights = columns_.shares(share);
    const L inverse_h = L(1.0) / columns_.h();
    for (int i = 0; i < links(); ++i) {
      const Stages& advance = at(i).past[newest_].moved;
      L ahead(0.0), rate(0.0);
      for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
        ahead = fma(L(weights.ahead[j]), advance[j], ahead);
        rate = fma(L(weights.values[j]), advance[j], rate);
      }
      visit(i, Vector{along(i)[0] - ahead}, Vector{rate * inverse_h});
    }
  }

  /// Keeps where the members are, and goes back there.
  void save() {
    for (Coordinate& coordinate : coordinates_) coordinate.saved = {coordinate.q, coordinate.p};
    saved_time_ = now_;
    saved_fastest_ = fastest_;
    if constexpr (has_tangent) tangent_.save();
  }
  void restore(const Mask& which) {
    for (Coordinate& coordinate : coordinates_) {
      coordinate.q.assign(which, coordinate.saved.q);
      assign(which, coordinate.saved.p, coordinate.p);
    }
    now_ = select(which, saved_time_, now_);
    fastest_ = select(which, saved_fastest_, fastest_);
    if constexpr (has_tangent) tangent_.restore(which);
    read_inertia();
  }

  /// Moves the members that are `accepted` to the end of the step; the others stay where they are.
  void accept(const Mask& accepted) {
    for (Coordinate& coordinate : coordinates_) {
      coordinate.q.move(accepted, coordinate.moved_by, coordinate.is_periodic);
      assign(accepted, detail::added(coordinate.p, coordinate.pushed_by), coordinate.p);
    }
    now_ = select(accepted, now_ + columns_.h(), now_);
    fastest_ = select(accepted, max(fastest_, fastest_here_), fastest_);
    if (!dynamics_.constant_masses()) read_inertia();
    if constexpr (has_tangent) tangent_.accept(accepted);
  }

  /// LaneStageTangent::take_growth.
  L take_growth(const Mask& which) requires with_tangent { return tangent_.take_growth(which); }

 private:
  static constexpr int depth = Columns::most_depth;
  static constexpr std::size_t pasts = static_cast<std::size_t>(depth);
  static constexpr double invisible = 1e-9;  // LagrangianStages's

  struct NoTangent {
    NoTangent(LaneDynamics<L>& /*dynamics*/, const Columns& /*columns*/) {}
  };

  // What steps are predicted from: h q̇ and h ṗ.
  struct Past {
    Stages moved{}, pushed{};
  };
  struct State {
    LaneTurned<L> q;
    Twofold<L> p{L(0.0), L(0.0)};
  };
  struct Coordinate {
    bool is_angle = false, is_periodic = false;
    LaneTurned<L> q;
    Twofold<L> p{L(0.0), L(0.0)};
    State saved;
    Stages moved{}, pushed{};         // h b q̇, h b ṗ
    std::array<Past, pasts> past{};   // newest_ is the last step's
    L moved_by{0.0}, pushed_by{0.0};  // in the step
  };
  struct Energies {
    L kinetic, total;
    L size() const { return abs(kinetic) + abs(total - kinetic); }
  };

  Coordinate& at(int k) { return coordinates_[static_cast<std::size_t>(k)]; }
  const Coordinate& at(int k) const { return coordinates_[static_cast<std::size_t>(k)]; }

  static void assign(const Mask& which, const Twofold<L>& from, Twofold<L>& to) {
    to.value = select(which, from.value, to.value);
    to.low = select(which, from.low, to.low);
  }

  // --- Numbers as they cross ---

  // Of each stage: q, p, v, f of all coordinates, and the time.
  int per_call() const { return 4 * links() + 1; }
  double* call(int j, int which, int k = 0) { return calls_[j * per_call() + which * links() + k]; }

  // Of the state: q, v, and p or what nobody asks for, of all coordinates; the time, two energies, and a power.
  double* state(int which, int k = 0) { return state_[which * links() + k]; }

  // Writes a state with its rates.
  template <class Place, class Momentum>
  void write_state(Place q, Momentum p, const L& time) {
    time.store(state(3));
    for (int k = 0; k < links(); ++k) {
      q(at(k)).store(state(0, k));
      p(at(k)).store(state(2, k));
    }
    // Forces go where nobody reads them.
    dynamics_.hamiltonian_form(state(3), state(0), state(2), state(1), call(0, 3));
  }
  void find_rates() {
    write_state([](const Coordinate& k) { return k.q.value; }, [](const Coordinate& k) { return k.p.value; }, now_);
  }

  // Of the state that was written.
  Energies energies() {
    dynamics_.energies(state(3), state(0), state(1), state(3, 1), state(3, 2));
    return {L::load(state(3, 1)), L::load(state(3, 2))};
  }

  void read_inertia() {
    for (int k = 0; k < links(); ++k) at(k).q.value.store(state(0, k));
    now_.store(state(3));
    inertia_.read(state(3), state(0));
  }

  // --- The step ---

  void predict(Coordinate& coordinate, Stages Past::*of, Stages& increments) {
    typename Columns::History history;
    for (std::size_t d = 0; d < pasts; ++d) history[d] = &(coordinate.past[(newest_ + d) % pasts].*of);
    Stages advance;
    columns_.extrapolate(history, advance, true);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { increments[j] = L(columns_.b(j)) * advance[j]; });
  }

  // Motion that goes on as at the start of the step. What a member was predicted from is not weighed any more; but zero
  // times what is not finite would not be zero.
  void start_cold(const Mask& cold) {
    find_rates();
    for (int k = 0; k < links(); ++k) {
      Coordinate& coordinate = at(k);
      const L v = L::load(state(1, k)), f = L::load(call(0, 3, k));
      for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
        const L& hb = columns_.hb(static_cast<int>(j));
        coordinate.moved[j] = select(cold, hb * v, coordinate.moved[j]);
        coordinate.pushed[j] = select(cold, hb * f, coordinate.pushed[j]);
      }
      for (Past& past : coordinate.past) {
        for (L& x : past.moved) x = select(cold, L(0.0), x);
        for (L& x : past.pushed) x = select(cold, L(0.0), x);
      }
    }
  }

  // Nothing is compared with less than would show in the coordinates.
  void find_scale() {
    L step(0.0);
    size_squared_ = L(0.0);
    for (int k = 0; k < links(); ++k) {
      const Coordinate& coordinate = at(k);
      const L weight = inertia_.weight_squared(k), push_weight = columns_.h() * columns_.h() / weight;
      for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
        step = fma(weight * coordinate.moved[j], coordinate.moved[j], step);
        step = fma(push_weight * coordinate.pushed[j], coordinate.pushed[j], step);
      }
      const L size = max(abs(coordinate.q.value), L(coordinate.is_angle ? 1.0 : 0.0));
      size_squared_ = max(size_squared_, weight * (size * size));
    }
    scale_ = max(step, L(invisible * invisible) * size_squared_);
  }

  [[gnu::always_inline]] void find_stages() {
    for (int k = 0; k < links(); ++k) place_stages(k);
    for (int j = 0; j < S; ++j) {
      dynamics_.hamiltonian_form(call(j, 4), call(j, 0), call(j, 1), call(j, 2), call(j, 3));
    }
  }

  [[gnu::always_inline]] void place_stages(int k) {
    const Coordinate& coordinate = at(k);
    Stages added;
    columns_.integrate(coordinate.moved, coordinate.q.low, added);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { (coordinate.q.value + added[j]).store(call(j, 0, k)); });
    columns_.integrate(coordinate.pushed, coordinate.p.low, added);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT { (coordinate.p.value + added[j]).store(call(j, 1, k)); });
  }

  // Increments of coordinate k by what was found at the stages; what changed, squared.
  [[gnu::always_inline]] L replace(int which, int k, const Mask& active, Stages& increments) {
    L changed(0.0);
    detail::unrolled<S>([&](auto j) PENDULA_WRITTEN_OUT {
      const L found = columns_.hb(j) * L::load(call(j, which, k)), change = found - increments[j];
      changed = fma(change, change, changed);
      increments[j] = select(active, found, increments[j]);
    });
    return changed;
  }

  // What loads bring in the step that was solved  [J].
  L work() {
    if (!xsimd::any(loaded())) return L(0.0);
    L work(0.0);
    const L inverse_h = L(1.0) / columns_.h();
    for (int k = 0; k < links(); ++k) place_stages(k);
    for (int j = 0; j < S; ++j) {
      for (int k = 0; k < links(); ++k) {
        const L rate = (inverse_h * L(columns_.inverse_b(j))) * at(k).moved[static_cast<std::size_t>(j)];
        rate.store(call(j, 2, k));
      }
      dynamics_.powers(call(j, 4), call(j, 0), call(j, 2), state(3, 3));
      work = fma(columns_.hb(j), L::load(state(3, 3)), work);
    }
    return select(loaded(), work, L(0.0));
  }

  LaneDynamics<L>& dynamics_;
  int count_;
  std::vector<Coordinate> coordinates_;
  LaneInertia<L> inertia_;
  PackRows<L::width> calls_, state_;
  Columns columns_;
  bool may_miss_ = false;  // lengths are among the coordinates
  std::size_t newest_ = 0;
  L now_{0.0}, saved_time_{0.0};
  L slowest_squared_{1.0}, natural_speed_squared_{0.0}, loaded_{0.0};
  // Σ M_kk v_k², of all steps so far and of the stages.
  L fastest_{0.0}, fastest_here_{0.0}, saved_fastest_{0.0};
  L scale_{0.0}, size_squared_{0.0}, turn_{0.0}, pace_squared_{1.0};
  L energy_sum_{0.0}, kinetic_{0.0}, kinetic_before_{0.0}, brought_{0.0};
  [[no_unique_address]] std::conditional_t<with_tangent, LaneStageTangent<S, L>, NoTangent> tangent_;
};

}  // namespace pendula
