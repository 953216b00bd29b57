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
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>

namespace pendula {

/// The stages of a step of any system in momentum form, q̇ = v(q, p), ṗ = f(q, v): what both iterations on them share.
///
/// Stages are held as increments, h b v of a coordinate and h b f of its momentum, all stages of one number in the
/// lanes of a pack; the state carries what it has lost to rounding:
///   Q = q + m U_q,  P = p + m U_p,  m_ij = a_ij / b_j.
/// `Width` is at least the number of stages, which is a run-time number: lanes beyond it repeat the start of the step.
///
/// Coordinates may have any units. Changes of them are compared as √M_kk dq_k, and those of momenta as dp_k / √M_kk.
template <System S, int Width>
class LagrangianStages {
 public:
  static constexpr int K = S::coordinates;
  static constexpr std::size_t count = K;
  using L = Pack<Width, RegisterFor<Width>>;
  using Lanes = typename S::template Vector<L>;
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;
  using Model = SystemModel<S>;
  using Columns = detail::StageColumns<Eigen::Dynamic, double, Width>;
  /// One number a lane.
  using Stored = double[static_cast<std::size_t>(Width)];

  LagrangianStages(const Model& model, int stages, Family family) : model_(model), columns_(family, stages) {
    S::cast_parameters(model.parameters(0), parameters_);
  }

  const Model& model() const { return model_; }
  const Columns& columns() const { return columns_; }
  int stages() const { return columns_.stages(); }
  double time_of(int stage) const { return time_ + columns_.h() * columns_.c(static_cast<std::size_t>(stage)); }

  double time_at(double share) const { return time_ + step_ * share; }

  // --- The state ---

  Status start(double time, const Vector& q, const Vector& v) {
    time_ = time;
    forget();
    fastest_ = fastest_here_ = most_kinetic_ = 0;
    steps_ = 0;
    pace_.start(model_, time, q, v);
    masses_.start(model_.parameters(time), q);
    Vector p;
    S::momentum_from_velocity(model_.parameters(time), q, v, p);
    for (std::size_t k = 0; k < count; ++k) {
      q_[k] = {q[at(k)], 0};
      p_[k] = {p[at(k)], 0};
    }
    turns_.fill(0);
    count_turns();
    read_masses();
    return masses_.singular() < 0 ? Status::ok : Status::singular_mass_matrix;
  }

  /// Coordinates, those that are periodic within a turn or so.
  Vector position() const { return values(q_); }
  /// The same with all turns that were made.
  Vector position_with_turns() const {
    Vector q;
    for (std::size_t k = 0; k < count; ++k) q[at(k)] = detail::with_turns(q_[k], turns_[k]);
    return q;
  }
  Vector momentum() const { return values(p_); }
  Vector velocity(double time) const {
    Vector v;
    S::velocity_from_momentum(model_.parameters(time), position(), momentum(), v);
    return v;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, q_, turns_, p_, U_, last_h_, masses_, weight_, pace_, fastest_, most_kinetic_, steps_);
  }
  void save() { saved_ = {q_, p_, turns_, time_}; }
  void restore() {
    take(saved_);
    read_masses();  // as they are here, not where the step failed
    forget();
  }

  /// Remembers the start of the step; goes back there, the stages still known.
  void remember() { remembered_ = {q_, p_, turns_, time_}; }
  void return_to_start() { take(remembered_); }

  /// The state at x of the last step, by the polynomials through its rates.
  SystemState<S> glance(double time, double x) const {
    const auto up_to = columns_.up_to(x), rate_at = columns_.rate_at(x, last_h_);
    SystemState<S> state;
    state.time = time;
    for (std::size_t k = 0; k < count; ++k) {
      Compensated<double> q = remembered_.q[k];
      double moved = 0, rate = 0;
      for (std::size_t j = 0; j < static_cast<std::size_t>(stages()); ++j) {
        moved += up_to[j] * U_[k][j];
        rate += rate_at[j] * U_[k][j];
      }
      q.add(moved);
      state.q[at(k)] = detail::with_turns(q, remembered_.turns[k]);
      state.v[at(k)] = rate;
    }
    return state;
  }

  // --- A step ---

