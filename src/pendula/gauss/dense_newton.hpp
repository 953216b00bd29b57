#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/kernel_traits.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/linear_system.hpp>
#include <pendula/system/outcome.hpp>
#include <type_traits>
#include <vector>

namespace pendula {

namespace detail {

/// One T a stage: on the stack where the number of stages is known.
template <class T, int S>
class PerStage {
 public:
  explicit PerStage(int stages) {
    if constexpr (S == Eigen::Dynamic) values_.resize(static_cast<std::size_t>(stages));
  }
  T& operator[](int stage) { return values_[static_cast<std::size_t>(stage)]; }
  const T& operator[](int stage) const { return values_[static_cast<std::size_t>(stage)]; }

 private:
  std::conditional_t<S == Eigen::Dynamic, std::vector<T>,
                     std::array<T, static_cast<std::size_t>(S == Eigen::Dynamic ? 1 : S)>>
      values_;
};

/// The linear system of one Newton iteration: one block row and column a stage.
template <int Block, int S>
class StageSystem : public LinearSystem<S == Eigen::Dynamic ? Eigen::Dynamic : Block * S> {
  using Base = LinearSystem<S == Eigen::Dynamic ? Eigen::Dynamic : Block * S>;

 public:
  explicit StageSystem(int stages) : Base(Block * stages) {}

  auto block(int i, int j) { return this->matrix.template block<Block, Block>(Block * i, Block * j); }
  auto residual(int i) { return this->right.template segment<Block>(Block * i); }
  auto correction(int i) const { return this->solution.template segment<Block>(Block * i); }
};

/// What both forms of the dense equations share: the model, the step's coefficients and torques, and the stage system.
template <class Kernel, int S>
class DenseStages {
 public:
  using Space = SpaceOf<Kernel>;
  using Chain = pendula::Chain<Space>;
  using State = pendula::State<Space>;
  using Real = double;
  using Vector = typename Kernel::template Vector<double>;
  using Matrix = typename Kernel::template Matrix<double>;
  using Parameters = typename Kernel::template Parameters<double>;
  using KernelTorque = typename Kernel::template Torque<double>;
  static constexpr Convergence convergence() { return Convergence::quadratic; }
  static constexpr Iteration iteration() { return Iteration::newton; }
  static constexpr int worst_link() { return -1; }
  static constexpr bool continues() { return true; }
  bool loaded() const { return chain_.loaded(); }
  bool damped() const { return chain_.damped(); }
  bool dissipates() const { return family_ == Family::radau; }
  int stages() const { return coefficients_.stages(); }
  double predictor_gain() const { return last_h_ == 0 ? 1 : coefficients_.predictor_gain(); }
  static constexpr double largest_turn = Space::dof == 1 ? 3 : 0.25;  // near a pole φ moves faster than all else

  /// Link whose coordinates fail at the last evaluated stages, −1 where none does.
  int singular_link() const { return singular_link_; }

  /// Stage i as it stands: its velocities, in velocity form its accelerations.
  const Vector& stage(int i) const { return unknown_[i]; }

 protected:
  DenseStages(const Chain& chain, int s, Family family)
      : family_(family),
        chain_(chain),
        parameters_(kernel_parameters<Kernel>(chain)),
        coefficients_(tableau_of<S>(family, s)),
        system_(s),
        torque_(s),
        unknown_(s),
        last_unknown_(s) {
    for (int i = 0; i < s; ++i) chain_.torque(0, torque_[i]);
  }

  void prepare_step(double time, double h) {
    coefficients_.prepare(h, last_h_);
    if (chain_.driven()) {
      for (int i = 0; i < stages(); ++i) chain_.torque(time + coefficients_.hc(i), torque_[i]);
    }
  }

  /// Extrapolates the last step's stage polynomial of the unknown, or starts cold.
  void predict(const Vector& cold_start) {
    for (int i = 0; i < stages(); ++i) {
      if (last_h_ == 0) {
        unknown_[i] = cold_start;
        continue;
      }
      unknown_[i].setZero();
      for (int j = 0; j < stages(); ++j) unknown_[i] += coefficients_.extrapolation(i, j) * last_unknown_[j];
    }
  }

