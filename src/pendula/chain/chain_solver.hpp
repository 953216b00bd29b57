#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <pendula/chain/chain_fixed_point.hpp>
#include <pendula/chain/chain_newton.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/gauss/roundoff.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>

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

/// Chooses between the two iterations by what they take: iterations a step, counted while the run goes, times the cost
/// of one. The other one is tried for a step now and then, so that the choice follows the motion. Nothing here depends
/// on a clock: the same run makes the same choices.
class IterationChoice {
 public:
  IterationChoice(Iteration wanted, double newton_cost)
      : wanted_(wanted),
        preferred_(wanted == Iteration::automatic ? Iteration::fixed_point : wanted),
        active_(preferred_),
        cost_{newton_cost, 1.0} {}

  Iteration active() const { return active_; }
  Iteration preferred() const { return preferred_; }
  bool is_automatic() const { return wanted_ == Iteration::automatic; }

  void begin_step() {
    active_ = preferred_;
    iterations_ = {};
    if (is_automatic() && ++steps_ % trial_interval == trial_step && may_win(other(preferred_))) {
      active_ = other(preferred_);
    }
  }

  void count_iteration() { ++iterations_[index(active_)]; }

  /// A fixed point that does not contract leaves the rest of the step to Newton.
  void give_up_fixed_point() {
    active_ = Iteration::newton;
    gave_up_ = true;
  }

  void end_step() {
    if (!is_automatic()) return;
    if (gave_up_) {
      preferred_ = Iteration::newton;
      spent_[index(Iteration::fixed_point)] = forbidden;
    } else {
      spent_[index(active_)] = cost_of(active_, iterations_[index(active_)]);
    }
    gave_up_ = false;
    const Iteration rival = other(preferred_);
    if (spent_[index(rival)] > 0 && spent_[index(rival)] < worthwhile * spent_[index(preferred_)]) preferred_ = rival;
  }

 private:
  static std::size_t index(Iteration iteration) { return iteration == Iteration::newton ? 0 : 1; }
  static Iteration other(Iteration iteration) {
    return iteration == Iteration::newton ? Iteration::fixed_point : Iteration::newton;
  }

  double cost_of(Iteration iteration, int iterations) const {
    return cost_[index(iteration)] * (iterations + (iteration == Iteration::newton ? last_evaluation : 0));
  }

  // A trial is for nothing where two iterations cost more than steps do: a step that needs but one of Newton's takes
  // hardly more of the other.
  bool may_win(Iteration rival) const { return cost_of(rival, 2) < worthwhile * spent_[index(preferred_)]; }

  static constexpr int trial_interval = 64, trial_step = 8;
  static constexpr double last_evaluation = 0.3;  // of forces after the last Newton iteration, in iterations
  static constexpr double worthwhile = 0.9;       // what a change has to save
  static constexpr double forbidden = 1e300;

  Iteration wanted_, preferred_, active_;
  std::array<double, 2> cost_;
  std::array<double, 2> spent_{};  // by the last step with each iteration, 0: none yet
  std::array<int, 2> iterations_{};
  bool gave_up_ = false;
  std::int64_t steps_ = 0;
};

/// The stage equations of a chain in momentum form, solved in O(n) by exact Newton, by fixed point, or by whichever
/// takes less: a StageSolver for GaussStepper. Poles are no obstacle. Real is any floating-point type; float and double
/// go in SIMD registers.
template <class SpaceType, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainSolver {
 public:
  using Space = SpaceType;
  using Real = RealType;
  using Chain = pendula::Chain<Space, N>;
  using State = pendula::State<Space, N, Real>;

  /// Throws std::invalid_argument unless `stages` is S, and the method has so many.
  ChainSolver(const Chain& chain, int stages, Iteration iteration = Iteration::automatic, Family family = Family::gauss)
      : family_(family),
        stages_(chain, family),
        newton_(iteration == Iteration::fixed_point ? 0 : chain.links()),
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

  Correction correct() {
    ++count_;
    choice_.count_iteration();
    if (choice_.active() == Iteration::newton) return last_ = newton_.correct(stages_);
    const Correction correction = fixed_point_.correct(stages_);
    if (choice_.is_automatic() && diverges(correction)) {
      stages_.start_cold();
      choice_.give_up_fixed_point();
      return last_ = newton_.correct(stages_);
    }
    return last_ = correction;
  }

  Convergence convergence() const {
    return choice_.active() == Iteration::newton ? Convergence::quadratic : Convergence::linear;
  }

  /// Iterations take no note of where they change what; one more tells.
  int worst_link() {
    return choice_.active() == Iteration::newton ? newton_.worst_link(stages_) : fixed_point_.worst_link(stages_);
  }

  int singular_link() const { return -1; }
  static constexpr double largest_turn = 3;
  double turn() const { return stages_.turn(); }
  double defect() { return stages_.defect(); }
  double predictor_gain() const { return stages_.predictor_gain(); }
  bool loaded() const { return stages_.loaded(); }
  bool damped() const { return stages_.chain().damped(); }
  bool dissipates() const { return family_ == Family::radau; }
  static constexpr int stages() { return S; }
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

  State state(double time) const { return stages_.state(time); }
  void save() { stages_.save(); }
  void restore() { stages_.restore(); }

  Iteration iteration() const { return choice_.preferred(); }

 private:
  // Slow contraction costs more than Newton; far from round-off, so that rounding is not taken for it.
  bool diverges(const Correction& correction) const {
    if (!std::isfinite(correction.relative)) return true;
    const bool far = correction.relative > far_from_roundoff();
    return far && ((count_ > 3 && correction.relative > 0.7 * last_.relative) || count_ > 20);
  }

  static double far_from_roundoff() {  // 1e-6 in double
    return 67 * std::sqrt(static_cast<double>(std::numeric_limits<Real>::epsilon()));
  }

  Family family_;
  ChainStages<Space, S, N, Real, Arch> stages_;
  ChainNewton<Space, S, N, Real, Arch> newton_;
  ChainFixedPoint<Space, S, N, Real, Arch> fixed_point_;
  IterationChoice choice_;
  Correction last_;
  int count_ = 0;
};

}  // namespace pendula
