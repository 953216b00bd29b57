#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <pendula/gauss/stage_constraints.hpp>
#include <pendula/gauss/stage_dynamics.hpp>
#include <pendula/gauss/stage_layout.hpp>
#include <pendula/gauss/step_prediction.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/gauss/system_motion.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/increments.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// State and stages of one motion of any system (SystemMotion), as both iterations see them. All stages of one number
/// are in the lanes of a pack. `Width` is at least the number of stages, which is a run-time number: lanes beyond it
/// repeat the start of the step.
template <int Width, class Form>
class LagrangianStages : public SystemMotion<StagesInLanes<Eigen::Dynamic, double, Width>, StageDynamics<Width>, Form> {
  using Base = SystemMotion<StagesInLanes<Eigen::Dynamic, double, Width>, StageDynamics<Width>, Form>;

 public:
  using L = Pack<Width, RegisterFor<Width>>;
  using typename Base::Columns;
  using Real = double;
  using State = Motion;
  using Rows = PackRows<static_cast<std::size_t>(Width)>;
  /// One number for each lane.
  using Stored = double[static_cast<std::size_t>(Width)];

  LagrangianStages(const SystemModel& model, int stages, Family family)
      : Base(StageDynamics<Width>(model), family, stages), weights_(2 * count_) {
    if (!info().constraints.empty()) constraints_.emplace(model, stages);
  }

  const SystemModel& model() const { return dynamics_.model(); }
  using Base::columns, Base::count, Base::info;
  int stages() const { return columns_.stages(); }
  bool is_constrained() const { return constraints_.has_value(); }
  double time_of(int stage) const { return time_ + columns_.h() * columns_.c(static_cast<std::size_t>(stage)); }

  double time_at(double share) const { return time_ + h() * share; }

  // --- The state ---

  /// q, v  (coordinates). Throws std::invalid_argument where they break constraints.
  Status start(double time, const double* q, const double* v) {
    time_ = time;
    prediction_ = {};
    fastest_ = fastest_here_ = most_kinetic_ = 0;
    if (constraints_) constraints_->require(time, q, v);
    const SystemAt<1>& here = dynamics_.at(time);
    pace_.start(here, q, v);
    masses_.start(here, q);
    Form::from_rates(here, count_, q, v, room(3));
    for (std::size_t k = 0; k < count_; ++k) Base::start(0, k, q[k], room(3)[k]);
    see_masses();
    return masses_.singular() < 0 ? Status::ok : Status::singular_mass_matrix;
  }

