#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pendula/gauss/prediction_depth.hpp>
#include <pendula/gauss/stage_dynamics.hpp>
#include <pendula/gauss/stage_layout.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/system_motion.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// The stages of a step of any system in momentum form (SystemMotion), of one motion, all of them in the lanes of a
/// pack: what both iterations on them share. `Width` is at least the number of stages, which is a run-time number:
/// lanes beyond it repeat the start of the step.
template <int Width>
class LagrangianStages : public SystemMotion<StagesInLanes<Eigen::Dynamic, double, Width>, StageDynamics<Width>> {
  using Base = SystemMotion<StagesInLanes<Eigen::Dynamic, double, Width>, StageDynamics<Width>>;

 public:
  using L = Pack<Width, RegisterFor<Width>>;
  using typename Base::Columns;
  using Real = double;
  using State = Motion;
  using Rows = PackRows<static_cast<std::size_t>(Width)>;
  /// One number a lane.
  using Stored = double[static_cast<std::size_t>(Width)];

  LagrangianStages(const SystemModel& model, int stages, Family family)
      : Base(StageDynamics<Width>(model), family, stages), weights_(2 * count_) {}

  const SystemModel& model() const { return dynamics_.model(); }
  using Base::columns, Base::count, Base::info;
  int stages() const { return columns_.stages(); }
  double time_of(int stage) const { return time_ + columns_.h() * columns_.c(static_cast<std::size_t>(stage)); }

  double time_at(double share) const { return time_ + step_ * share; }

  // --- The state ---

  /// q, v  (coordinates).
  Status start(double time, const double* q, const double* v) {
    time_ = time;
    forget();
    fastest_ = fastest_here_ = most_kinetic_ = 0;
    steps_ = 0;
    depth_ = {};
    const SystemAt<1>& here = dynamics_.at(time);
    pace_.start(here, q, v);
    masses_.start(here, q);
    here(&SystemFunctions::momentum_from_velocity, q, v, room(3));
    for (std::size_t k = 0; k < count_; ++k) Base::start(0, k, q[k], room(3)[k]);
    see_masses();
    return masses_.singular() < 0 ? Status::ok : Status::singular_mass_matrix;
  }