  void remember() {
    last_h_ = coefficients_.h();
    last_unknown_ = unknown_;
  }

  void forget() { last_h_ = 0; }

  /// Subtracts the solution of the stage system from the unknowns; its size relative to the largest, or to `scale`.
  Correction apply_correction(double scale) {
    Correction worst{0, -1};
    for (int i = 0; i < stages(); ++i) {
      const Vector change = system_.correction(i);
      unknown_[i] -= change;
      scale = std::max(scale, unknown_[i].cwiseAbs().maxCoeff());
      Eigen::Index at = 0;
      const double size = change.cwiseAbs().maxCoeff(&at);
      if (!change.allFinite()) return {std::numeric_limits<double>::quiet_NaN(), link_of(change)};
      if (size >= worst.relative) worst = {size, static_cast<int>(at) % Kernel::links};
    }
    if (worst.relative > 0) worst.relative /= scale;
    return worst;
  }

  /// Energy at (q, v) less that at the start of the step and what loads bring, at stages (positions, velocities), in
  /// units of all that the chain has.
  double energy_defect(const Vector& q_start, const Vector& v_start, const Vector& q, const Vector& v, double brought) {
    const Energies<double> start = energies(chain_, at(q_start, v_start)), end = energies(chain_, at(q, v));
    const double scale = start.kinetic + energy_scale(chain_) + std::abs(brought);
    return (end.total() - start.total() - brought) / (scale > 0 ? scale : 1);
  }

  /// How far the polynomial through the stages' velocities is off at the start of the step, where it is v: of bobs,
  /// relative to the fastest so far.
  double defect_at(const Vector& q, const Vector& v, const PerStage<Vector, S>& velocities) {
    Vector missed = -v;
    for (int i = 0; i < stages(); ++i) missed += coefficients_.lagrange(i, 0) * velocities[i];
    double furthest = 0;
    const auto squared_speed = [&](const Vector& rates, double& largest) {
      for_each_bob(chain_, at(q, rates),
                   [&](int, const auto&, const auto& w) { largest = std::max(largest, w.squaredNorm()); });
    };
    squared_speed(missed, furthest);
    squared_speed(v, fastest_);
    squared_speed(velocities[stages() - 1], fastest_);
    return furthest > 0 ? std::sqrt(furthest / fastest_) : 0;
  }

  /// Energy that torque and damping bring in the step  [J].
  double work_at(const PerStage<Vector, S>& positions, const PerStage<Vector, S>& velocities) const {
    double work = 0;
    if (!chain_.loaded()) return work;
    for (int i = 0; i < stages(); ++i) {
      work += coefficients_.hb(i) * load_power(chain_, at(positions[i], velocities[i]), torque_[i]);
    }
    return work;
  }

  // At a pole, one coordinate of a link carries no mass while its other one does. The mass ratio is sin²θ; below this
  // limit φ has lost more than half of its digits.
  void check_masses(const Matrix& mass_matrix) {
    static constexpr double singular = 1e-12;
    for (int link = 0; link < Kernel::links; ++link) {
      double least = std::numeric_limits<double>::infinity();
      double most = 0;
      for (int a = link; a < Kernel::coordinates; a += Kernel::links) {
        least = std::min(least, mass_matrix(a, a));
        most = std::max(most, mass_matrix(a, a));
      }
      if (least < singular * most) singular_link_ = link;
    }
  }

  /// The most that a coordinate changes in the step, φ near a pole twice: it does not go on like that there  [rad].
  double turn_of(const PerStage<Vector, S>& positions, const PerStage<Vector, S>& velocities) const {
    double turn = 0;
    for (int i = 0; i < stages(); ++i) {
      turn += std::abs(coefficients_.hb(i)) * fastest_coordinate(positions[i], velocities[i]);
    }
    return turn;
  }
  static double fastest_coordinate(const Vector& q, const Vector& v) {
    if constexpr (Space::dof == 1) {
      return v.cwiseAbs().maxCoeff();
    } else {
      double fastest = v.template head<Kernel::links>().cwiseAbs().maxCoeff();
      for (int i = 0; i < Kernel::links; ++i) {
        const double phi_dot = std::abs(v[Kernel::links + i]);
        fastest = std::max(fastest, std::abs(std::sin(q[i])) < 0.25 ? 2 * phi_dot : phi_dot);
      }
      return fastest;
    }
  }