  /// Coordinates, full turns included, and rates.
  Motion state(double time) const {
    Motion motion(time, Eigen::VectorXd(eigen_count()), Eigen::VectorXd(eigen_count()));
    for (std::size_t k = 0; k < count_; ++k) motion.q[index(k)] = Base::coordinate(k);
    find_rates(time);
    std::copy_n(room(2), count_, motion.v.data());
    return motion;
  }
  /// Coordinates and rates, where full turns of periodic coordinates are left out. They stay there until the next call.
  struct Here {
    const double *q, *v;
  };
  Here here(double time) const {
    find_rates(time);
    return {room(0), room(2)};
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, state_, turns_, prediction_, masses_, weights_, pace_, fastest_, most_kinetic_, newest_);
    if (constraints_) numbers(*constraints_);
    for (auto& row : U_) numbers.range(row.numbers(), static_cast<std::size_t>(stages()));
    for (auto& past : pasts_) {
      for (auto& row : past) numbers.range(row.numbers(), static_cast<std::size_t>(stages()));
    }
  }
  using Base::keep;
  using typename Base::FullState;
  void go_to(const FullState& there) {
    Base::go_to(there, true);
    see_masses();  // here, not where a step failed
  }

  /// The state at x of the last step, which began there, by the polynomials through its rates.
  Motion at(const FullState& begin, double time, double x) const {
    const auto up_to = columns_.up_to(x), rate_at = columns_.rate_at(x, prediction_.last_h());
    Motion motion(time, Eigen::VectorXd(eigen_count()), Eigen::VectorXd(eigen_count()));
    for (std::size_t k = 0; k < count_; ++k) {
      Compensated<double> q = begin.state[k];
      double gone = 0, rate = 0;
      for (std::size_t j = 0; j < static_cast<std::size_t>(stages()); ++j) {
        gone += up_to[j] * moved(k)[j];
        rate += rate_at[j] * moved(k)[j];
      }
      q.add(gone);
      motion.q[index(k)] = detail::with_turns(q, begin.turns[k]);
      motion.v[index(k)] = rate;
    }
    return motion;
  }

  /// Bounds of how far coordinates and rates get within the last step from where they began.
  bool bound_excursions(const FullState& /*begin*/, double* q, double* v) const {
    for (std::size_t k = 0; k < count_; ++k) {
      const auto [moved_by, changed_by] = columns_.excursion(moved(k));
      q[k] = moved_by;
      v[k] = changed_by / std::abs(prediction_.last_h());
    }
    return true;
  }

  // --- A step ---

  /// Predicts the stages of a step.
  void prepare(const StepTask& task) {
    const auto [ratio, from] = prediction_.next(task, stages(), columns_.deepest());
    if (!from.cold) Base::keep_stages();
    columns_.prepare(task.h);
    time_ = task.time;
    dynamics_.set_times(
        [&](std::size_t j) { return static_cast<int>(j) < stages() ? time_of(static_cast<int>(j)) : time_; });
    Base::predict(time_, ratio, from);
    floor_ = Base::invisible * std::sqrt(Base::size_squared_);
    for (std::size_t k = 0; k < count_; ++k) weights_[count_ + k] = Form::size(std::abs(task.h), weight(k));
    if (constraints_) prepare_constraints(ratio, from);
  }

  /// Predicts the stages as if the motion went on as it does at the start of the step.
  void start_cold() {
    Base::start_cold(true);
    prediction_.forget();
    if (constraints_) push_as_at_start();
  }

  /// One fixed-point iteration, in momentum form; its change, relative to the size of the step.
  double iterate() {
    const StageIteration on{columns_.m(), columns_.each_hb(), state_.data(), weights_.data(), U_.front().numbers()};
    if (constraints_) return iterate_constrained(on);
    const IterationChange found = at_stages()(&SystemFunctions::iterate, on);
    return found.change == 0 ? 0 : found.change / std::max(found.size, floor());
  }
  /// What rounding may make of that change by way of constraints.
  double rounding() const { return constraints_ ? constraints_->rounding() / size_ : 0; }

  /// A correction of Newton's, relative to the size of increments. What rounding may make of it by way of constraints
  /// looks like rounding.
  double relative(double change, double size) const {
    if (change == 0) return 0;
    const double rounding = constraints_ ? constraints_->rounding() : 0;
    return change <= rounding ? std::numeric_limits<double>::epsilon() * change / rounding : change / size;
  }

  /// Takes note of the first of these changes in a step.
  void see_first(double change) { prediction_.see_first(change); }

  /// The coordinate that one more fixed-point iteration changes most.
  int most_changing_coordinate() {
    const auto before = U_;
    iterate();
    int worst = 0;
    double most = -1;
    for (std::size_t k = 0; k < count_; ++k) {
      double change = 0;
      for (int j = 0; j < stages(); ++j) {
        change += weight(k) * std::abs(moved(k)[j] - before[k].numbers()[j]) +
                  std::abs(pushed(k)[j] - before[count_ + k].numbers()[j]) / weight(k);
      }
      if (change <= most) continue;
      most = change;
      worst = static_cast<int>(k);
      if (std::isnan(change)) break;
    }
    return worst;
  }

  /// Coordinates, momenta at the stages.
  L position(std::size_t k) const { return reached(k); }
  L momentum(std::size_t k) const { return reached(count_ + k); }
  const Compensated<double>& momentum_before(std::size_t k) const { return state_[count_ + k]; }
  /// Coordinates at the stages, (coordinates x lanes).
  const double* positions() const {
    for (std::size_t k = 0; k < count_; ++k) Base::place_stages(k, 0);
    return Base::call(0, 0);
  }
  /// The stages, at their times.
  const SystemAt<Width>& at_stages() const { return dynamics_.stages(); }

  /// On entry, `sums` are integrals of dq/dt and dp/dt over the step, over h; on return, by how much they exceed the
  /// increments of the stages. The first moments of dp/dt (`moments`) correct coordinates.
  void take_changes(std::span<double> sums, std::span<const double> moments) const {
    for (std::size_t k = 0; k < count_; ++k) {
      double later = 0;
      for (int j = 0; j < stages(); ++j) later += (1 - columns_.c(static_cast<std::size_t>(j))) * pushed(k)[j];
      const double displaced = Form::size(h() * (h() * moments[count_ + k] - later), weight(k)) / weight(k);
      sums[k] = h() * sums[k] - total(k) + displaced;
      sums[count_ + k] = h() * sums[count_ + k] - total(count_ + k);
    }
  }
  double h() const { return prediction_.h(); }

  /// h b v of coordinate k (which = 0), h b f of its momentum (1).
  double* increments(int which, std::size_t k) { return U_[static_cast<std::size_t>(which) * count_ + k].numbers(); }
  double* moved(std::size_t k) { return increments(0, k); }
  double* pushed(std::size_t k) { return increments(1, k); }
  const double* moved(std::size_t k) const { return U_[k].numbers(); }
  const double* pushed(std::size_t k) const { return U_[count_ + k].numbers(); }

  /// √M_kk at the start of the step.
  double weight(std::size_t k) const { return weights_[k]; }
  /// The same for changes of its momentum, times h.
  double push_weight(std::size_t k) const { return weights_[count_ + k]; }
  /// Size of an increment, as √M_kk dq_k.
  double size(int which, std::size_t k, double increment) const {
    if (which == 0) return weight(k) * std::abs(increment);
    return Form::size(std::abs(h() * increment), weight(k));
  }
  /// The least that a correction is compared with: what would round the coordinates.
  double floor() const { return floor_; }

  // --- What the solved stages show ---

  /// Energy that loads, and what holds time, bring in the step  [J].
  double brought() {
    if (!model().loaded()) return 0;
    return Base::work() + (constraints_ && info().depends_on_time ? constraints_->work(state_.data()) : 0);
  }

  /// The most that an angle turns in the step; one whose inertia nearly vanishes counts twice.
  double turn() const { return farthest_turn().first; }
  /// Which angle that is; −1 where none turns.
  int turning_coordinate() const { return farthest_turn().second; }

  /// Energy at the end of the step less that of its start and what loads bring, relative to the largest kinetic energy
  /// so far.
  double energy_defect() {
    const auto of = Base::balance(brought(), end_pushes());
    most_kinetic_ = std::max(most_kinetic_, of.start.kinetic);
    const double scale = std::max(most_kinetic_, of.finish.kinetic) + std::abs(of.brought);
    return scale > 0 ? of.missing() / scale : 0;
  }
  double imbalance() { return Base::imbalance(brought(), end_pushes()); }

  /// R and d ln R/dt.
  TempoOf<double> tempo() const {
    if (!constraints_) return Base::tempo();
    find_rates(time_);
    dynamics_.here(time_, &SystemFunctions::acceleration, room(0), room(2), room(3));
    constraints_->accelerate(time_, room(0), room(2), room(3));
    return pace_.at(room(2), room(3));
  }

  /// How far the polynomial through the stages' rates misses the rates at the start of the step, relative to the
  /// fastest so far; both as √(Σ M_kk v_k²).
  double defect() {
    find_rates(time_);
    double speed = 0, later = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double v = room(2)[k];
      const double last = weight(k) * moved(k)[stages() - 1] / columns_.hb(static_cast<std::size_t>(stages() - 1));
      speed += weight(k) * weight(k) * v * v;
      later += last * last;
    }
    fastest_ = std::max({fastest_, speed, later});
    const double missed = missed_at_start();
    return missed > 0 ? std::sqrt(missed / std::max(fastest_, StepShape::slow_squared * pace_.natural_speed_squared()))
                      : 0;
  }
  /// How much larger the error of the prediction is than that defect.
  double predictor_gain() const {
    return prediction_.gain([&] { return columns_.predictor_gain(); });
  }

  /// What the error of the step follows from. Sizes of rates are √(Σ M_kk v_k²).
  StepShape shape() {
    Base::find_speeds();
    const double fastest = Base::fastest(), coordinates = StepShape::visible * floor_ / Base::invisible;
    const double rounding = constraints_ ? std::max(coordinates, 4 * constraints_->rounding()) : coordinates;
    L coefficients(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L a = L(weight(k)) * columns_.legendre(moved(k));
      coefficients = fma(a, a, coefficients);
    }
    alignas(pack_alignment) Stored squares;
    coefficients.store(squares);
    StepShape shape;
    shape.pace = std::sqrt(pace_squared_);
    const double scale = fastest > 0 ? shape.pace / std::sqrt(fastest) : 0;
    for (int k = 0; k < stages(); ++k) {
      const double size = std::sqrt(squares[k]);
      shape.decay[static_cast<std::size_t>(k)] = size > rounding ? scale * size : 0;
    }
    if (model().loaded()) {
      find_rates(time_);
      const double size = std::abs(h()) * std::sqrt(missed_at_start());
      if (size > rounding) shape.beyond = scale * size;
    }
    return shape;
  }

  /// Coordinates and momenta at shares of the step, (2 coordinates) rows, by the polynomials through the stages' rates.
  void along(const L& shares, Rows& found) const {
    const L y = fma(L(2.0), shares, L(-1.0));
    std::array<L, static_cast<std::size_t>(Width)> integrals;  // of the Legendre polynomials
    L before(1.0), here = y;
    integrals[0] = shares;
    for (int m = 1; m < stages(); ++m) {
      const L next = L(1.0 / (m + 1)) * fma(L(2.0 * m + 1) * y, here, L(-m) * before);
      integrals[static_cast<std::size_t>(m)] = L(0.5 / (2 * m + 1)) * (next - before);
      before = here;
      here = next;
    }
    alignas(pack_alignment) Stored coefficients;
    for (std::size_t k = 0; k < 2 * count_; ++k) {
      columns_.legendre(numbers_along(k, coefficients)).store(coefficients);
      L gone(state_[k].compensation);
      for (int m = 0; m < stages(); ++m) gone = fma(L(coefficients[m]), integrals[static_cast<std::size_t>(m)], gone);
      (L(state_[k].value) + gone).store(found[k]);
    }
  }

  /// Size of changes of coordinates and momenta, relative to the speed of the motion.
  double size_of(std::span<const double> changes, double pace) const {
    double places = 0, pushes = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double shift = weight(k) * changes[k], push = Form::size(changes[count_ + k], weight(k));
      places += shift * shift;
      pushes += push * push;
    }
    const double squared = pace * pace * places + pushes;
    return squared > 0 ? std::sqrt(squared / Base::fastest()) : squared;  // nothing, of a motion at rest; or no number
  }
  /// Finds how fast the solved stages are.
  void see_speed() { Base::find_speeds(); }
  /// How fast the fastest stage is, relative to the speed of the motion.
  double speed_here() const { return fastest_here_ > 0 ? std::sqrt(fastest_here_ / Base::fastest()) : 0; }

  /// A coordinate whose inertia vanished where masses were looked at last; −1 where none did.
  int singular_coordinate() const { return masses_.singular(); }

  std::pair<double, double> constraint_errors() const {
    return constraints_ ? constraints_->errors() : std::pair<double, double>{};
  }
  /// How many coordinates and rates follow from others by constraints.
  int conditions() const { return constraints_ ? static_cast<int>(constraints_->conditions()) : 0; }
  /// Those of a system that has some.
  const StageConstraints<Width>& constraints() const { return *constraints_; }
  /// Finds what constraints lack and push where increments lead, and derivatives of that.
  void follow_constraints(bool with_derivatives) {
    if (!constraints_) return;
    if (with_derivatives) {
      constraints_->linearize(way());
    } else {
      constraints_->follow(way());
    }
  }
  /// The residual of the momentum of a coordinate without what constraints push, and its derivative by an increment of
  /// another over h b.
  L free_of_constraints(std::size_t row, const L& residual) const {
    return constraints_ ? residual - constraints_->pushed(row) : residual;
  }
  L free_of_constraints(std::size_t row, std::size_t column, std::size_t stage, const L& derivative) const {
    if (!constraints_) return derivative;
    return derivative - L(columns_.hb(stage)) * constraints_->pushed_by_increment(row, column, stage);
  }
  /// Takes from the impulse of each constraint at a node what `by(constraint)` says.
  template <class By>
  void correct_impulses(std::size_t node, By by) {
    for (std::size_t i = 0; i < info().constraints.size(); ++i) constraints_->correct(i, node, by(i));
  }
  /// Finds what constraints push at the end of the solved step.
  void finish_constraints() { constraints_->finish(state_.data(), U_.front().numbers()); }

  /// Where the solved and finished step begins and ends, without full turns.
  std::pair<Motion, Motion> ends() const {
    find_rates(time_);
    Motion begin = room_at(0);
    Base::find_end(end_pushes());
    return {std::move(begin), room_at(1)};
  }

  /// Moves the state to the end of the step.
  void accept() {
    Base::move(true);
    for (std::size_t k = 0; k < end_pushes().size(); ++k) state_[count_ + k].add(end_pushes()[k]);
    fastest_here_ = 0;
    prediction_.accept();
    if (!info().constant_masses || prediction_.steps() % 16 == 0) see_masses();
  }

 private:
  using Base::columns_, Base::count_, Base::dynamics_, Base::fastest_, Base::fastest_here_, Base::find_rates,
      Base::masses_, Base::newest_, Base::room, Base::pace_, Base::pace_squared_, Base::pasts_, Base::state_,
      Base::time_, Base::turns_, Base::U_;

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  Eigen::Index eigen_count() const { return index(count_); }

  double total(std::size_t k) const { return Columns::total(U_[k]); }

  // What is in the room, at a share of the step.
  Motion room_at(double share) const {
    using Numbers = Eigen::Map<const Eigen::VectorXd>;
    return {time_at(share), Numbers(room(0), eigen_count()), Numbers(room(2), eigen_count())};
  }

  // --- Constraints, where the system has them ---

  void prepare_constraints(double ratio, const StagePrediction<double>& from) {
    find_rates(time_);
    constraints_->prepare(time_, h(), room(0), room(2), weights_.data());
    if (from.cold) {
      push_as_at_start();
    } else {
      constraints_->predict(from.again ? 0 : 1, ratio);
    }
    constraints_->set_out(way());
  }

  typename StageConstraints<Width>::Way way() const {
    return {state_.data(), U_.front().numbers(), columns_, at_stages()};
  }

  void push_as_at_start() {
    find_rates(time_);
    dynamics_.here(time_, &SystemFunctions::acceleration, room(0), room(2), room(3));
    constraints_->start_cold(room(0), room(2), room(3));
  }

  double iterate_constrained(const StageIteration& on) {
    for (std::size_t k = 0; k < count_; ++k) {
      reached(k).store(Base::call(0, 0, k));
      (reached(count_ + k) + constraints_->pushed(k)).store(Base::call(0, 1, k));
    }
    at_stages()(&SystemFunctions::hamiltonian_form, Base::call(0, 0), Base::call(0, 1), Base::call(0, 2),
                Base::call(0, 3));
    const IterationChange found =
        detail::replace_increments<Width>(on.hb, Base::call(0, 2), on.weights, 2 * count_, on.increments);
    constraints_->correct(way());
    size_ = std::max(found.size, floor());
    return found.change == 0 ? 0 : found.change / size_;
  }

  std::span<const double> end_pushes() const {
    return constraints_ ? constraints_->end_pushes() : std::span<const double>();
  }

  // Increments of a coordinate, or of its momentum with what constraints push.
  const double* numbers_along(std::size_t k, double* place) const {
    if (!constraints_ || k < count_) return U_[k].numbers();
    (L::load(U_[k].numbers()) + constraints_->as_increments(k - count_)).store(place);
    return place;
  }

  L reached(std::size_t k) const {
    return L(state_[k].value) + columns_.integral(U_[k].numbers(), L(state_[k].compensation));
  }

  std::pair<double, int> farthest_turn() const {
    std::pair<double, int> farthest{0, -1};
    Base::for_each_turn([&](std::size_t k, double turn) {
      if (turn > farthest.first) farthest = {turn, static_cast<int>(k)};
    });
    return farthest;
  }

  // Σ M_kk (v_k − polynomial through the stages' rates)² at the start of the step, where find_rates was called.
  double missed_at_start() const {
    double missed = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double off = weight(k) * (columns_.at_start(moved(k)) - room(2)[k]);
      missed += off * off;
    }
    return missed;
  }

  void see_masses() {
    Base::read_masses();
    for (std::size_t k = 0; k < count_; ++k) weights_[k] = std::sqrt(masses_.inertia(k));
  }

  std::vector<double> weights_;                                 // √M_kk; then that of changes of momenta, times h
  mutable std::optional<StageConstraints<Width>> constraints_;  // where it looks at a state, too
  double floor_ = 0, most_kinetic_ = 0;
  double size_ = 1;  // of the step, in the last iteration with constraints
  StepPrediction prediction_;
};

}  // namespace pendula