  /// Coordinates with all turns that were made, and rates.
  Motion state(double time) const {
    Motion motion(time, Eigen::VectorXd(eigen_count()), Eigen::VectorXd(eigen_count()));
    for (std::size_t k = 0; k < count_; ++k) motion.q[index(k)] = Base::coordinate(k);
    find_rates(time);
    std::copy_n(room(2), count_, motion.v.data());
    return motion;
  }
  /// Where the system is  (coordinates), those that are periodic within a turn or so. What is told stays until the next
  /// call.
  struct Here {
    const double *q, *v;
  };
  Here here(double time) const {
    find_rates(time);
    return {room(0), room(2)};
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, state_, turns_, last_h_, masses_, weights_, pace_, fastest_, most_kinetic_, steps_, depth_, newest_);
    for (auto& row : U_) numbers.range(row.numbers(), static_cast<std::size_t>(stages()));
    for (auto& past : pasts_) {
      for (auto& row : past) numbers.range(row.numbers(), static_cast<std::size_t>(stages()));
    }
  }
  using Base::keep, Base::place;
  using typename Base::Place;
  void go_to(const Place& there) {
    Base::go_to(there, true);
    see_masses();  // as they are here, not where a step failed
  }

  /// The state at x of the last step, which began there, by the polynomials through its rates.
  Motion glance(const Place& begin, double time, double x) const {
    const auto up_to = columns_.up_to(x), rate_at = columns_.rate_at(x, last_h_);
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

  // --- A step ---

  /// Predicts the stages of a step of size h: from the last steps', or cold where there was none like it.
  void prepare(double time, double h) {
    const bool alike = last_h_ != 0 && std::abs(h / last_h_) < farthest_extrapolation;
    const int depth = depth_.next(alike && h == last_h_, stages(), columns_.deepest());
    is_predicted_ = alike;
    predict(time, h, alike ? h / last_h_ : 1,
            {alike, false, !alike, static_cast<double>(depth), static_cast<double>(depth_.known())});
    last_h_ = 0;  // what was predicted from is gone until the step is accepted
  }

  /// Predicts the stages of another step from where the last one began that was solved, accepted or not: from that
  /// one's.
  void prepare_again(double time, double h) {
    depth_.forget();
    predict(time, h, h / (last_h_ != 0 ? last_h_ : step_), {false, true, false, 0, 0});
  }

  /// Stages of a motion that goes on as at the start of the step.
  void start_cold() {
    Base::start_cold(true);
    forget();
  }

  /// Replaces the increments by a fixed-point iteration once; its change is relative to the size of the step.
  double iterate() {
    const IterationChange found = at_stages()(
        &SystemFunctions::iterate,
        StageIteration{columns_.m(), columns_.each_hb(), state_.data(), weights_.data(), U_.front().numbers()});
    return found.change == 0 ? 0 : found.change / std::max(found.size, floor());
  }

  /// The first of these changes in a step.
  void see_first(double change) { depth_.saw(change); }

  /// The coordinate that one more iteration changes most.
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
  /// All coordinates there.
  const double* positions() const {
    for (std::size_t k = 0; k < count_; ++k) Base::place_stages(k, 0);
    return Base::call(0, 0);
  }
  /// The stages, at their times.
  const SystemAt<Width>& at_stages() const { return dynamics_.stages(); }

  /// Makes sums of the rates of coordinates and momenta over the step what the stages lack of them; what momenta lack
  /// on the way displaces coordinates.
  void take_changes(std::span<double> sums, std::span<const double> moments) const {
    for (std::size_t k = 0; k < count_; ++k) {
      double later = 0;
      for (int j = 0; j < stages(); ++j) later += (1 - columns_.c(static_cast<std::size_t>(j))) * pushed(k)[j];
      const double displaced = step_ * (step_ * moments[count_ + k] - later) / (weight(k) * weight(k));
      sums[k] = step_ * sums[k] - total(k) + displaced;
      sums[count_ + k] = step_ * sums[count_ + k] - total(count_ + k);
    }
  }
  double h() const { return step_; }

  /// h b v of coordinate k, h b f of its momentum.
  double* moved(std::size_t k) { return U_[k].numbers(); }
  double* pushed(std::size_t k) { return U_[count_ + k].numbers(); }
  const double* moved(std::size_t k) const { return U_[k].numbers(); }
  const double* pushed(std::size_t k) const { return U_[count_ + k].numbers(); }

  /// √M_kk at the start of the step.
  double weight(std::size_t k) const { return weights_[k]; }
  /// h over that.
  double inverse_weight(std::size_t k) const { return weights_[count_ + k]; }
  /// What a correction is compared with, at least: nothing smaller would show in the coordinates.
  double floor() const { return floor_; }

  // --- What the stepper asks of a solution ---

  /// The most that an angle turns in the step, one whose inertia nearly vanishes twice.
  double turn() const { return farthest_turn().first; }
  /// Which angle that is; −1 where none turns.
  int turning_coordinate() const { return farthest_turn().second; }

  /// Energy at the end of the step less that of its start and what loads bring, relative to the largest kinetic energy
  /// that was looked at.
  double energy_defect() {
    const auto of = Base::balance(brought());
    most_kinetic_ = std::max(most_kinetic_, of.start.kinetic);
    const double scale = std::max(most_kinetic_, of.finish.kinetic) + std::abs(of.brought);
    return scale > 0 ? of.missing() / scale : 0;
  }
  double imbalance() { return Base::imbalance(brought()); }

  /// How far, at the start of the step, the polynomial through the stages' rates is off, relative to the fastest motion
  /// that there was; both as √(Σ M_kk v_k²).
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
    return missed > 0 ? std::sqrt(missed / fastest_) : 0;
  }
  /// How much larger the error of a prediction is than that defect, at least. Predictions from many steps are better
  /// than that: some of these steps are looked at whatever they show (0).
  double predictor_gain() const {
    if (depth_.is_by_many() && steps_ % looked_at == 0) return 0;
    return is_predicted_ ? columns_.predictor_gain() : 1;
  }

  /// Of the stages as they were solved. Sizes of rates are √(Σ M_kk v_k²).
  StepShape shape() {
    Base::find_speeds();
    const double fastest = Base::fastest(), rounding = StepShape::visible * floor_ / Base::invisible;
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
    if (stages() == StepShape::few_stages && model().loaded()) {
      find_rates(time_);
      const double size = std::abs(step_) * std::sqrt(missed_at_start());
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
      columns_.legendre(U_[k].numbers()).store(coefficients);
      L gone(state_[k].compensation);
      for (int m = 0; m < stages(); ++m) gone = fma(L(coefficients[m]), integrals[static_cast<std::size_t>(m)], gone);
      (L(state_[k].value) + gone).store(found[k]);
    }
  }

  /// The size of changes of coordinates and momenta, relative to the speed of the motion.
  double size_of(std::span<const double> changes, double pace) const {
    double places = 0, pushes = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double shift = weight(k) * changes[k], push = changes[count_ + k] / weight(k);
      places += shift * shift;
      pushes += push * push;
    }
    return std::sqrt((pace * pace * places + pushes) / Base::fastest());
  }
  /// Looks how fast stages are, that were solved.
  void see_speed() { Base::find_speeds(); }
  /// The fastest of the stages, of the speed of the motion.
  double speed_here() const { return std::sqrt(fastest_here_ / Base::fastest()); }

  /// A coordinate whose inertia has vanished at the end of the step, −1 where none has.
  int singular_coordinate() const { return masses_.singular(); }

  /// Moves the state to the end of the step.
  void accept() {
    Base::move(true);
    fastest_here_ = 0;
    last_h_ = step_;
    ++steps_;
    if (!info().constant_masses || steps_ % 16 == 0) see_masses();
  }

  void forget() {
    last_h_ = 0;
    depth_.forget();
  }

 private:
  using Base::columns_, Base::count_, Base::dynamics_, Base::fastest_, Base::fastest_here_, Base::find_rates,
      Base::masses_, Base::newest_, Base::room, Base::pace_, Base::pace_squared_, Base::pasts_, Base::state_,
      Base::time_, Base::turns_, Base::U_;

  // Farther than this the polynomial of the last step is no prediction.
  static constexpr double farthest_extrapolation = 1.5;
  static constexpr std::int64_t looked_at = 8;  // of the steps, one in so many

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  Eigen::Index eigen_count() const { return index(count_); }

  void predict(double time, double h, double ratio, const StagePrediction<double>& from) {
    if (!from.cold) Base::keep_stages();
    columns_.prepare(h);
    time_ = time;
    dynamics_.set_times(
        [&](std::size_t j) { return static_cast<int>(j) < stages() ? time_of(static_cast<int>(j)) : time_; });
    Base::predict(time, ratio, from);
    step_ = h;
    floor_ = Base::invisible * std::sqrt(Base::size_squared_);
    for (std::size_t k = 0; k < count_; ++k) weights_[count_ + k] = std::abs(h) / weight(k);
  }

  double brought() const { return model().loaded() ? Base::work() : 0; }
  double total(std::size_t k) const { return Columns::total(U_[k]); }

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

  // Σ M_kk (v_k − what the polynomial through the stages' rates is there)², of the rates that were found at the start
  // of the step.
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

  std::vector<double> weights_;  // √M_kk, then h over that
  double floor_ = 0, step_ = 0, last_h_ = 0;
  double most_kinetic_ = 0;
  std::int64_t steps_ = 0;
  PredictionDepth depth_;
  bool is_predicted_ = false;
};

}  // namespace pendula