  static pendula::State<Space, Kernel::links> at(const Vector& q, const Vector& v) { return {0, q, v}; }

  static int link_of(const Vector& with_non_finite) {
    int i = 0;
    while (i + 1 < Kernel::coordinates && std::isfinite(with_non_finite[i])) ++i;
    return i % Kernel::links;
  }

  Family family_;
  Chain chain_;
  Parameters parameters_;
  StepCoefficients<S> coefficients_;
  StageSystem<Kernel::coordinates, S> system_;
  PerStage<KernelTorque, S> torque_;
  PerStage<Vector, S> unknown_, last_unknown_;
  double last_h_ = 0;
  double fastest_ = 0;  // bob since the start of the run, squared  [m²/s²]
  int singular_link_ = -1;
};

}  // namespace detail

/// The stage equations in momentum form, q̇ = v, ṗ = ∂L/∂q + Q, p = ∂L/∂v, for any generated kernel: symplectic.
///
/// Unknown are the stage velocities V_i; Q_i = q + h Σ_j a_ij V_j, and the residual of stage i is
///   ∂L/∂v(Q_i, V_i) − p − h Σ_j a_ij f_j,   f_j = ∂L/∂q(Q_j, V_j) + Q(Q_j, V_j, t_j).
/// Newton's matrix is the exact one, from the kernel's generated Jacobians.
template <class Kernel, int S = Eigen::Dynamic>
class DenseMomentumNewton : public detail::DenseStages<Kernel, S> {
  using Base = detail::DenseStages<Kernel, S>;
  using Base::chain_, Base::parameters_, Base::coefficients_, Base::system_, Base::torque_, Base::unknown_;
  using Base::singular_link_;

 public:
  using Base::stages;
  using typename Base::Chain, typename Base::Matrix, typename Base::Space, typename Base::State, typename Base::Vector;

  /// Throws std::invalid_argument if the chain has another number of links, or there is no tableau with `s` stages.
  DenseMomentumNewton(const Chain& chain, int s, Family family = Family::gauss)
      : Base(chain, s, family), position_(s), momentum_(s), force_(s), p_D_q_(s), p_D_v_(s), f_D_q_(s), f_D_v_(s) {}

  Status start(const State& state) {
    this->forget();
    this->fastest_ = 0;
    singular_link_ = -1;
    const Vector q = state.q;
    velocity_ = state.v;
    Matrix mass_matrix;
    Kernel::mass_matrix(parameters_, q, mass_matrix);
    this->check_masses(mass_matrix);
    Vector p;
    Kernel::momentum_from_velocity(parameters_, q, velocity_, p);
    q_.assign(q);
    p_.assign(p);
    return singular_link_ < 0 ? Status::ok : Status::singular_mass_matrix;
  }

  void prepare(double time, double h) {
    this->prepare_step(time, h);
    this->predict(velocity_);
  }

  Correction correct() {
    evaluate_with_jacobians();
    for (int i = 0; i < stages(); ++i) {
      system_.residual(i) = residual(i);
      for (int j = 0; j < stages(); ++j) system_.block(i, j) = block(i, j);
    }
    system_.solve();
    return this->apply_correction(0);
  }

  double energy_defect() {
    const auto [moved, pushed] = increments();
    const Vector q = q_.value + moved, p = p_.value + pushed;
    Vector v_start, v;
    Kernel::velocity_from_momentum(parameters_, q_.value, p_.value, v_start);
    Kernel::velocity_from_momentum(parameters_, q, p, v);
    return Base::energy_defect(q_.value, v_start, q, v, work());
  }

  double defect() {
    Vector v;
    Kernel::velocity_from_momentum(parameters_, q_.value, p_.value, v);
    return this->defect_at(q_.value, v, unknown_);
  }

  double work() const { return this->work_at(position_, unknown_); }
  double turn() const { return this->turn_of(position_, unknown_); }

