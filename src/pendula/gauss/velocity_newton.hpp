#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/gauss/node_polynomials.hpp>
#include <pendula/gauss/pace.hpp>
#include <pendula/gauss/stage_solver.hpp>
#include <pendula/gauss/stage_system.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/system_forcing.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/mass_scale.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// The stage equations in the paper's velocity form, E(q, v, a, t) = 0, of any system over its generated kernel:
/// symmetric, but not symplectic.
///
/// Unknown are the stage accelerations K_i, so that the mass matrix is never inverted;
///   Q_i = q + h c_i v + h² Σ_j (A²)_ij K_j,  V_i = v + h Σ_j a_ij K_j,  residual E(Q_i, V_i, K_i, t_i)  (paper eq.
///   27).
template <System S>
class VelocityNewton {
 public:
  using Model = SystemModel<S>;
  using Real = double;
  using Vector = typename S::template Vector<double>;
  using Matrix = typename S::template Matrix<double>;
  using State = SystemState<S>;

  /// Throws std::invalid_argument unless the method has so many stages.
  VelocityNewton(const Model& model, int stages, Family family = Family::gauss)
      : family_(family),
        model_(model),
        coefficients_(tableau_of<Eigen::Dynamic>(family, stages)),
        polynomials_(tableau_of<Eigen::Dynamic>(family, stages)),
        system_(stages),
        forcing_(family, stages),
        look_(stages, few_samples, argument_bases<S>()),
        at_(static_cast<std::size_t>(stages)) {
    for (Stage& stage : at_) stage.last_a.setZero();
  }

  Status start(const State& state) {
    forget();
    fastest_ = fastest_here_ = most_kinetic_ = 0;
    time_ = state.time;
    q_.assign(state.q);
    v_.assign(state.v);
    const auto parameters = model_.parameters(time_);
    pace_.start(model_, time_, state.q, state.v);
    masses_.start(parameters, state.q);
    if (masses_.singular() >= 0) return Status::singular_mass_matrix;
    S::acceleration(parameters, state.q, state.v, model_.inputs(time_), acceleration_);
    return Status::ok;
  }

  void prepare(double time, double h) {
    coefficients_.prepare(h, last_h_);
    set_context(time);
    for (int i = 0; i < stages(); ++i) {
      at(i).a = acceleration_;
      if (last_h_ != 0) extrapolate(at(i).a, i);
    }
    is_predicted_ = last_h_ != 0;
    last_h_ = 0;  // what was predicted from is gone until the step is accepted
    set_weights();
  }

  /// Predicts the stages of another step from where the last one began that was solved, accepted or not: from that
  /// one's.
  void prepare_again(double time, double h) {
    const bool is_accepted = last_h_ != 0;
    const double ratio = h / (is_accepted ? last_h_ : coefficients_.h());
    coefficients_.prepare(h, 0);
    set_context(time);
    std::array<Vector, max_stages> found;
    for (int i = 0; i < stages(); ++i) found[static_cast<std::size_t>(i)] = is_accepted ? at(i).last_a : at(i).a;
    for (int i = 0; i < stages(); ++i) {
      at(i).a.setZero();
      for (int j = 0; j < stages(); ++j) {
        at(i).a += coefficients_.lagrange(j, ratio * coefficients_.c(i)) * found[static_cast<std::size_t>(j)];
      }
    }
    set_weights();
  }

  Correction correct() {
    evaluate_with_jacobians();
    for (int i = 0; i < stages(); ++i) {
      system_.residual(i) = at(i).residual;
      for (int j = 0; j < stages(); ++j) system_.block(i, j) = block(i, j);
    }
    system_.solve();
    return apply();
  }

  static constexpr void allow_newton(bool) {}
  static constexpr Convergence convergence() { return Convergence::quadratic; }
  static constexpr Iteration iteration() { return Iteration::newton; }
  static constexpr int worst_part() { return -1; }
  int singular_part() const { return masses_.singular(); }
  static constexpr bool continues() { return true; }
  static constexpr double largest_turn() { return S::constant_masses ? 3 : 0.25; }
  bool loaded() const { return model_.loaded(); }
  bool damped() const { return model_.damped(); }
  double followed(double time, double h, double tolerance) {
    return forcing_.followed(model_, h, tolerance, [&] {
      return std::pair(State{time, q_.value, v_.value}, tempo().pace);
    });
  }
  bool dissipates() const { return family_ == Family::radau; }
  int stages() const { return coefficients_.stages(); }
  static constexpr int parts() { return S::coordinates; }
  static constexpr int coordinates() { return S::coordinates; }
  double predictor_gain() const { return is_predicted_ ? coefficients_.predictor_gain() : 1; }

