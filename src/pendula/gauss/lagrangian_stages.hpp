#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pendula/gauss/pace.hpp>
#include <pendula/gauss/stage_columns.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/numeric/full_turns.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// The stages of a step of any system in momentum form, q̇ = v(q, p), ṗ = f(q, v): what both iterations on them share.
///
/// Stages are held as increments, h b v of a coordinate and h b f of its momentum, all stages of one number in the
/// lanes of a pack; the state carries what it has lost to rounding:
///   Q = q + m U_q,  P = p + m U_p,  m_ij = a_ij / b_j.
/// `Width` is at least the number of stages, which is a run-time number: lanes beyond it repeat the start of the step.
///
/// Coordinates may have any units. Changes of them are compared as √M_kk dq_k, and those of momenta as dp_k / √M_kk.
template <int Width>
class LagrangianStages {
 public:
  using L = Pack<Width, RegisterFor<Width>>;
  using Columns = detail::StageColumns<Eigen::Dynamic, double, Width>;
  using Rows = PackRows<static_cast<std::size_t>(Width)>;
  /// One number a lane.
  using Stored = double[static_cast<std::size_t>(Width)];

  LagrangianStages(const SystemModel& model, int stages, Family family)
      : at_(model),
        here_(model),
        columns_(family, stages),
        count_(model.coordinates()),
        U_(2 * count_),
        lanes_(3 * count_),
        state_(2 * count_),
        turns_(count_),
        saved_{state_, turns_, 0},
        remembered_(saved_),
        masses_(info()),
        weights_(2 * count_),
        pace_(info()),
        numbers_(4 * count_) {}

