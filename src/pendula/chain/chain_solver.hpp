#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <pendula/chain/chain_newton.hpp>
#include <pendula/chain/chain_stages.hpp>
#include <pendula/chain/chain_tangent.hpp>
#include <pendula/gauss/stage_iterations.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/stop_sign.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {

/// Cost of one Newton iteration on a chain in fixed-point iterations, by space and stages, as measured on ten links
/// (g++ 12; the mean of AVX2 and AVX-512, which differ by up to a half). It grows with the cube of the size of the
/// blocks that Newton eliminates, and hardly depends on the number of links.
template <class Space>
constexpr double newton_cost(int stages) {
  constexpr std::array<double, 8> planar{2.1, 4.8, 9.0, 10.5, 15.5, 18.0, 23.0, 30.0};
  constexpr std::array<double, 8> spatial{4.3, 8.2, 13.5, 22.0, 20.5, 30.0, 40.5, 58.0};
  return (Space::dof == 1 ? planar : spatial)[static_cast<std::size_t>(stages - 1)];
}

/// A StageSolver for chains in momentum form, in O(n): by exact Newton, by fixed point, or by whichever costs less. It
/// has no poles. Real is any floating-point type; float and double use SIMD registers.
template <class SpaceType, int S, int N = Eigen::Dynamic, class RealType = double, class Arch = xsimd::default_arch>
class ChainSolver : public StageIterations<ChainStages<SpaceType, S, N, RealType, Arch>> {
  using Base = StageIterations<ChainStages<SpaceType, S, N, RealType, Arch>>;

 public:
  using Space = SpaceType;
  using Model = Chain<Space, N>;
  using typename Base::Real, typename Base::State;

  /// Throws std::invalid_argument unless `stages` is S and the method exists with S stages.
  ChainSolver(const Model& chain, int stages, Iteration iteration = Iteration::automatic, Family family = Family::gauss)
      : Base(chain.is_held() ? Iteration::fixed_point : iteration, newton_cost<Space>(S), chain, family),
        family_(family),
        newton_(iteration == Iteration::fixed_point || chain.is_held() ? 0 : chain.links()),
        turn_(stages, order_of(family, stages)) {
    tableau_of<S>(family, stages);
  }

  Status start(const State& state) {
    stages_.start(state);
    return Status::ok;
  }

  Correction correct() { return Base::correct(newton_, stages_.links()); }
  void set_stop_sign(StopSign stop) { newton_.set_stop_sign(stop); }

  /// The link that a failure names. Iterations do not record which link they change most: one more finds out.
  int part_of(Status status) {
    if (status == Status::singular_mass_matrix || status == Status::wrong_root) return -1;
    return is_by_newton() ? newton_.worst_link(stages_) : stages_.worst_link();
  }

  double turn() {
    return !is_by_newton() || newton_.positive() ? stages_.turn() : std::numeric_limits<double>::infinity();
  }
  StepShape shape() const { return stages_.shape(); }
  double followed(double, double h, double tolerance) const {
    const double fastest = stages_.chain().fastest_drive();
    return fastest > 0 ? std::min(h, turn_.within(tolerance) / fastest) : h;
  }
  SolverTraits traits() const {
    return {stages_.links(),         Space::dof * stages_.links(),       S,
            detail::largest_turn,    stages_.chain().exchanges_energy(), stages_.chain().damped(),
            family_ == Family::radau};
  }
  double energy_defect() {
    if (is_by_newton()) newton_.find_multipliers(stages_);
    return stages_.energy_defect();
  }

  /// How many coordinates and rates follow from others where the end is held.
  int conditions() const { return stages_.chain().is_held() ? 2 * Space::dimension : 0; }
  std::pair<double, double> constraint_errors() const { return stages_.constraint_errors(); }

  double accept() {
    const double brought = stages_.brought();
    if (is_by_newton()) newton_.find_multipliers(stages_);
    choice_.end_step();
    stages_.accept();
    return brought;
  }

  /// linearize() gives the derivative of the step that was solved and not yet accepted.
  using Tangent = ChainTangent<Space, S, N, Real, Arch>;
  Tangent make_tangent() const {
    if (!stages_.chain().is_held()) return Tangent(stages_.links());
    throw std::invalid_argument(
        "chain.end: expected a chain that hangs free: one whose last bob is held has no derivatives yet; the model "
        "hanging_chain has");
  }
  void linearize(Tangent& tangent) {
    if (is_by_newton()) newton_.find_multipliers(stages_);
    tangent.linearize(stages_);
  }

 private:
  using Base::choice_, Base::is_by_newton, Base::stages_;

  Family family_;
  ChainNewton<Space, S, N, Real, Arch> newton_;
  SineTurn turn_;
};

}  // namespace pendula