  double turn() const { return farthest_turn().first; }
  int turning_part() const { return farthest_turn().second; }

  double energy_defect() {
    const auto [moved, pushed] = increments();
    const double brought = model_.loaded() ? work() : 0;
    const auto [h, T] = energies(time_, q_.value, v_.value);
    const auto [h_end, T_end] = energies(time_ + coefficients_.h(), q_.value + moved, v_.value + pushed);
    most_kinetic_ = std::max(most_kinetic_, T);
    const double scale = std::max(most_kinetic_, T_end) + std::abs(brought);
    return scale > 0 ? (h_end - h - brought) / scale : 0;
  }

  double defect() {
    const auto squared = [&](const Vector& v) { return v.cwiseProduct(weight_).squaredNorm(); };
    fastest_ = std::max({fastest_, squared(v_.value), squared(at(stages() - 1).v)});
    const double off = squared(missed_at_start());
    return off > 0 ? std::sqrt(off / fastest_) : 0;
  }

  Tempo tempo() const {
    Vector a;
    S::acceleration(model_.parameters(time_), q_.value, v_.value, model_.inputs(time_), a);
    return pace_.at(v_.value, a);
  }

  StepShape shape() {
    place_stages();
    const auto squared = [&](const Vector& v) { return v.cwiseProduct(weight_).squaredNorm(); };
    fastest_here_ = 0;
    for (int i = 0; i < stages(); ++i) fastest_here_ = std::max(fastest_here_, squared(at(i).v));
    const double fastest = std::max({fastest_, fastest_here_, pace_.natural_speed_squared()});
    StepShape shape;
    shape.pace = pace_.at(at(stages() / 2).v, Vector::Zero()).pace;
    double largest = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double size = std::max(std::abs(q_.value[index(k)]), S::coordinate_is_angle[k] ? 1.0 : 0.0);
      largest = std::max(largest, weight_[index(k)] * size);
    }
    const double rounding = StepShape::visible * largest;
    for (int k = 0; k < stages(); ++k) {
      Vector coefficient = Vector::Zero();
      for (int j = 0; j < stages(); ++j) {
        coefficient += polynomials_.legendre(static_cast<std::size_t>(k), static_cast<std::size_t>(j)) * at(j).v;
      }
      const double h = std::abs(coefficients_.h()), size = h * std::sqrt(squared(coefficient));
      if (size > rounding) shape.decay[static_cast<std::size_t>(k)] = size * shape.pace / std::sqrt(fastest);
    }
    if (stages() == StepShape::few_stages && loaded()) {
      const double size = std::abs(coefficients_.h()) * std::sqrt(squared(missed_at_start()));
      if (size > rounding) shape.beyond = size * shape.pace / std::sqrt(fastest);
    }
    return shape;
  }

  /// Of what forces do between the stages that were solved.
  Unseen unseen() requires tells_arguments<S> {
    shape();  // places the stages
    const auto at_all = [&](std::span<const double> shares, auto&& tell) {
      for (std::size_t i = 0; i < shares.size(); ++i) tell(i, along(shares[i]));
    };
    const auto find_arguments = [&](std::span<const double> shares, double* found) {
      at_all(shares, [&](std::size_t i, const State& there) {
        typename S::template Arguments<double> arguments;
        S::call_arguments(model_.parameters(there.time), there.q, there.v, model_.inputs(there.time), arguments);
        std::copy_n(arguments.data(), arguments.size(), found + i * S::argument_is_base.size());
      });
    };
    if (!look_.may_find(find_arguments) || !look_.finds(find_arguments)) return {};
    Vector sums, moments, missed;
    const auto accelerations = [&](std::span<const double> shares, double* found) {
      at_all(shares, [&](std::size_t i, const State& there) {
        Vector a;
        S::acceleration(model_.parameters(there.time), there.q, there.v, model_.inputs(there.time), a);
        std::copy_n(a.data(), count, found + i * count);
      });
    };
    look_.sum(accelerations, {{sums.data(), count}, {moments.data(), count}, {missed.data(), count}});
    const double fastest = std::max({fastest_, fastest_here_, pace_.natural_speed_squared()});
    const auto size_of = [&](const Vector& v) { return std::sqrt(v.cwiseProduct(weight_).squaredNorm() / fastest); };
    const double here = std::sqrt(fastest_here_ / fastest);
    const double h = coefficients_.h(), impulse = size_of(h * missed), lacks = size_of(h * sums - increments()[1]);
    return {std::max(impulse, lacks), lacks + Unseen::of_wall(impulse / here)};
  }

  double work() const {
    double work = 0;
    for (int i = 0; i < stages(); ++i) {
      double power = 0;
      S::power(at(i).parameters, at(i).q, at(i).v, at(i).inputs, power);
      work += coefficients_.hb(i) * power;
    }
    return work;
  }

  void accept() {
    const auto [moved, pushed] = increments();
    q_.add(moved);
    v_.add(pushed);
    last_h_ = coefficients_.h();
    time_ += last_h_;
    for (Stage& stage : at_) stage.last_a = stage.a;
    fastest_ = std::max(fastest_, std::exchange(fastest_here_, 0));
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time_, q_, v_, acceleration_, last_h_, masses_, pace_, fastest_, most_kinetic_);
    for (Stage& stage : at_) numbers(stage.last_a);
  }
  void save() { saved_ = {q_, v_}; }

  void restore() {
    q_ = saved_[0];
    v_ = saved_[1];
    forget();
  }

  State state(double time) const { return {time, q_.value, v_.value}; }

  void remember() { remembered_ = {q_, v_}; }
  void return_to_start() {
    q_ = remembered_[0];
    v_ = remembered_[1];
  }

  /// The state at x of the last step, by the polynomials through its rates and accelerations.
  State glance(double time, double x) const {
    const auto up_to = polynomials_.integrals(x);
    State state{time, remembered_[0].value, remembered_[1].value};
    for (int j = 0; j < stages(); ++j) {
      Vector v = remembered_[1].value;
      for (int k = 0; k < stages(); ++k) v += coefficients_.m(j, k) * (last_h_ * coefficients_.b(k)) * at(k).last_a;
      const double weight = last_h_ * up_to[static_cast<std::size_t>(j)];
      state.q += weight * v;
      state.v += weight * at(j).last_a;
    }
    return state;
  }

  /// The next step starts cold.
  void forget() { last_h_ = 0; }

 private:
  static constexpr std::size_t count = S::coordinates;
  static constexpr int few_samples = 3;  // for what may be narrow

  struct Stage {
    typename Model::Parameters parameters;
    typename Model::Inputs inputs;
    Vector q, v, a, last_a, residual;
    Matrix E_D_q, E_D_v, E_D_a;
  };

  static constexpr Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  Stage& at(int i) { return at_[static_cast<std::size_t>(i)]; }
  const Stage& at(int i) const { return at_[static_cast<std::size_t>(i)]; }

  void set_context(double time) {
    time_ = time;
    for (int i = 0; i < stages(); ++i) {
      at(i).parameters = model_.parameters(time + coefficients_.hc(i));
      at(i).inputs = model_.inputs(time + coefficients_.hc(i));
    }
  }

  void extrapolate(Vector& a, int i) const {
    a.setZero();
    for (int j = 0; j < stages(); ++j) a += coefficients_.extrapolation(i, j) * at(j).last_a;
  }

  void set_weights() {
    for (std::size_t k = 0; k < count; ++k) weight_[index(k)] = std::sqrt(masses_.inertia(k));
  }

  void place_stages() {
    for (int i = 0; i < stages(); ++i) {
      Vector moved = q_.compensation + coefficients_.hc(i) * v_.value;
      Vector pushed = v_.compensation;
      for (int j = 0; j < stages(); ++j) {
        moved += coefficients_.h2a2(i, j) * at(j).a;
        pushed += coefficients_.m(i, j) * (coefficients_.hb(j) * at(j).a);
      }
      at(i).q = q_.value + moved;
      at(i).v = v_.value + pushed;
    }
  }

  // At a share of the step, by the polynomials through the rates and accelerations of its stages, which are placed.
  State along(double share) const {
    const double h = coefficients_.h();
    const auto up_to = polynomials_.integrals(share);
    State state{time_ + h * share, q_.value, v_.value};
    for (int j = 0; j < stages(); ++j) {
      state.q += h * up_to[static_cast<std::size_t>(j)] * at(j).v;
      state.v += h * up_to[static_cast<std::size_t>(j)] * at(j).a;
    }
    return state;
  }

  // By how much the polynomial through the stages' rates is off at the start of the step.
  Vector missed_at_start() const {
    Vector missed = -v_.value;
    for (int i = 0; i < stages(); ++i) missed += coefficients_.lagrange(i, 0) * at(i).v;
    return missed;
  }

  // Of all angles, one whose inertia nearly vanishes counted twice; and whose it is.
  std::pair<double, int> farthest_turn() const {
    std::pair<double, int> farthest{0, -1};
    for (std::size_t k = 0; k < count; ++k) {
      if (!S::coordinate_is_angle[k]) continue;
      double turn = 0;
      for (int i = 0; i < stages(); ++i) turn += std::abs(coefficients_.hb(i) * at(i).v[index(k)]);
      if (masses_.is_small(k)) turn *= 2;
      if (turn > farthest.first) farthest = {turn, static_cast<int>(k)};
    }
    return farthest;
  }

  // Of q and v, over the step.
  std::array<Vector, 2> increments() {
    place_stages();
    Vector moved = Vector::Zero(), pushed = Vector::Zero();
    for (int j = 0; j < stages(); ++j) {
      moved += coefficients_.hb(j) * at(j).v;
      pushed += coefficients_.hb(j) * at(j).a;
    }
    return {moved, pushed};
  }

  void evaluate_with_jacobians() {
    place_stages();
    for (Stage& stage : at_) {
      S::residual_with_jacobians(stage.parameters, stage.q, stage.v, stage.a, stage.inputs, stage.residual, stage.E_D_q,
                                 stage.E_D_v, stage.E_D_a);
      masses_.see(stage.E_D_a);
    }
  }

  Matrix block(int i, int k) const {
    Matrix block = coefficients_.ha(i, k) * at(i).E_D_v + coefficients_.h2a2(i, k) * at(i).E_D_q;
    if (i == k) block += at(i).E_D_a;
    return block;
  }

  // Subtracts the solution from the accelerations; compared are the changes of rates that they make.
  Correction apply() {
    const double h = std::abs(coefficients_.h());
    double scale = v_.value.cwiseProduct(weight_).cwiseAbs().maxCoeff(), largest = 0;
    int worst = -1;
    for (int i = 0; i < stages(); ++i) {
      const Vector change = system_.correction(i);
      if (!change.allFinite()) return {std::numeric_limits<double>::quiet_NaN(), first_not_finite(change)};
      at(i).a -= change;
      scale = std::max(scale, h * at(i).a.cwiseProduct(weight_).cwiseAbs().maxCoeff());
      Eigen::Index k = 0;
      const double size = h * change.cwiseProduct(weight_).cwiseAbs().maxCoeff(&k);
      if (size < largest) continue;
      largest = size;
      worst = static_cast<int>(k);
    }
    return {largest > 0 ? largest / scale : 0, worst};
  }

  static int first_not_finite(const Vector& x) {
    Eigen::Index i = 0;
    while (i + 1 < x.size() && std::isfinite(x[i])) ++i;
    return static_cast<int>(i);
  }

  // h and T.
  std::array<double, 2> energies(double time, const Vector& q, const Vector& v) const {
    const auto parameters = model_.parameters(time);
    double energy = 0, kinetic = 0;
    S::energy(parameters, q, v, energy);
    S::kinetic_energy(parameters, q, v, kinetic);
    return {energy, kinetic};
  }

  Family family_;
  Model model_;
  StepCoefficients<Eigen::Dynamic> coefficients_;
  detail::NodePolynomials<Eigen::Dynamic, double> polynomials_;
  detail::StageSystem<S::coordinates> system_;
  SystemForcing<S> forcing_;
  FieldLook look_;
  std::vector<Stage> at_;
  Compensated<Vector> q_, v_;
  std::array<Compensated<Vector>, 2> saved_, remembered_;
  Vector acceleration_;  // at the start: the cold start of the predictor
  Vector weight_;
  MassScale<S> masses_;
  Pace<S> pace_;
  double time_ = 0, most_kinetic_ = 0;
  double last_h_ = 0;  // of the step that the last accelerations belong to; 0: they belong to none
  bool is_predicted_ = false;
  double fastest_ = 0, fastest_here_ = 0;  // Σ M_kk v_k², of all steps so far and of the stages
};

}  // namespace pendula