  /// Predicts the stages of a step of size h: from the last step's, or cold where there was none like it.
  void prepare(double time, double h) {
    const bool alike = last_h_ != 0 && std::abs(h / last_h_) < farthest_extrapolation;
    time_ = time;
    columns_.prepare(h, alike ? last_h_ : 0);
    is_predicted_ = alike;
    set_context();
    if (alike) {
      for (auto& increments : U_) columns_.extrapolated_increments(increments).store(increments);
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
    set_context();
    for (auto& increments : U_) columns_.extrapolated_increments(increments).store(increments);
    step_ = h;
    set_scales();
  }

  /// Stages of a motion that goes on as at the start of the step.
  void start_cold() {
    const Vector q = position(), p = momentum();
    Vector v, f;
    S::hamiltonian_form(model_.parameters(time_), q, p, model_.inputs(time_), v, f);
    for (std::size_t k = 0; k < count; ++k) {
      (columns_.hb() * L(v[at(k)])).store(U_[k]);
      (columns_.hb() * L(f[at(k)])).store(U_[count + k]);
    }
    last_h_ = 0;
  }

  /// Coordinates, momenta at the stages.
  L position(std::size_t k) const { return L(q_[k].value) + columns_.integral(U_[k], L(q_[k].compensation)); }
  L momentum(std::size_t k) const { return L(p_[k].value) + columns_.integral(U_[count + k], L(p_[k].compensation)); }
  Lanes positions() const {
    Lanes Q;
    for (std::size_t k = 0; k < count; ++k) Q[at(k)] = position(k);
    return Q;
  }
  const Compensated<double>& momentum_before(std::size_t k) const { return p_[k]; }

  /// Makes sums of the rates of coordinates and momenta over the step what the stages lack of them; what momenta lack
  /// on the way displaces coordinates.
  void take_changes(std::span<double> sums, std::span<const double> moments) const {
    for (std::size_t k = 0; k < count; ++k) {
      double moved = 0;
      for (int j = 0; j < stages(); ++j) moved += (1 - columns_.c(static_cast<std::size_t>(j))) * U_[count + k][j];
      const double displaced = step_ * (step_ * moments[count + k] - moved) / (weight_[k] * weight_[k]);
      sums[k] = step_ * sums[k] - sum(U_[k]) + displaced;
      sums[count + k] = step_ * sums[count + k] - sum(U_[count + k]);
    }
  }
  double h() const { return step_; }

  /// h b v of coordinate k, h b f of its momentum.
  Stored& moved(std::size_t k) { return U_[k]; }
  Stored& pushed(std::size_t k) { return U_[count + k]; }
  const Stored& moved(std::size_t k) const { return U_[k]; }

  const typename S::template Parameters<L>& parameters() const { return parameters_; }
  const typename S::template Inputs<L>& inputs() const { return inputs_; }

  /// √M_kk at the start of the step.
  double weight(std::size_t k) const { return weight_[k]; }
  /// h over that.
  double inverse_weight(std::size_t k) const { return inverse_weight_[k]; }
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
    const double brought = model_.loaded() ? work() : 0;
    const Energies start = energies(time_, position(), momentum()), finish = energies_at_end();
    most_kinetic_ = std::max(most_kinetic_, start.kinetic);
    const double scale = std::max(most_kinetic_, finish.kinetic) + std::abs(brought);
    return scale > 0 ? (finish.total - start.total - brought) / scale : 0;
  }

  /// The same without its sign, relative to kinetic and potential energy, or to the energy that motion comes to from
  /// rest where it starts without any.
  double imbalance() {
    const double brought = model_.loaded() ? work() : 0;
    const Energies start = energies(time_, position(), momentum()), finish = energies_at_end();
    const double scale = std::max({start.size(), finish.size(), pace_.natural_speed_squared()}) + std::abs(brought);
    return scale > 0 ? std::abs(finish.total - start.total - brought) / scale : 0;
  }

