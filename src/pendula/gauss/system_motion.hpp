#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <pendula/gauss/pace.hpp>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/full_turns.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/numeric/written_out.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <type_traits>
#include <vector>

namespace pendula {

/// Coordinates, momenta and stages of any system that moves by Gauss steps, q̇ = v(q, p), ṗ = f(q, v) (MomentumForm; in
/// VelocityForm rates have the place of momenta). What one motion (StagesInLanes) and several members (MembersInLanes)
/// share. `DynamicsType` calls the functions of the system: here(time, function, numbers…) at the state, and
/// call(times, function, numbers…) at stages.
///
/// Stages are held as increments, h b v of a coordinate and h b f of its momentum; the state is compensated, with what
/// it has lost to rounding:
///   Q = q + m U_q,  P = p + m U_p,  m_ij = a_ij / b_j.
///
/// Coordinates may have any units. Their changes are compared as √M_kk dq_k, those of momenta as dp_k / √M_kk.
template <class LayoutType, class DynamicsType, class Form>
class SystemMotion {
 public:
  using Layout = LayoutType;
  using Num = typename Layout::Num;
  using Mask = MaskOf<Num>;
  using Columns = typename Layout::Columns;
  using Cell = typename Layout::Cell;
  using Row = typename Layout::Row;
  using Dynamics = std::remove_reference_t<DynamicsType>;

  /// If DynamicsType is a reference, its object must outlive this one.
  SystemMotion(DynamicsType dynamics, Family family, int stages)
      : dynamics_(static_cast<DynamicsType&&>(dynamics)),
        columns_(family, stages),
        count_(info().coordinates.size()),
        U_(2 * count_),
        pasts_(2 * count_),
        state_(2 * count_, {Num(0.0), Num(0.0)}),
        turns_(count_, Num(0.0)),
        masses_(info()),
        pace_(info()),
        calls_(static_cast<std::size_t>(Layout::cells) * per_call()),
        room_(4 * count_ + 3) {}

  const SystemInfo& info() const { return dynamics_.info(); }
  const Columns& columns() const { return columns_; }
  /// Number of coordinates.
  std::size_t count() const { return count_; }

  // --- The state ---

  /// Coordinate k, with all turns that were made.
  Num coordinate(std::size_t k) const { return detail::with_turns(state_[k], turns_[k]); }

  /// R and d ln R/dt.
  TempoOf<Num> tempo() const {
    find_rates(time_);
    dynamics_.here(time_, &SystemFunctions::acceleration, room(0), room(2), room(3));
    return pace_.at(room(2), room(3));
  }

  /// The state, to come back to.
  struct FullState {
    std::vector<Compensated<Num>> state;
    std::vector<Num> turns;
    Num time, fastest;
  };
  FullState place() const { return {state_, turns_, time_, fastest_}; }
  void keep(FullState& place) const {
    place.state = state_;
    place.turns = turns_;
    place.time = time_;
    place.fastest = fastest_;
  }
  void go_to(const FullState& place, const Mask& which) {
    for (std::size_t k = 0; k < 2 * count_; ++k) assign(which, place.state[k], state_[k]);
    for (std::size_t k = 0; k < count_; ++k) turns_[k] = select(which, place.turns[k], turns_[k]);
    time_ = select(which, place.time, time_);
    fastest_ = select(which, place.fastest, fastest_);
  }

  // --- The step that was solved ---

  /// Energy that forces, and terms that depend on time, bring  [J].
  Num work() const {
    typename Layout::Sum work(Num(0.0));
    const auto inverse_h = Layout::spread(Num(Num(1.0) / columns_.h()));
    for (std::size_t k = 0; k < count_; ++k) {
      place_stages(k, 0);
      each_cell([&](auto j) { ((inverse_h * columns_.inverse_weight(j)) * U_[k][j]).store(call(j, 2, k)); });
    }
    each_cell([&](auto j) {
      dynamics_.call(call(j, 4), &SystemFunctions::power, call(j, 0), call(j, 2), call(j, 3));
      work = fma(columns_.at_hand().hb(j), Cell::load(call(j, 3)), work);
    });
    return Layout::total(work);
  }

  /// The size of the energy error of the step, `brought` being the work of loads; relative to kinetic and potential
  /// energy, or to the energy that motion from rest comes to where that is larger.
  Num imbalance(const Num& brought, std::span<const double> pushes = {}) const {
    const Balance of = balance(brought, pushes);
    const Num scale = max(max(of.start.size(), of.finish.size()), pace_.natural_speed_squared()) + abs(brought);
    return select(scale > Num(0.0), abs(of.missing()) / scale, Num(0.0));
  }

 protected:
  static constexpr double invisible = 1e-9;  // of coordinates: corrections are not compared with smaller changes
  static constexpr auto pasts = static_cast<std::size_t>(Columns::most_depth);