  void accept() {
    const auto [moved, pushed] = increments();
    q_.add(moved);
    p_.add(pushed);
    this->remember();
  }

  void save() { saved_ = {q_, p_}; }

  void restore() {
    q_ = saved_[0];
    p_ = saved_[1];
    this->forget();
    Kernel::velocity_from_momentum(parameters_, q_.value, p_.value, velocity_);
  }

  State state(double time) const {
    Vector v;
    Kernel::velocity_from_momentum(parameters_, q_.value, p_.value, v);
    return {time, q_.value, v};
  }

  const Vector& momentum() const { return p_.value; }

 private:
  // The increment is summed first, together with what q has lost to rounding, and meets q once.
  void place_stages() {
    for (int i = 0; i < stages(); ++i) {
      Vector moved = q_.compensation;
      for (int j = 0; j < stages(); ++j) moved += coefficients_.m(i, j) * (coefficients_.hb(j) * unknown_[j]);
      position_[i] = q_.value + moved;
    }
  }

  // Of q and p, over the step.
  std::array<Vector, 2> increments() {
    place_stages();
    for (int i = 0; i < stages(); ++i) {
      Kernel::momentum_form(parameters_, position_[i], unknown_[i], torque_[i], momentum_[i], force_[i]);
    }
    Vector moved = Vector::Zero(), pushed = Vector::Zero();
    for (int j = 0; j < stages(); ++j) {
      moved += coefficients_.hb(j) * unknown_[j];
      pushed += coefficients_.hb(j) * force_[j];
    }
    return {moved, pushed};
  }

  void evaluate_with_jacobians() {
    place_stages();
    singular_link_ = -1;
    for (int i = 0; i < stages(); ++i) {
      Kernel::momentum_form_with_jacobians(parameters_, position_[i], unknown_[i], torque_[i], momentum_[i], force_[i],
                                           p_D_q_[i], p_D_v_[i], f_D_q_[i], f_D_v_[i]);
      this->check_masses(p_D_v_[i]);
    }
  }

  Vector residual(int i) const {
    Vector pushed = p_.compensation;
    for (int j = 0; j < stages(); ++j) pushed += coefficients_.m(i, j) * (coefficients_.hb(j) * force_[j]);
    return (momentum_[i] - p_.value) - pushed;
  }

  // ∂(residual i)/∂V_k, by the chain rule through Q_j = … + h a_jk V_k.
  Matrix block(int i, int k) const {
    Matrix block = coefficients_.ha(i, k) * (p_D_q_[i] - f_D_v_[k]);
    if (i == k) block += p_D_v_[i];
    for (int j = 0; j < stages(); ++j) block -= (coefficients_.ha(i, j) * coefficients_.ha(j, k)) * f_D_q_[j];
    return block;
  }

  Compensated<Vector> q_, p_;
  std::array<Compensated<Vector>, 2> saved_;
  Vector velocity_;  // the cold start of the predictor
  detail::PerStage<Vector, S> position_, momentum_, force_;
  detail::PerStage<Matrix, S> p_D_q_, p_D_v_, f_D_q_, f_D_v_;
};

/// The stage equations in the paper's velocity form, E(q, v, a, t) = 0, for any generated kernel: symmetric, but not
/// symplectic.
///
/// Unknown are the stage accelerations K_i, so that the mass matrix is never inverted;
///   Q_i = q + h c_i v + h² Σ_j (A²)_ij K_j,  V_i = v + h Σ_j a_ij K_j,  residual E(Q_i, V_i, K_i, t_i)  (paper eq.
///   27).
template <class Kernel, int S = Eigen::Dynamic>
class DenseVelocityNewton : public detail::DenseStages<Kernel, S> {
  using Base = detail::DenseStages<Kernel, S>;
  using Base::chain_, Base::parameters_, Base::coefficients_, Base::system_, Base::torque_, Base::unknown_;
  using Base::singular_link_;

 public:
  using Base::stages;
  using typename Base::Chain, typename Base::Matrix, typename Base::Space, typename Base::State, typename Base::Vector;

