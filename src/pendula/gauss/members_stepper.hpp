#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <pendula/gauss/fixed_point_stop.hpp>
#include <pendula/gauss/stage_prediction.hpp>
#include <pendula/gauss/step_controller.hpp>
#include <pendula/gauss/step_shape.hpp>
#include <pendula/gauss/wrong_root.hpp>
#include <pendula/numeric/lane_pack.hpp>

namespace pendula {

/// How accurately the stage equations are solved.
struct MembersStepperOptions {
  /// Size of the first correction that is left out, relative to the size of the step; by default far below a last bit.
  double enough = CorrectionLimits().enough;
  int max_iterations = 50;
  bool are_chosen = false;  ///< steps are adaptive
};

/// Gauss steps of several members at once, one in each lane, each of its own size, solved by fixed point. `Members`
/// holds their states and stages: ChainMembers of chains, SystemMembers of systems.
///
/// The motion of a member depends on that member alone, to the last bit: a lane whose iteration has ended is frozen,
/// and one that fails stays where its last accepted step ended.
template <class Members>
class MembersStepper {
 public:
  using Chain = Members;
  using Subject = typename Members::Subject;
  using L = typename Chain::L;
  using Mask = typename L::Mask;
  using Options = MembersStepperOptions;
  using SpaceType = typename Chain::SpaceType;
  static constexpr int lanes = L::size, stages = Chain::stages, links_known = Chain::links_known;
  static constexpr bool is_implicit = true, can_choose = true, has_tangent = Chain::has_tangent;

  /// Chooses the steps of every member by a tolerance.
  class Controller {
   public:
    explicit Controller(double tolerance) : tolerance_(tolerance), steps_(stages, 2 * stages, tolerance) {}

    /// These members start. Those with loads have greedy steps, since their energy changes anyway.
    void start(const Mask& which, MembersStepper& stepper) {
      steps_.steer(which, stepper.chain().loaded());
      steps_.start(which, stepper.tempo());
      longest_ = select(which, stepper.chain().longest_step(tolerance_), longest_);
    }
    L step(const MembersStepper& /*stepper*/) const { return min(longest_, steps_.step()); }
    Mask accepts(const Mask& which, const L& h, MembersStepper& stepper) {
      return steps_.accepts(which, stepper.decay(), h);
    }
    void shrink(const Mask& which, const L& h, const L& factor) { steps_.shrink(which, h, factor); }
    void move_on(const Mask& which, const L& h, MembersStepper& stepper) {
      steps_.move_on(which, h, [&] { return stepper.tempo(); });
    }

   private:
    double tolerance_;
    StepController<L> steps_;
    L longest_{std::numeric_limits<double>::infinity()};  // step that resolves forces that depend on time
  };

  explicit MembersStepper(Subject subject, MembersStepperOptions options = {})
      : chain_(subject),
        options_(options),
        stop_({.enough = options.enough}),
        tangent_stop_({.enough = std::max(options.enough, tangent_enough)}) {}

  Chain& chain() { return chain_; }
  const Chain& chain() const { return chain_; }
  const L& energy_sum() const requires requires(const Chain& chain) { chain.energy_sum(); }
  { return chain_.energy_sum(); }

  /// A new member comes into a lane: Chain::start.
  template <class... Start>
  void start(int lane, double time, const Start&... start) {
    chain_.start(lane, time, start...);
    known_.set(lane, cold);
    last_.set(lane, 0);
    depth_.set(lane, 0);
    stop_.forget(lane);
    tangent_stop_.forget(lane);
  }