  struct Energies {
    Num kinetic, total;
    Num size() const { return abs(kinetic) + abs(total - kinetic); }
  };
  // Energies over the step.
  struct Balance {
    Num brought;
    Energies start, finish;
    Num missing() const { return (finish.total - start.total) - brought; }
  };
  template <class Body>
  [[gnu::always_inline]] static void each_cell(Body body) {
    detail::unrolled<Layout::cells>(body);
  }

  // --- The state ---

  // Sets a coordinate and its momentum, of a member.
  void start(int member, std::size_t k, double q, double p) {
    Compensated<double> angle{q, 0};
    double whole = 0;
    if (info().is_periodic[k]) detail::take_out_turns(angle, whole, true);
    set(state_[k].value, member, angle.value);
    set(state_[k].compensation, member, angle.compensation);
    set(turns_[k], member, whole);
    set(state_[count_ + k].value, member, p);
    set(state_[count_ + k].compensation, member, 0);
  }

  static void assign(const Mask& which, const Compensated<Num>& from, Compensated<Num>& to) {
    to.value = select(which, from.value, to.value);
    to.compensation = select(which, from.compensation, to.compensation);
  }

  /// Moves those that are `accepted` to the end of the step.
  void move(const Mask& accepted) {
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      Compensated<Num> there = state_[k];
      there.add(Columns::total(U_[k]));
      assign(accepted, there, state_[k]);
    }
    for (std::size_t k = 0; k < count_; ++k) {
      if (info().is_periodic[k]) detail::take_out_turns(state_[k], turns_[k], accepted);
    }
    time_ = select(accepted, time_ + columns_.h(), time_);
    fastest_ = select(accepted, max(fastest_, fastest_here_), fastest_);
  }

  void read_masses() {
    for (std::size_t k = 0; k < count_; ++k) to_row(state_[k].value, room(0, k));
    dynamics_.here(time_, &SystemFunctions::mass_matrix, room(0), masses_.numbers());
    masses_.see();
  }

  // Workspace: four numbers of each coordinate, of one state; then three numbers.
  double* room(std::size_t which, std::size_t k = 0) const { return room_[which * count_ + k]; }

  // Writes q to room(0) and p to room(1). find_rates adds v, room(2).
  void write_state() const {
    for (std::size_t k = 0; k < 2 * count_; ++k) to_row(state_[k].value, room(0, k));
  }
  void find_rates(const Num& time) const {
    write_state();
    rates_of_room(time);
  }
  void rates_of_room(const Num& time) const {
    Form::rates(at(time), count_ * width_of<Num>, room(0), room(1), room(2));
  }
  // Calls functions of the system at the state.
  auto at(const Num& time) const {
    return [this, &time](auto function, auto... numbers) { dynamics_.here(time, function, numbers...); };
  }
  Num rate(std::size_t k) const { return from_row<Num>(room(2, k)); }

  // Energies of the state in room(0) and room(2).
  Energies energies(const Num& time) const {
    dynamics_.here(time, &SystemFunctions::energies, room(0), room(2), room(4), room(4, 1));
    return {from_row<Num>(room(4)), from_row<Num>(room(4, 1))};
  }

  // `pushes` come to momenta besides increments; there may be none.
  Balance balance(const Num& brought, std::span<const double> pushes = {}) const {
    find_rates(time_);
    const Energies start = energies(time_);
    find_end(pushes);
    return {brought, start, energies(time_ + columns_.h())};
  }

  // Writes the end of the solved step to the room, as find_rates does its start.
  void find_end(std::span<const double> pushes) const {
    const auto end = [&](std::size_t k) { return (state_[k].compensation + Columns::total(U_[k])) + state_[k].value; };
    for (std::size_t k = 0; k < 2 * count_; ++k) to_row(Num(end(k)), room(0, k));
    for (std::size_t k = 0; k < pushes.size(); ++k) to_row(from_row<Num>(room(1, k)) + Num(pushes[k]), room(1, k));
    rates_of_room(time_ + columns_.h());
  }

  // --- A step ---