  /// Throws std::invalid_argument if the chain has another number of links, or there is no tableau with `s` stages.
  DenseVelocityNewton(const Chain& chain, int s, Family family = Family::gauss)
      : Base(chain, s, family), position_(s), velocity_(s), residual_(s), E_D_q_(s), E_D_v_(s), E_D_a_(s) {}

  Status start(const State& state) {
    this->forget();
    this->fastest_ = 0;
    singular_link_ = -1;
    q_.assign(Vector(state.q));
    v_.assign(Vector(state.v));
    Matrix mass_matrix;
    Kernel::mass_matrix(parameters_, q_.value, mass_matrix);
    this->check_masses(mass_matrix);
    if (singular_link_ >= 0) return Status::singular_mass_matrix;
    chain_.torque(state.time, torque_[0]);
    Kernel::acceleration(parameters_, q_.value, v_.value, torque_[0], acceleration_);
    return Status::ok;
  }

  void prepare(double time, double h) {
    this->prepare_step(time, h);
    this->predict(acceleration_);
  }

  Correction correct() {
    evaluate_with_jacobians();
    for (int i = 0; i < stages(); ++i) {
      system_.residual(i) = residual_[i];
      for (int j = 0; j < stages(); ++j) system_.block(i, j) = block(i, j);
    }
    system_.solve();
    return this->apply_correction(v_.value.cwiseAbs().maxCoeff() / std::abs(coefficients_.h()));
  }

  double energy_defect() {
    const auto [moved, pushed] = increments();
    return Base::energy_defect(q_.value, v_.value, q_.value + moved, v_.value + pushed, work());
  }

  double defect() { return this->defect_at(q_.value, v_.value, velocity_); }

  double work() const { return this->work_at(position_, velocity_); }
  double turn() const { return this->turn_of(position_, velocity_); }

  void accept() {
    const auto [moved, pushed] = increments();
    q_.add(moved);
    v_.add(pushed);
    this->remember();
  }

  void save() { saved_ = {q_, v_}; }

  void restore() {
    q_ = saved_[0];
    v_ = saved_[1];
    this->forget();
  }

  State state(double time) const { return {time, q_.value, v_.value}; }

 private:
  void place_stages() {
    for (int i = 0; i < stages(); ++i) {
      Vector moved = q_.compensation + coefficients_.hc(i) * v_.value;
      Vector pushed = v_.compensation;
      for (int j = 0; j < stages(); ++j) {
        moved += coefficients_.h2a2(i, j) * unknown_[j];
        pushed += coefficients_.m(i, j) * (coefficients_.hb(j) * unknown_[j]);
      }
      position_[i] = q_.value + moved;
      velocity_[i] = v_.value + pushed;
    }
  }

  // Of q and v, over the step.
  std::array<Vector, 2> increments() {
    place_stages();
    Vector moved = Vector::Zero(), pushed = Vector::Zero();
    for (int j = 0; j < stages(); ++j) {
      moved += coefficients_.hb(j) * velocity_[j];
      pushed += coefficients_.hb(j) * unknown_[j];
    }
    return {moved, pushed};
  }

  void evaluate_with_jacobians() {
    place_stages();
    singular_link_ = -1;
    for (int i = 0; i < stages(); ++i) {
      Kernel::residual_with_jacobians(parameters_, position_[i], velocity_[i], unknown_[i], torque_[i], residual_[i],
                                      E_D_q_[i], E_D_v_[i], E_D_a_[i]);
      this->check_masses(E_D_a_[i]);
    }
  }

  Matrix block(int i, int k) const {
    Matrix block = coefficients_.ha(i, k) * E_D_v_[i] + coefficients_.h2a2(i, k) * E_D_q_[i];
    if (i == k) block += E_D_a_[i];
    return block;
  }

  Compensated<Vector> q_, v_;
  std::array<Compensated<Vector>, 2> saved_;
  Vector acceleration_;  // at the start: the cold start of the predictor
  detail::PerStage<Vector, S> position_, velocity_, residual_;
  detail::PerStage<Matrix, S> E_D_q_, E_D_v_, E_D_a_;
};

}  // namespace pendula
