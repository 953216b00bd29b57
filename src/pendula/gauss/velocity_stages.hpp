#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/gauss/pace.hpp>
#include <pendula/gauss/stage_columns.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/step_task.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/system_model.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// State and stages of any system in the paper's velocity form (VelocityNewton). All stages of one number are in the
/// lanes of a pack. `Width` is at least the number of stages.
template <int Width>
class VelocityStages {
 public:
  using State = Motion;

  VelocityStages(const SystemModel& model, int stages, Family family)
      : at_(model),
        here_(model),
        columns_(family, stages),
        count_(model.coordinates()),
        stages_(4 * count_),
        last_a_(count_),
        state_(2 * count_),
        acceleration_(count_),
        weight_(count_),
        masses_(model.info()),
        pace_(model.info()),
        numbers_(4 * count_) {}

  Status start(const State& state) {
    at_.model().require(state);
    last_h_ = 0;
    fastest_ = fastest_here_ = most_kinetic_ = 0;
    time_ = state.time;
    for (std::size_t k = 0; k < count_; ++k) {
      state_[k] = {state.q[index(k)], 0};
      state_[count_ + k] = {state.v[index(k)], 0};
    }
    const SystemAt<1>& here = system_at(time_);
    pace_.start(here, state.q.data(), state.v.data());
    masses_.start(here, state.q.data());
    if (masses_.singular() >= 0) return Status::singular_mass_matrix;
    here(&SystemFunctions::acceleration, state.q.data(), state.v.data(), acceleration_.data());
    return Status::ok;
  }

  void prepare(const StepTask& task) {
    task.from == PredictedFrom::same_step ? predict_again(task.h) : predict(task);
    time_ = task.time;
    at_.set_times([&](std::size_t j) { return j < count_of_stages() ? time_ + columns_.h() * columns_.c(j) : time_; });
    for (std::size_t k = 0; k < count_; ++k) weight_[k] = std::sqrt(masses_.inertia(k));
  }

  int stages() const { return columns_.stages(); }

  double turn() const { return farthest_turn().first; }

  double energy_defect() {
    find_increments();
    const double brought = this->brought();
    double *const q_at = numbers(2), *const v_at = numbers(3);
    read_state(q_at, v_at);
    const auto [start, kinetic] = energies(time_, q_at, v_at);
    for (std::size_t k = 0; k < count_; ++k) {
      q_at[k] += numbers(0)[k];
      v_at[k] += numbers(1)[k];
    }
    const auto [end, kinetic_at_end] = energies(time_ + columns_.h(), q_at, v_at);
    most_kinetic_ = std::max(most_kinetic_, kinetic);
    const double scale = std::max(most_kinetic_, kinetic_at_end) + std::abs(brought);
    return scale > 0 ? (end - start - brought) / scale : 0;
  }

