#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/chain/chain_newton.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/chain_tangent.hpp>
#include <pendula/gauss/iteration_choice.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/stop_sign.hpp>

namespace pendula {

/// Cost of one Newton iteration on a chain in fixed-point iterations, by space and stages, as measured on ten links
/// (g++ 12; the mean of AVX2 and AVX-512, which are up to a half apart). It grows with the cube of the blocks that
/// Newton eliminates, and hardly with the links.
template <class Space>
constexpr double newton_cost(int stages) {
  constexpr std::array<double, 8> planar{2.1, 4.8, 9.0, 10.5, 15.5, 18.0, 23.0, 30.0};
  constexpr std::array<double, 8> spatial{4.3, 8.2, 13.5, 22.0, 20.5, 30.0, 40.5, 58.0};
  return (Space::dof == 1 ? planar : spatial)[static_cast<std::size_t>(stages - 1)];
}

/// The stage equations of a chain in momentum form, solved in O(n) by exact Newton, by fixed point, or by whichever
/// takes less: a StageSolver for GaussStepper. Poles are no obstacle. Real is any floating-point type; float and double
/// go in SIMD registers.
template <class SpaceType, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainSolver {
 public:
  using Space = SpaceType;
  using Real = RealType;
  using Model = Chain<Space, N>;
  using State = pendula::State<Space, N, Real>;

  /// Throws std::invalid_argument unless `stages` is S, and the method has so many.
  ChainSolver(const Model& chain, int stages, Iteration iteration = Iteration::automatic, Family family = Family::gauss)
      : family_(family),
        stages_(chain, family),
        newton_(iteration == Iteration::fixed_point ? 0 : chain.links()),
        turn_(stages, order_of(family, stages)),
        choice_(iteration, newton_cost<Space>(S)) {
    tableau_of<S>(family, stages);
  }

  Status start(const State& state) {
    stages_.start(state);
    return Status::ok;
  }

  void prepare(double time, double h) {
    stages_.prepare(time, h);
    choice_.begin_step();
    count_ = 0;
  }

  void prepare_again(double time, double h) {
    stages_.prepare_again(time, h);
    count_ = 0;
  }

  Correction correct() {
    ++count_;
    choice_.count_iteration();
    if (choice_.active() == Iteration::newton) return last_ = newton_.correct(stages_);
    const Correction correction{stages_.iterate(), -1};
    if (choice_.is_automatic() &&
        diverges(correction.relative, last_.relative, count_, usual_rounding(parts(), epsilon), epsilon)) {
      if (!choice_.newton_is_allowed()) return last_ = {std::numeric_limits<double>::quiet_NaN(), -1};
      stages_.start_cold();
      choice_.give_up_fixed_point();
      return last_ = newton_.correct(stages_);
    }
    return last_ = correction;
  }

  void allow_newton(bool allowed) { choice_.allow_newton(allowed); }
  void heed(StopSign stop) { newton_.heed(stop); }

  Convergence convergence() const {
    return choice_.active() == Iteration::newton ? Convergence::quadratic : Convergence::linear;
  }

  /// Iterations take no note of where they change what; one more tells.
  int worst_part() {
    return choice_.active() == Iteration::newton ? newton_.worst_link(stages_) : stages_.worst_link();
  }

  int singular_part() const { return -1; }
  static constexpr double largest_turn() { return 3; }
  double turn() { return stages_.turn(); }
  static constexpr int turning_part() { return -1; }
  double defect() { return stages_.defect(); }
  double predictor_gain() const { return stages_.predictor_gain(); }
  Tempo tempo() const { return stages_.tempo(); }
  StepShape shape() const { return stages_.shape(); }
  bool loaded() const { return stages_.loaded(); }
  bool damped() const { return stages_.chain().damped(); }
  double followed(double, double h, double tolerance) const {
    const double fastest = stages_.chain().fastest_drive();
    return fastest > 0 ? std::min(h, turn_.within(tolerance) / fastest) : h;
  }
  bool dissipates() const { return family_ == Family::radau; }
  static constexpr int stages() { return S; }
  int parts() const { return stages_.links(); }
  int coordinates() const { return Space::dof * stages_.links(); }
  double work() const { return static_cast<double>(stages_.work()); }
  bool continues() const { return choice_.active() == Iteration::fixed_point || newton_.positive(); }
  double energy_defect() {
    if (choice_.active() == Iteration::newton) newton_.find_multipliers(stages_);
    return stages_.energy_defect();
  }

  void accept() {
    if (choice_.active() == Iteration::newton) newton_.find_multipliers(stages_);
    choice_.end_step();
    stages_.accept();
  }

  /// The derivative of the step that was solved and not yet accepted.
  using Tangent = ChainTangent<Space, S, N, Real, Arch>;
  Tangent make_tangent() const { return Tangent(stages_.links()); }
  void linearize(Tangent& tangent) {
    if (choice_.active() == Iteration::newton) newton_.find_multipliers(stages_);
    tangent.linearize(stages_);
  }

  State state(double time) const { return stages_.state(time); }
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(stages_, choice_);
  }
  void forget() { stages_.forget(); }
  State glance(double time, double x) const { return stages_.glance(time, x); }
  void remember() { stages_.remember(); }
  void return_to_start() {
    stages_.return_to_start();
    choice_.begin_look();
  }
  void save() { stages_.save(); }
  void restore() { stages_.restore(); }

  Iteration iteration() const { return choice_.preferred(); }

 private:
  static constexpr double epsilon = static_cast<double>(std::numeric_limits<Real>::epsilon());

  Family family_;
  ChainStages<Space, S, N, Real, Arch> stages_;
  ChainNewton<Space, S, N, Real, Arch> newton_;
  SineTurn turn_;
  IterationChoice choice_;
  Correction last_;
  int count_ = 0;
};

}  // namespace pendula