  const SystemModel& model() const { return at_.model(); }
  const SystemInfo& info() const { return model().info(); }
  const Columns& columns() const { return columns_; }
  /// Coordinates.
  std::size_t count() const { return count_; }
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
    const SystemAt<1>& here = at(time);
    pace_.start(here, q, v);
    masses_.start(here, q);
    here(&SystemFunctions::momentum_from_velocity, q, v, numbers(0));
    for (std::size_t k = 0; k < count_; ++k) {
      state_[k] = {q[k], 0};
      state_[count_ + k] = {numbers(0)[k], 0};
    }
    std::fill(turns_.begin(), turns_.end(), 0.0);
    count_turns();
    read_masses();
    return masses_.singular() < 0 ? Status::ok : Status::singular_mass_matrix;
  }

  /// Coordinates with all turns that were made, and rates.
  Motion motion(double time) const {
    Motion motion(time, Eigen::VectorXd(eigen_count()), Eigen::VectorXd(eigen_count()));
    for (std::size_t k = 0; k < count_; ++k) motion.q[index(k)] = detail::with_turns(state_[k], turns_[k]);
    std::copy_n(velocity(time), count_, motion.v.data());
    return motion;
  }
  /// Where the system is  (coordinates), those that are periodic within a turn or so. What is told stays until the next
  /// call.
  struct Place {
    const double *q, *v;
  };
  Place place(double time) const {
    const double* v = velocity(time);
    return {numbers(0), v};
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, state_, turns_, U_, last_h_, masses_, weights_, pace_, fastest_, most_kinetic_, steps_);
  }
  void save() { keep(saved_); }
  void restore() {
    take(saved_);
    read_masses();  // as they are here, not where the step failed
    forget();
  }

  /// Remembers the start of the step; goes back there, the stages still known.
  void remember() { keep(remembered_); }
  void return_to_start() { take(remembered_); }

  /// The state at x of the last step, by the polynomials through its rates.
  Motion glance(double time, double x) const {
    const auto up_to = columns_.up_to(x), rate_at = columns_.rate_at(x, last_h_);
    Motion motion(time, Eigen::VectorXd(eigen_count()), Eigen::VectorXd(eigen_count()));
    for (std::size_t k = 0; k < count_; ++k) {
      Compensated<double> q = remembered_.state[k];
      double moved = 0, rate = 0;
      for (std::size_t j = 0; j < static_cast<std::size_t>(stages()); ++j) {
        moved += up_to[j] * U_[k][j];
        rate += rate_at[j] * U_[k][j];
      }
      q.add(moved);
      motion.q[index(k)] = detail::with_turns(q, remembered_.turns[k]);
      motion.v[index(k)] = rate;
    }
    return motion;
  }

  // --- A step ---

  /// Predicts the stages of a step of size h: from the last step's, or cold where there was none like it.
  void prepare(double time, double h) {
    const bool alike = last_h_ != 0 && std::abs(h / last_h_) < farthest_extrapolation;
    time_ = time;
    columns_.prepare(h, alike ? last_h_ : 0);
    is_predicted_ = alike;
    set_times();
    if (alike) {
      extrapolate();
    } else {
      start_cold();
    }
    last_h_ = 0;  // what was predicted from is gone until the step is accepted
    step_ = h;
    set_scales();
  }

  /// Predicts the stages of another step from where the last one began that was solved, accepted or not: from that
  /// one's.
  void prepare_again(double time, double h) {
    time_ = time;
    columns_.predict_at(0, h / (last_h_ != 0 ? last_h_ : step_));
    columns_.prepare(h, 0);
    set_times();
    extrapolate();
    step_ = h;
    set_scales();
  }

  /// Stages of a motion that goes on as at the start of the step.
  void start_cold() {
    double *const q = numbers(0), *const p = numbers(1), *const v = numbers(2), *const f = numbers(3);
    read_state(q, p);
    at(time_)(&SystemFunctions::hamiltonian_form, q, p, v, f);
    for (std::size_t k = 0; k < count_; ++k) {
      (columns_.hb() * L(v[k])).store(moved(k));
      (columns_.hb() * L(f[k])).store(pushed(k));
    }
    last_h_ = 0;
  }

  /// Replaces the increments by a fixed-point iteration once; its change is relative to the size of the step.
  double iterate() {
    const IterationChange found = at_(&SystemFunctions::iterate, StageIteration{columns_.m(), columns_.each_hb(),
                                                                                state_.data(), weights_.data(), U_[0]});
    return found.change == 0 ? 0 : found.change / std::max(found.size, floor_);
  }

  /// The coordinate that one more iteration changes most.
  int most_changing_coordinate() {
    std::copy_n(U_[0], U_.rows() * static_cast<std::size_t>(Width), lanes_[0]);
    iterate();
    int worst = 0;
    double most = -1;
    for (std::size_t k = 0; k < count_; ++k) {
      double change = 0;
      for (int j = 0; j < stages(); ++j) {
        change += weight(k) * std::abs(moved(k)[j] - lanes_[k][j]) +
                  std::abs(pushed(k)[j] - lanes_[count_ + k][j]) / weight(k);
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
    for (std::size_t k = 0; k < count_; ++k) position(k).store(lanes_[k]);
    return lanes_[0];
  }
  /// The stages, at their times.
  const SystemAt<Width>& at_stages() const { return at_; }

  /// Makes sums of the rates of coordinates and momenta over the step what the stages lack of them; what momenta lack
  /// on the way displaces coordinates.
  void take_changes(std::span<double> sums, std::span<const double> moments) const {
    for (std::size_t k = 0; k < count_; ++k) {
      double later = 0;
      for (int j = 0; j < stages(); ++j) later += (1 - columns_.c(static_cast<std::size_t>(j))) * pushed(k)[j];
      const double displaced = step_ * (step_ * moments[count_ + k] - later) / (weight(k) * weight(k));
      sums[k] = step_ * sums[k] - sum(moved(k)) + displaced;
      sums[count_ + k] = step_ * sums[count_ + k] - sum(pushed(k));
    }
  }
  double h() const { return step_; }

  /// h b v of coordinate k, h b f of its momentum.
  double* moved(std::size_t k) { return U_[k]; }
  double* pushed(std::size_t k) { return U_[count_ + k]; }
  const double* moved(std::size_t k) const { return U_[k]; }
  const double* pushed(std::size_t k) const { return U_[count_ + k]; }

  /// √M_kk at the start of the step.
  double weight(std::size_t k) const { return weights_[k]; }
  /// h over that.
  double inverse_weight(std::size_t k) const { return weights_[count_ + k]; }
  /// What a correction is compared with, at least: nothing smaller would show in the coordinates.
  double floor() const { return floor_; }

  // --- What the stepper asks of a solution ---

  /// The most that an angle turns in the step, one whose inertia nearly vanishes twice: it does not go on like that.
  double turn() const { return farthest_turn().first; }
  /// Which angle that is; −1 where none turns.
  int turning_coordinate() const { return farthest_turn().second; }

  /// Energy at the end of the step less that of its start and what loads bring, relative to the largest kinetic energy
  /// that was looked at.
  double energy_defect() {
    const Balance of = balance();
    most_kinetic_ = std::max(most_kinetic_, of.start.kinetic);
    const double scale = std::max(most_kinetic_, of.finish.kinetic) + std::abs(of.brought);
    return scale > 0 ? of.missing() / scale : 0;
  }

  /// The same without its sign, relative to kinetic and potential energy, or to the energy that motion comes to from
  /// rest where it starts without any.
  double imbalance() {
    const Balance of = balance();
    const double scale =
        std::max({of.start.size(), of.finish.size(), pace_.natural_speed_squared()}) + std::abs(of.brought);
    return scale > 0 ? std::abs(of.missing()) / scale : 0;
  }

  /// How far, at the start of the step, the polynomial through the stages' rates is off, relative to the fastest motion
  /// that there was; both as √(Σ M_kk v_k²).
  double defect() {
    const double* v = velocity(time_);
    double speed = 0, later = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double last = weight(k) * moved(k)[stages() - 1] / columns_.hb(static_cast<std::size_t>(stages() - 1));
      speed += weight(k) * weight(k) * v[k] * v[k];
      later += last * last;
    }
    fastest_ = std::max({fastest_, speed, later});
    const double missed = missed_at_start(v);
    return missed > 0 ? std::sqrt(missed / fastest_) : 0;
  }
  double predictor_gain() const { return is_predicted_ ? columns_.predictor_gain() : 1; }

  Tempo tempo() const {
    const double* v = velocity(time_);
    at(time_)(&SystemFunctions::acceleration, numbers(0), v, numbers(1));
    return pace_.at(v, numbers(1));
  }

  /// Of the stages as they were solved. Sizes of rates are √(Σ M_kk v_k²).
  StepShape shape() {
    const L inverse = inverse_hb();
    L eighth_powers(0.0), speed(0.0), coefficients(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L v = L::load(moved(k)) * inverse, a = columns_.legendre(moved(k)), square = v * v;
      const L squared(weight(k) * weight(k));
      if (info().is_angle[k]) eighth_powers = fma(square * square, square * square, eighth_powers);
      speed = fma(squared, square, speed);
      coefficients = fma(squared * a, a, coefficients);
    }
    return shape_of(eighth_powers, speed, coefficients);
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
      columns_.legendre(U_[k]).store(coefficients);
      L moved(state_[k].compensation);
      for (int m = 0; m < stages(); ++m) moved = fma(L(coefficients[m]), integrals[static_cast<std::size_t>(m)], moved);
      (L(state_[k].value) + moved).store(found[k]);
    }
  }

  /// The size of changes of coordinates and momenta, relative to the speed of the motion.
  double size_of(std::span<const double> changes, double pace) const {
    double places = 0, pushes = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double place = weight(k) * changes[k], push = changes[count_ + k] / weight(k);
      places += place * place;
      pushes += push * push;
    }
    return std::sqrt((pace * pace * places + pushes) / fastest());
  }
  /// Looks how fast stages are, that were solved.
  void see_speed() {
    const L inverse = inverse_hb();
    L speed(0.0);
    for (std::size_t k = 0; k < count_; ++k) {
      const L v = L(weight(k)) * L::load(moved(k)) * inverse;
      speed = fma(v, v, speed);
    }
    fastest_here_ = largest_of_stages(speed);
  }
  /// The fastest of the stages, of the speed of the motion.
  double speed_here() const { return std::sqrt(fastest_here_ / fastest()); }

  /// Energy that forces, and what holds time, bring in the step.
  double work() const {
    // Of increments h b v, not of rates: lanes beyond the stages have b = 0, where nothing can be divided by it.
    const L inverse = inverse_hb();
    for (std::size_t k = 0; k < count_; ++k) (L::load(moved(k)) * inverse).store(lanes_[count_ + k]);
    at_(&SystemFunctions::power, positions(), lanes_[count_], lanes_[2 * count_]);
    alignas(pack_alignment) Stored each;
    (columns_.hb() * L::load(lanes_[2 * count_])).store(each);
    return sum(each);
  }

  /// A coordinate whose inertia has vanished at the end of the step, −1 where none has.
  int singular_coordinate() const { return masses_.singular(); }

  /// Moves the state to the end of the step.
  void accept() {
    for (std::size_t k = 0; k < 2 * count_; ++k) state_[k].add(sum(U_[k]));
    count_turns();
    last_h_ = step_;
    time_ += step_;
    fastest_ = std::max(fastest_, std::exchange(fastest_here_, 0));
    if (!info().constant_masses || ++steps_ % 16 == 0) read_masses();
  }

  void forget() { last_h_ = 0; }

 private:
  struct Energies {
    double kinetic = 0, total = 0;
    double size() const { return std::abs(kinetic) + std::abs(total - kinetic); }
  };
  // Over the step.
  struct Balance {
    double brought;
    Energies start, finish;
    double missing() const { return finish.total - start.total - brought; }
  };

  struct Kept {
    std::vector<Compensated<double>> state;
    std::vector<double> turns;
    double time;
  };
  void keep(Kept& kept) const {
    kept.state = state_;
    kept.turns = turns_;
    kept.time = time_;
  }
  void take(const Kept& kept) {
    state_ = kept.state;
    turns_ = kept.turns;
    time_ = kept.time;
  }

  // Of coordinates: what corrections need not be compared with.
  static constexpr double invisible = 1e-9;

  // Farther than this the polynomial of the last step is no prediction.
  static constexpr double farthest_extrapolation = 1.5;

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  Eigen::Index eigen_count() const { return index(count_); }

  // Room for numbers of one state, (coordinates) each.
  double* numbers(std::size_t which) const { return numbers_.data() + which * count_; }

  // The system at one time.
  const SystemAt<1>& at(double time) const {
    here_.set_time(time);
    return here_;
  }

  void read_state(double* q, double* p) const {
    for (std::size_t k = 0; k < count_; ++k) {
      q[k] = state_[k].value;
      p[k] = state_[count_ + k].value;
    }
  }

  // Rates of the state; its coordinates are in numbers(0) then.
  const double* velocity(double time) const {
    read_state(numbers(0), numbers(3));
    at(time)(&SystemFunctions::velocity_from_momentum, numbers(0), numbers(3), numbers(2));
    return numbers(2);
  }

  Energies energies(double time, const double* q, const double* p) const {
    Energies found;
    double* const v = numbers(2);
    const SystemAt<1>& here = at(time);
    here(&SystemFunctions::velocity_from_momentum, q, p, v);
    here(&SystemFunctions::energies, q, v, &found.kinetic, &found.total);
    return found;
  }
  Balance balance() const {
    double *const q = numbers(0), *const p = numbers(1);
    const double brought = model().loaded() ? work() : 0;
    read_state(q, p);
    const Energies start = energies(time_, q, p);
    for (std::size_t k = 0; k < count_; ++k) {
      q[k] += state_[k].compensation + sum(moved(k));
      p[k] += state_[count_ + k].compensation + sum(pushed(k));
    }
    return {brought, start, energies(time_ + step_, q, p)};
  }

  double fastest() const { return std::max({fastest_, fastest_here_, pace_.natural_speed_squared()}); }

  L reached(std::size_t k) const { return L(state_[k].value) + columns_.integral(U_[k], L(state_[k].compensation)); }

  double sum(const double* increments) const {
    double sum = 0;
    for (int j = 0; j < stages(); ++j) sum += increments[j];
    return sum;
  }

  double largest_of_stages(const L& lanes) const {
    alignas(pack_alignment) Stored each;
    lanes.store(each);
    return *std::max_element(each, each + stages());
  }

  std::pair<double, int> farthest_turn() const {
    std::pair<double, int> farthest{0, -1};
    for (std::size_t k = 0; k < count_; ++k) {
      if (!info().is_angle[k]) continue;
      double turn = 0;
      for (int j = 0; j < stages(); ++j) turn += std::abs(moved(k)[j]);
      if (masses_.is_small(k)) turn *= 2;
      if (turn > farthest.first) farthest = {turn, static_cast<int>(k)};
    }
    return farthest;
  }

  // Σ M_kk (v_k − what the polynomial through the stages' rates is there)², v being the rates at the start of the step.
  double missed_at_start(const double* v) const {
    double missed = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double off = weight(k) * (columns_.at_start(moved(k)) - v[k]);
      missed += off * off;
    }
    return missed;
  }

  void count_turns() {
    for (std::size_t k = 0; k < count_; ++k) {
      if (info().is_periodic[k]) detail::take_out_turns(state_[k], turns_[k]);
    }
  }

  L inverse_hb() const {
    alignas(pack_alignment) Stored inverse;
    for (int j = 0; j < Width; ++j) {
      inverse[j] = j < stages() ? 1 / columns_.hb(static_cast<std::size_t>(j)) : 0;
    }
    return L::load(inverse);
  }

  StepShape shape_of(const L& eighth_powers, const L& speed, const L& coefficients) {
    alignas(pack_alignment) Stored powers, squares;
    eighth_powers.store(powers);
    coefficients.store(squares);
    fastest_here_ = largest_of_stages(speed);
    StepShape shape;
    shape.pace = pace_.of(powers[stages() / 2]);
    const double scale = fastest() > 0 ? shape.pace / std::sqrt(fastest()) : 0;
    const double rounding = StepShape::visible * floor_ / invisible;
    for (int k = 0; k < stages(); ++k) {
      const double size = std::sqrt(squares[k]);
      shape.decay[static_cast<std::size_t>(k)] = size > rounding ? scale * size : 0;
    }
    if (stages() == StepShape::few_stages && model().loaded()) {
      const double size = std::abs(step_) * std::sqrt(missed_at_start(velocity(time_)));
      if (size > rounding) shape.beyond = scale * size;
    }
    return shape;
  }

  // Times and inputs at the stages.
  void set_times() {
    at_.set_times([&](std::size_t j) { return static_cast<int>(j) < stages() ? time_of(static_cast<int>(j)) : time_; });
  }

  void extrapolate() {
    for (std::size_t k = 0; k < 2 * count_; ++k) columns_.extrapolated_increments(U_[k]).store(U_[k]);
  }

  void read_masses() {
    read_state(numbers(0), numbers(3));
    masses_.read(at(time_), numbers(0));
    for (std::size_t k = 0; k < count_; ++k) weights_[k] = std::sqrt(masses_.inertia(k));
  }

  void set_scales() {
    floor_ = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double size = std::max(std::abs(state_[k].value), info().is_angle[k] ? 1.0 : 0.0);
      floor_ = std::max(floor_, invisible * weight(k) * size);
      weights_[count_ + k] = std::abs(step_) / weight(k);
    }
  }

  SystemAt<Width> at_;
  mutable SystemAt<1> here_;
  Columns columns_;
  std::size_t count_;
  Rows U_;
  mutable Rows lanes_;                      // workspace: three numbers of each coordinate
  std::vector<Compensated<double>> state_;  // coordinates, then momenta
  std::vector<double> turns_;
  Kept saved_, remembered_;
  MassScale masses_;
  std::vector<double> weights_;  // √M_kk, then h over that
  Pace pace_;
  mutable std::vector<double> numbers_;  // workspace: four numbers of each coordinate
  double floor_ = 0, time_ = 0, step_ = 0, last_h_ = 0;
  double fastest_ = 0, fastest_here_ = 0;  // Σ M_kk v_k², of all steps so far and of the stages
  double most_kinetic_ = 0;
  std::int64_t steps_ = 0;
  bool is_predicted_ = false;
};

}  // namespace pendula