  double defect(double noticed, double first_correction) {
    if (!(first_correction >= noticed * predictor_gain())) return 0;
    double first = 0, last = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const double squared = weight_[k] * weight_[k], rate = state_[count_ + k].value, later = v(k)[stages() - 1];
      first += squared * rate * rate;
      last += squared * later * later;
    }
    fastest_ = std::max({fastest_, first, last});
    const double off = missed_at_start();
    return off > 0 ? std::sqrt(off / std::max(fastest_, StepShape::slow_squared * pace_.natural_speed_squared())) : 0;
  }

  Tempo tempo() const {
    read_state(numbers(0), numbers(1));
    system_at(time_)(&SystemFunctions::acceleration, numbers(0), numbers(1), numbers(2));
    return pace_.at(numbers(1), numbers(2));
  }

  StepShape shape() {
    place_stages();
    L speed(0.0), coefficients(0.0);
    double largest = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const L rate = L(weight_[k]) * L::load(v(k));
      alignas(pack_alignment) Stored advance;
      (columns_.hb() * rate).store(advance);
      const L coefficient = columns_.legendre(advance);
      speed = fma(rate, rate, speed);
      coefficients = fma(coefficient, coefficient, coefficients);
      const double size = std::max(std::abs(state_[k].value), info().is_angle[k] ? 1.0 : 0.0);
      largest = std::max(largest, weight_[k] * size);
      numbers(0)[k] = v(k)[stages() / 2];
      numbers(1)[k] = 0;
    }
    alignas(pack_alignment) Stored speeds, squares;
    speed.store(speeds);
    coefficients.store(squares);
    fastest_here_ = *std::max_element(speeds, speeds + stages());
    const double fastest = this->fastest();
    StepShape shape;
    shape.pace = pace_.at(numbers(0), numbers(1)).pace;
    const double rounding = StepShape::visible * largest;
    for (int k = 0; k < stages(); ++k) {
      const double size = std::sqrt(squares[k]);
      if (size > rounding) shape.decay[static_cast<std::size_t>(k)] = size * shape.pace / std::sqrt(fastest);
    }
    if (at_.model().loaded()) {
      const double size = std::abs(columns_.h()) * std::sqrt(missed_at_start());
      if (size > rounding) shape.beyond = size * shape.pace / std::sqrt(fastest);
    }
    return shape;
  }

  double accept() {
    const double brought = this->brought();
    find_increments();
    for (std::size_t k = 0; k < 2 * count_; ++k) state_[k].add(numbers_[k]);
    last_h_ = columns_.h();
    time_ += last_h_;
    for (std::size_t k = 0; k < count_; ++k) std::copy_n(a(k), Width, last_a_[k]);
    fastest_ = std::max(fastest_, std::exchange(fastest_here_, 0));
    return brought;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, state_, acceleration_, last_h_, masses_, pace_, fastest_, most_kinetic_, last_a_);
  }
  using FullState = std::vector<Compensated<double>>;  // q, then v
  void keep(FullState& place) const { place = state_; }
  void go_to(const FullState& place) { state_ = place; }

  State state(double time) const {
    State state(time, Eigen::VectorXd(index(count_)), Eigen::VectorXd(index(count_)));
    read_state(state.q.data(), state.v.data());
    return state;
  }

  /// The state within the last step, x steps after its beginning, by the polynomials through its rates and
  /// accelerations.
  State at(const FullState& begin, double time, double x) const {
    const auto up_to = columns_.up_to(x);
    State state(time, Eigen::VectorXd(index(count_)), Eigen::VectorXd(index(count_)));
    for (std::size_t k = 0; k < count_; ++k) {
      alignas(pack_alignment) Stored pushed, moved;
      find_advances(begin, k, pushed, moved);
      double place = begin[k].value, speed = begin[count_ + k].value;
      for (std::size_t j = 0; j < count_of_stages(); ++j) {
        place += up_to[j] * moved[j];
        speed += up_to[j] * pushed[j];
      }
      state.q[index(k)] = place;
      state.v[index(k)] = speed;
    }
    return state;
  }

  /// Bounds of how far coordinates and rates get within the last step from where they began.
  bool bound_excursions(const FullState& begin, double* q, double* v) const {
    for (std::size_t k = 0; k < count_; ++k) {
      alignas(pack_alignment) Stored pushed, moved;
      find_advances(begin, k, pushed, moved);
      q[k] = columns_.excursion(moved).integral;
      v[k] = columns_.excursion(pushed).integral;
    }
    return true;
  }

 protected:
  using L = Pack<Width, RegisterFor<Width>>;
  using Rows = PackRows<static_cast<std::size_t>(Width)>;
  using Stored = double[static_cast<std::size_t>(Width)];

  // h b times the accelerations and the rates at the stages of the last step.
  void find_advances(const FullState& begin, std::size_t k, Stored& pushed, Stored& moved) const {
    (columns_.hb() * L::load(last_a_[k])).store(pushed);
    (columns_.hb() * columns_.integral(pushed, L(begin[count_ + k].value))).store(moved);
  }

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }

  const SystemInfo& info() const { return at_.model().info(); }

  // K, Q, V of coordinate k at the stages.
  double* a(std::size_t k) { return stages_[k]; }
  const double* a(std::size_t k) const { return stages_[k]; }
  double* q(std::size_t k) { return stages_[count_ + k]; }
  const double* q(std::size_t k) const { return stages_[count_ + k]; }
  double* v(std::size_t k) { return stages_[2 * count_ + k]; }
  const double* v(std::size_t k) const { return stages_[2 * count_ + k]; }
  std::size_t count_of_stages() const { return static_cast<std::size_t>(columns_.stages()); }

  // Room for numbers of one state, (coordinates) each.
  double* numbers(std::size_t which) const { return numbers_.data() + which * count_; }

  // The system at one time.
  const SystemAt<1>& system_at(double time) const {
    here_.set_time(time);
    return here_;
  }

  void read_state(double* q, double* v) const {
    for (std::size_t k = 0; k < count_; ++k) {
      q[k] = state_[k].value;
      v[k] = state_[count_ + k].value;
    }
  }

  double fastest() const { return std::max({fastest_, fastest_here_, pace_.natural_speed_squared()}); }

  void predict(const StepTask& task) {
    if (task.from == PredictedFrom::nothing) last_h_ = 0;
    columns_.prepare(task.h, last_h_);
    is_predicted_ = last_h_ != 0;
    for (std::size_t k = 0; k < count_; ++k) {
      (is_predicted_ ? columns_.extrapolated(last_a_[k]) : L(acceleration_[k])).store(a(k));
    }
    last_h_ = 0;  // until the step is accepted, whose stages take the place of the last step's
  }

  // From the step that was solved last from this state, accepted or not.
  void predict_again(double h) {
    const Rows& found = last_h_ != 0 ? last_a_ : stages_;
    columns_.predict_at(0, h / (last_h_ != 0 ? last_h_ : columns_.h()));
    columns_.prepare(h, 0);
    for (std::size_t k = 0; k < count_; ++k) columns_.extrapolated(found[k]).store(a(k));
  }

  // How much larger the error of a prediction is than the defect of the step that it is from.
  double predictor_gain() const { return is_predicted_ ? columns_.predictor_gain() : 1; }

  // Energy that loads bring in the step, by the stages as they were placed last  [J].
  double brought() const {
    if (!at_.model().loaded()) return 0;
    alignas(pack_alignment) Stored powers;
    at_(&SystemFunctions::power, q(0), v(0), powers);
    double work = 0;
    for (std::size_t i = 0; i < count_of_stages(); ++i) work += columns_.hb(i) * powers[i];
    return work;
  }

  void place_stages() {
    for (std::size_t k = 0; k < count_; ++k) {
      const Compensated<double>&place = state_[k], &rate = state_[count_ + k];
      const L pushed = columns_.integral(columns_.hb() * L::load(a(k)), L(rate.compensation));
      const L moved =
          columns_.integral(columns_.hb() * pushed, fma(columns_.hc(), L(rate.value), L(place.compensation)));
      (L(place.value) + moved).store(q(k));
      (L(rate.value) + pushed).store(v(k));
    }
  }

  // The system at a share of the step, and q and v there in numbers(2) and numbers(3), by the polynomials through the
  // rates and accelerations of the stages, which are placed.
  const SystemAt<1>& along(double share) {
    const auto up_to = columns_.up_to(share);
    read_state(numbers(2), numbers(3));
    for (std::size_t k = 0; k < count_; ++k) {
      for (std::size_t j = 0; j < count_of_stages(); ++j) {
        numbers(2)[k] += up_to[j] * columns_.hb(j) * v(k)[j];
        numbers(3)[k] += up_to[j] * columns_.hb(j) * a(k)[j];
      }
    }
    return system_at(time_ + columns_.h() * share);
  }

  // Σ M_kk (v_k − polynomial through the stages' rates)² at the start of the step.
  double missed_at_start() const {
    double missed = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      alignas(pack_alignment) Stored advance;
      (columns_.hb() * L::load(v(k))).store(advance);
      const double off = weight_[k] * (columns_.at_start(advance) - state_[count_ + k].value);
      missed += off * off;
    }
    return missed;
  }

  // The most that an angle turns in the step, where one whose inertia nearly vanishes counts twice; and which it is.
  std::pair<double, int> farthest_turn() const {
    std::pair<double, int> farthest{0, -1};
    for (std::size_t k = 0; k < count_; ++k) {
      if (!info().is_angle[k]) continue;
      double turn = 0;
      for (std::size_t i = 0; i < count_of_stages(); ++i) turn += std::abs(columns_.hb(i) * v(k)[i]);
      if (masses_.is_small(k)) turn *= 2;
      if (turn > farthest.first) farthest = {turn, static_cast<int>(k)};
    }
    return farthest;
  }

  // What q and v change by over the step, into numbers(0) and numbers(1).
  void find_increments() {
    place_stages();
    for (std::size_t k = 0; k < count_; ++k) {
      numbers(0)[k] = numbers(1)[k] = 0;
      for (std::size_t j = 0; j < count_of_stages(); ++j) {
        numbers(0)[k] += columns_.hb(j) * v(k)[j];
        numbers(1)[k] += columns_.hb(j) * a(k)[j];
      }
    }
  }

  // Energy, and kinetic energy.
  std::array<double, 2> energies(double time, const double* q, const double* v) const {
    double energy = 0, kinetic = 0;
    system_at(time)(&SystemFunctions::energies, q, v, &kinetic, &energy);
    return {energy, kinetic};
  }

  SystemAt<Width> at_;
  mutable SystemAt<1> here_;
  detail::StageColumns<Eigen::Dynamic, double, Width> columns_;
  std::size_t count_;
  Rows stages_;  // K, Q, V, E
  Rows last_a_;  // of the last step
  FullState state_;
  std::vector<double> acceleration_;  // at the start of the run: predicts stages where no step does
  std::vector<double> weight_;
  MassScale<double> masses_;
  Pace<double> pace_;
  mutable std::vector<double> numbers_;  // workspace: four numbers of each coordinate
  double time_ = 0, most_kinetic_ = 0;
  double last_h_ = 0;  // size of the last accepted step; 0: its accelerations are not there
  bool is_predicted_ = false;
  double fastest_ = 0, fastest_here_ = 0;  // Σ M_kk v_k², of all steps so far and of the stages
};

}  // namespace pendula