  /// Solves steps of size `h` from `time` for the members that are `wanted`. Returns those where that worked. The state
  /// does not change.
  Mask solve(const L& time, const L& h, const Mask& wanted) {
    const L ratio = h / last_;
    const Mask alike = (known_ > L(cold)) & (ratio <= L(detail::farthest_extrapolation));
    const Mask follows = alike & (known_ == L(accepted)), again = alike & (known_ == L(solved));
    depth_ = select(follows & (h == last_), min(depth_ + L(1.0), L(double(Chain::Columns::most_depth))), L(0.0));
    chain_.prepare(time, h, select(alike, ratio, L(1.0)), {follows, again, !alike, depth_, depth_});
    Mask found = iterate(wanted, stop_, chain_.scale(), [&](const Mask& active) { return chain_.iterate(active); });
    if constexpr (solves_tangents_after) {
      found = iterate(found, tangent_stop_, chain_.start_tangents(),
                      [&](const Mask& active) { return chain_.iterate_tangent(active); });
    }
    chain_.finish();
    known_ = select(found, L(solved), L(cold));
    depth_ = select(found, depth_, L(0.0));
    last_ = h;
    const double farthest = chain_.largest_turn(options_.are_chosen);
    return found & (chain_.turn() < L(farthest * farthest));
  }

  /// Puts all members back to the start of their last step, which `chain().save()` has kept. The next steps are
  /// predicted from its stages.
  void go_back() requires(!Chain::has_tangent) {
    chain_.restore(L(0.0) == L(0.0));
    known_ = select(known_ == L(accepted), L(solved), L(cold));
  }

  /// Moves those of the members that were solved to the end of their step.
  void accept(const Mask& which) {
    chain_.accept(which);
    known_ = select(which, L(accepted), known_);
  }

  /// Chain::take_growth.
  L take_growth(const Mask& which) requires(Chain::has_tangent) { return chain_.take_growth(which); }

  /// Members whose stages may be a solution that is not the motion: those with a large first correction, or a large
  /// turn.
  Mask doubtful() const {
    return (stop_.first() > L(detail::trusted_prediction * detail::trusted_prediction) * chain_.scale()) | turns_far();
  }

  /// Members whose angles are to be followed from stage to stage.
  Mask turns_far() const { return chain_.turn() > L(detail::trusted_turn * detail::trusted_turn); }

  /// Forgets the stages of these members: their next step starts cold.
  void forget(const Mask& which) { known_ = select(which, L(cold), known_); }

  /// Iterations of all members that were made so far.
  std::int64_t iterations() const { return iterations_; }

 private:
  static constexpr bool solves_tangents_after = requires(Chain & chain, const Mask& active) {
    chain.iterate_tangent(active);
  };
  // As FixedPointStop's `enough`. Near singular states tangents are rounded to little more than this.
  static constexpr double tangent_enough = 1e-12;
  static constexpr double cold = 0, solved = 1, accepted = 2;

  TempoOf<L> tempo() {
    TempoOf<L> tempo;
    chain_.tempo(tempo.pace, tempo.quickening);
    return tempo;
  }

  // The decay of the step that was solved.
  StepDecay<L> decay() {
    StepDecay<L> decay;
    for (int k = 0; k < stages; ++k) {
      if (decay.needs(k, stages)) decay.squares[static_cast<std::size_t>(k)] = chain_.decay(k);
    }
    decay.moved = chain_.pace_squared();
    if constexpr (requires { chain_.imbalance(); }) decay.imbalance = chain_.imbalance();
    if (any(chain_.loaded())) decay.beyond = select(chain_.loaded(), chain_.missed_at_start(), L(0.0));
    return decay;
  }

  // Iterates until each member has converged or will not. Returns those that have. once(active) makes one iteration.
  template <class Stop, class Once>
  Mask iterate(const Mask& wanted, Stop& stop, const L& scale, Once once) {
    stop.restart(scale);
    Mask active = wanted, found = wanted & !wanted;
    while (xsimd::any(active) && stop.count() < options_.max_iterations) {
      const auto verdict = stop.judge(once(active), active);
      found = found | (active & verdict.done & !verdict.lost);
      active = active & !(verdict.done | verdict.lost);
      ++iterations_;
    }
    return found;
  }

  Chain chain_;
  MembersStepperOptions options_;
  FixedPointStop<L, sequences_of<Chain>()> stop_;
  FixedPointStop<L> tangent_stop_;  // for tangents whose stages are solved after the motion's
  L known_{cold}, last_{0.0},
      depth_{0.0};  // cold, solved or accepted; size of that step; number of steps of this size before it
  std::int64_t iterations_ = 0;
};

}  // namespace pendula