  /// How far, at the start of the step, the polynomial through the stages' rates is off, relative to the fastest motion
  /// that there was; both as √(Σ M_kk v_k²).
  double defect() {
    const Vector v = velocity(time_);
    double speed = 0, later = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double weight = weight_[k];
      const double last = weight * U_[k][stages() - 1] / columns_.hb(static_cast<std::size_t>(stages() - 1));
      speed += weight * weight * v[at(k)] * v[at(k)];
      later += last * last;
    }
    fastest_ = std::max({fastest_, speed, later});
    const double missed = missed_at_start(v);
    return missed > 0 ? std::sqrt(missed / fastest_) : 0;
  }
  double predictor_gain() const { return is_predicted_ ? columns_.predictor_gain() : 1; }

  Tempo tempo() const {
    const Vector q = position(), v = velocity(time_);
    Vector a;
    S::acceleration(model_.parameters(time_), q, v, model_.inputs(time_), a);
    return pace_.at(v, a);
  }

  /// Of the stages as they were solved. Sizes of rates are √(Σ M_kk v_k²).
  StepShape shape() {
    const L inverse = inverse_hb();
    L eighth_powers(0.0), speed(0.0), coefficients(0.0);
    for (std::size_t k = 0; k < count; ++k) {
      const L v = L::load(U_[k]) * inverse, a = columns_.legendre(U_[k]), square = v * v;
      const L weight(weight_[k] * weight_[k]);
      if (S::coordinate_is_angle[k]) eighth_powers = fma(square * square, square * square, eighth_powers);
      speed = fma(weight, square, speed);
      coefficients = fma(weight * a, a, coefficients);
    }
    return shape_of(eighth_powers, speed, coefficients);
  }

  /// Coordinates and momenta at shares of the step, by the polynomials through the stages' rates.
  void along(const L& shares, Lanes& Q, Lanes& P) const {
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
    const auto reach = [&](const Compensated<double>& start, const Stored& increments) {
      columns_.legendre(increments).store(coefficients);
      L moved(start.compensation);
      for (int m = 0; m < stages(); ++m) moved = fma(L(coefficients[m]), integrals[static_cast<std::size_t>(m)], moved);
      return L(start.value) + moved;
    };
    for (std::size_t k = 0; k < count; ++k) {
      Q[at(k)] = reach(q_[k], U_[k]);
      P[at(k)] = reach(p_[k], U_[count + k]);
    }
  }

  /// The size of changes of coordinates and momenta, relative to the speed of the motion.
  double size_of(std::span<const double> changes, double pace) const {
    double places = 0, pushes = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double place = weight_[k] * changes[k], push = changes[count + k] / weight_[k];
      places += place * place;
      pushes += push * push;
    }
    return std::sqrt((pace * pace * places + pushes) / fastest());
  }
  /// Looks how fast stages are, that were solved.
  void see_speed() {
    const L inverse = inverse_hb();
    L speed(0.0);
    for (std::size_t k = 0; k < count; ++k) {
      const L v = L(weight_[k]) * L::load(U_[k]) * inverse;
      speed = fma(v, v, speed);
    }
    alignas(pack_alignment) Stored speeds;
    speed.store(speeds);
    fastest_here_ = *std::max_element(speeds, speeds + stages());
  }
  /// The fastest of the stages, of the speed of the motion.
  double speed_here() const { return std::sqrt(fastest_here_ / fastest()); }

  /// Energy that forces, and what holds time, bring in the step.
  double work() const {
    Lanes V;
    for (std::size_t k = 0; k < count; ++k) V[at(k)] = L::load(U_[k]);
    // Of increments h b v, not of rates: lanes beyond the stages have b = 0, where nothing can be divided by it.
    const L inverse = inverse_hb();
    for (std::size_t k = 0; k < count; ++k) V[at(k)] = V[at(k)] * inverse;
    L power(0.0);
    S::power(parameters_, positions(), V, inputs_, power);
    alignas(pack_alignment) Stored each;
    (columns_.hb() * power).store(each);
    double work = 0;
    for (int j = 0; j < stages(); ++j) work += each[j];
    return work;
  }

  /// A coordinate whose inertia has vanished at the end of the step, −1 where none has.
  int singular_coordinate() const { return masses_.singular(); }

  /// Moves the state to the end of the step.
  void accept() {
    for (std::size_t k = 0; k < count; ++k) {
      q_[k].add(sum(U_[k]));
      p_[k].add(sum(U_[count + k]));
    }
    count_turns();
    last_h_ = step_;
    time_ += step_;
    fastest_ = std::max(fastest_, std::exchange(fastest_here_, 0));
    if (!S::constant_masses || ++steps_ % 16 == 0) read_masses();
  }

  void forget() { last_h_ = 0; }

 private:
  struct Energies {
    double kinetic = 0, total = 0;
    double size() const { return std::abs(kinetic) + std::abs(total - kinetic); }
  };

  Energies energies(double time, const Vector& q, const Vector& p) const {
    const auto parameters = model_.parameters(time);
    Vector v;
    Energies found;
    S::velocity_from_momentum(parameters, q, p, v);
    S::energy(parameters, q, v, found.total);
    S::kinetic_energy(parameters, q, v, found.kinetic);
    return found;
  }
  Energies energies_at_end() {
    const auto [q, p] = end();
    return energies(time_ + step_, q, p);
  }

  using State = std::array<Compensated<double>, count>;

  struct Kept {
    State q, p;
    std::array<double, count> turns;
    double time;
  };
  void take(const Kept& kept) {
    q_ = kept.q;
    p_ = kept.p;
    turns_ = kept.turns;
    time_ = kept.time;
  }

  // Of coordinates: what corrections need not be compared with.
  static constexpr double invisible = 1e-9;

  // Farther than this the polynomial of the last step is no prediction.
  static constexpr double farthest_extrapolation = 1.5;

  static constexpr Eigen::Index at(std::size_t k) { return static_cast<Eigen::Index>(k); }

  static Vector values(const State& state) {
    Vector values;
    for (std::size_t k = 0; k < count; ++k) values[at(k)] = state[k].value;
    return values;
  }

  double fastest() const { return std::max({fastest_, fastest_here_, pace_.natural_speed_squared()}); }

  double sum(const Stored& increments) const {
    double sum = 0;
    for (int j = 0; j < stages(); ++j) sum += increments[j];
    return sum;
  }

  std::pair<double, int> farthest_turn() const {
    std::pair<double, int> farthest{0, -1};
    for (std::size_t k = 0; k < count; ++k) {
      if (!S::coordinate_is_angle[k]) continue;
      double turn = 0;
      for (int j = 0; j < stages(); ++j) turn += std::abs(U_[k][j]);
      if (masses_.is_small(k)) turn *= 2;
      if (turn > farthest.first) farthest = {turn, static_cast<int>(k)};
    }
    return farthest;
  }

  // Where the step ends.
  std::array<Vector, 2> end() const {
    std::array<Vector, 2> end{position(), momentum()};
    for (std::size_t k = 0; k < count; ++k) {
      end[0][at(k)] += q_[k].compensation + sum(U_[k]);
      end[1][at(k)] += p_[k].compensation + sum(U_[count + k]);
    }
    return end;
  }

  // Σ M_kk (v_k − what the polynomial through the stages' rates is there)², v being the rates at the start of the step.
  double missed_at_start(const Vector& v) const {
    double missed = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double off = weight_[k] * (columns_.at_start(U_[k]) - v[at(k)]);
      missed += off * off;
    }
    return missed;
  }

  void count_turns() {
    for (std::size_t k = 0; k < count; ++k) {
      if (S::coordinate_is_periodic[k]) detail::take_out_turns(q_[k], turns_[k]);
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
    alignas(pack_alignment) Stored powers, speeds, squares;
    eighth_powers.store(powers);
    speed.store(speeds);
    coefficients.store(squares);
    fastest_here_ = *std::max_element(speeds, speeds + stages());
    StepShape shape;
    shape.pace = pace_.of(powers[stages() / 2]);
    const double scale = fastest() > 0 ? shape.pace / std::sqrt(fastest()) : 0;
    const double rounding = StepShape::visible * floor_ / invisible;
    for (int k = 0; k < stages(); ++k) {
      const double size = std::sqrt(squares[k]);
      shape.decay[static_cast<std::size_t>(k)] = size > rounding ? scale * size : 0;
    }
    if (stages() == StepShape::few_stages && model_.loaded()) {
      const double size = std::abs(step_) * std::sqrt(missed_at_start(velocity(time_)));
      if (size > rounding) shape.beyond = scale * size;
    }
    return shape;
  }

  // Time and inputs at the stages.
  void set_context() {
    if (is_set_ && !model_.driven()) return;
    alignas(pack_alignment) Stored times;
    for (int j = 0; j < Width; ++j) times[j] = j < stages() ? time_of(j) : time_;
    if constexpr (holds_time<S>) parameters_.time = L::load(times);
    alignas(pack_alignment) std::array<Stored, static_cast<std::size_t>(Model::Inputs::SizeAtCompileTime)> given;
    for (int j = 0; j < Width; ++j) {
      const auto inputs = model_.inputs(times[j]);
      for (std::size_t i = 0; i < given.size(); ++i) given[i][j] = inputs.data()[i];
    }
    for (std::size_t i = 0; i < given.size(); ++i) inputs_.data()[i] = L::load(given[i]);
    is_set_ = true;
  }

  void read_masses() {
    masses_.read(model_.parameters(time_), position());
    for (std::size_t k = 0; k < count; ++k) weight_[k] = std::sqrt(masses_.inertia(k));
  }

  void set_scales() {
    floor_ = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double size = std::max(std::abs(q_[k].value), S::coordinate_is_angle[k] ? 1.0 : 0.0);
      floor_ = std::max(floor_, invisible * weight_[k] * size);
      inverse_weight_[k] = std::abs(step_) / weight_[k];
    }
  }

  Model model_;
  Columns columns_;
  typename S::template Parameters<L> parameters_;
  typename S::template Inputs<L> inputs_;
  alignas(pack_alignment) Stored U_[2 * count]{};
  State q_, p_;
  std::array<double, count> turns_{};
  Kept saved_{}, remembered_{};
  MassScale<S> masses_;
  std::array<double, count> weight_{}, inverse_weight_{};
  Pace<S> pace_;
  double floor_ = 0, time_ = 0, step_ = 0, last_h_ = 0;
  double fastest_ = 0, fastest_here_ = 0;  // Σ M_kk v_k², of all steps so far and of the stages
  double most_kinetic_ = 0;
  std::int64_t steps_ = 0;
  bool is_predicted_ = false, is_set_ = false;
};

}  // namespace pendula