  /// Predicts the stages of a step from `time`, `ratio` times as long as the one that it is predicted from. The times
  /// of the stages must be set before.
  void predict(const Num& time, const Num& ratio, const StagePrediction<Num>& from) {
    columns_.predict_at(select(from.again, Num(0.0), Num(1.0)), ratio, from.depth);
    time_ = time;
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      typename Columns::History history;
      for (std::size_t d = 0; d < pasts; ++d) history[d] = &pasts_[k][(newest_ + d) % pasts];
      Row advance;
      columns_.extrapolate(history, advance, true);
      each_cell([&](auto j) PENDULA_WRITTEN_OUT { U_[k].set(j, columns_.weight(j) * advance[j]); });
    }
    if (any(from.cold)) start_cold(from.cold);
    find_size();
  }

  // Predicts constant rates and forces from those at the start of the step. The numbers of earlier steps are replaced,
  // too, although their weight is 0: zero times a number that is not finite is not zero.
  void start_cold(const Mask& cold) {
    const auto& columns = columns_.at_hand();
    write_state();
    Form::field(at(time_), count_ * width_of<Num>, room(0), room(1), room(2), room(3));
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      const auto slope = Layout::spread(from_row<Num>(room(2, k)));  // v, and f after it
      each_cell([&](auto j) {
        set_cell(U_[k], j, cold, columns.hb(j) * slope);
        for (Row& past : pasts_[k]) set_cell(past, j, cold, Cell(Num(0.0)));
      });
    }
  }
  static void set_cell(Row& row, int j, const Mask& which, const Cell& value) {
    if constexpr (is_batch<Num>) {
      row.set(j, select(which, value, Cell(row[j])));
    } else if (which) {
      row.set(j, value);
    }
  }

  // Finds the size of the coordinates, squared: of angles at least a radian.
  void find_size() {
    size_squared_ = Num(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const Num size = max(Num(abs(state_[k].value)), Num(info().is_angle[k] ? 1.0 : 0.0));
      size_squared_ = max(size_squared_, Num(masses_.inertia(k) * (size * size)));
    }
  }

  // Numbers of a stage, as they are called with: q, p, v, f of all coordinates, and the time.
  std::size_t per_call() const { return 4 * count_ + 1; }
  double* call(int cell, int which, std::size_t k = 0) const {
    return calls_[static_cast<std::size_t>(cell) * per_call() + static_cast<std::size_t>(which) * count_ + k];
  }

  // Computes coordinate k at the stages, or its momentum.
  [[gnu::always_inline]] void place_stages(std::size_t k, int which) const {
    const std::size_t at = static_cast<std::size_t>(which) * count_ + k;
    Row added;
    columns_.at_hand().integrate(U_[at], state_[at].compensation, added);
    each_cell([&](auto j)
                  PENDULA_WRITTEN_OUT { (Layout::spread(state_[at].value) + added[j]).store(call(j, which, k)); });
  }

  /// Keeps h v and h f at the stages, for predictions of later steps.
  void keep_stages() {
    newest_ = (newest_ + pasts - 1) % pasts;
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      Row& past = pasts_[k][newest_];
      each_cell([&](auto j) PENDULA_WRITTEN_OUT { past.set(j, columns_.inverse_weight(j) * U_[k][j]); });
    }
  }

  /// Finds the largest Σ M_kk v_k² of the stages, and R² in the middle of the step.
  void find_speeds() {
    Row speeds;
    Cell eighth_powers(Num(0.0));
    const auto inverse_h = Layout::spread(Num(Num(1.0) / columns_.h()));
    each_cell([&](auto j) {
      Cell speed(Num(0.0));
      for (std::size_t k = 0; k < count_; ++k) {
        const Cell v = (inverse_h * columns_.inverse_weight(j)) * U_[k][j], squared = v * v;
        speed = fma(Layout::spread(masses_.inertia(k)), squared, speed);
        if (j == Layout::cells / 2 && info().is_angle[k]) {
          eighth_powers = fma(squared * squared, squared * squared, eighth_powers);
        }
      }
      speeds.set(j, speed);
    });
    fastest_here_ = Num(0.0);
    each_cell([&](auto j) { fastest_here_ = max(fastest_here_, Num(Layout::largest(speeds[j], columns_.stages()))); });
    pace_squared_ = pace_.squared(Layout::of_stage(eighth_powers, columns_.stages() / 2));
  }

  /// The largest Σ M_kk v_k² of all stages so far, and at least what forces at the start give.
  Num fastest() const { return max(max(fastest_, fastest_here_), pace_.natural_speed_squared()); }

  /// Calls visit(k, turn of coordinate k in the step). The turn of an angle with almost no inertia is doubled, because
  /// its rate changes fast.
  template <class Visit>
  void for_each_turn(Visit visit) const {
    for (std::size_t k = 0; k < count_; ++k) {
      if (!info().is_angle[k]) continue;
      typename Layout::Sum turn(Num(0.0));
      each_cell([&](auto j) PENDULA_WRITTEN_OUT { turn = turn + abs(U_[k][j]); });
      const Num whole = Layout::total(turn);
      visit(k, select(masses_.is_small(k), Num(whole + whole), whole));
    }
  }

  DynamicsType dynamics_;
  Columns columns_;
  std::size_t count_;
  std::vector<Row> U_;                         // of coordinates, then of momenta
  std::vector<std::array<Row, pasts>> pasts_;  // newest_ is the last step's
  std::vector<Compensated<Num>> state_;        // coordinates, then momenta
  std::vector<Num> turns_;                     // full turns that were taken out of coordinates
  MassScale<Num> masses_;
  Pace<Num> pace_;
  std::size_t newest_ = 0;
  Num time_{0.0};
  Num fastest_{0.0}, fastest_here_{0.0};  // Σ M_kk v_k², of all steps so far and of the stages
  Num size_squared_{0.0}, pace_squared_{1.0};

 private:
  static constexpr std::size_t cell_width = sizeof(Cell) / sizeof(double);

  mutable PackRows<cell_width> calls_;
  mutable PackRows<width_of<Num>> room_;
};

}  // namespace pendula
