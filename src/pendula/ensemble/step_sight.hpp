#pragma once

#include <cstddef>
#include <optional>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/system/moving_part.hpp>
#include <vector>

namespace pendula {

/// States within the last steps of members in lanes, for any stepper: rods and their rates, or coordinates of systems
/// (D = 1) and their rates. Code that looks into steps is so compiled once, not for every stepper.
template <class L, std::size_t D>
class StepSight {
 public:
  using Parts = std::vector<MovingPart<L, D>>;  ///< one for each rod or coordinate

  StepSight() = default;
  StepSight(const StepSight&) = delete;
  StepSight& operator=(const StepSight&) = delete;
  virtual ~StepSight() = default;

  virtual int count() const = 0;
  /// The states at the end of the step.
  virtual void now(Parts& parts) = 0;
  /// The states when a share of the step was done, 0 to 1, by the polynomial through the step.
  virtual void at(double share, Parts& parts) = 0;
  /// The same for one member, at the full order of the method, in a step of size `h` from `begin`; false if it fails.
  virtual bool at_full_order(int lane, const L& begin, const L& h, double share, Parts& parts) = 0;
  /// Number of places within the step, between which links turn little. waypoint(k) finds rods there; rates need not be
  /// set.
  virtual int waypoints() const = 0;
  virtual void waypoint(int k, Parts& parts) = 0;
};

/// The StepSight of a MembersStepper, ExplicitSteps or TaylorSteps.
template <class Stepper>
class SightOf : public StepSight<typename Stepper::L, Stepper::SpaceType::dimension> {
  using L = typename Stepper::L;
  using Base = StepSight<L, Stepper::SpaceType::dimension>;

 public:
  using typename Base::Parts;

  explicit SightOf(Stepper& stepper) : stepper_(stepper) {}

  int count() const override { return stepper_.chain().count(); }

  void now(Parts& parts) override { read(stepper_.chain(), parts); }

  void at(double share, Parts& parts) override { stepper_.chain().for_each_at(share, into(parts)); }

  bool at_full_order(int lane, const L& begin, const L& h, double share, Parts& parts) override {
    if constexpr (!Stepper::is_implicit) {
      stepper_.chain().for_each_at_full_order(share, into(parts));
      return true;
    } else if constexpr (Stepper::has_tangent) {
      return false;  // not asked for: exponents have no events
    } else {
      if (!step_again(lane, begin, share * h)) return false;
      read(again_->chain(), parts);
      return true;
    }
  }

  int waypoints() const override { return Stepper::is_implicit ? Stepper::stages : 4; }
  void waypoint(int k, Parts& parts) override {
    auto& chain = stepper_.chain();
    if constexpr (requires { chain.along(0, k); }) {
      for (int i = 0; i < chain.count(); ++i) parts[index(i)].place = chain.along(i, k);
    } else {
      at((k + 1) / (waypoints() + 1.0), parts);
    }
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }

  static auto into(Parts& parts) {
    return [&parts](int i, const auto& place, const auto& rate) { parts[index(i)] = {place, rate}; };
  }
  template <class Chain>
  static void read(Chain& chain, Parts& parts) {
    chain.for_each_rate([&](int i, const auto& rate, const auto&) { parts[index(i)] = {chain.along(i), rate}; });
  }

  // Takes a step of one member from where its last one began.
  bool step_again(int lane, const L& begin, const L& h) {
    again_.emplace(stepper_);
    again_->go_back();
    L wanted(0.0);
    wanted.set(lane, 1);
    const auto found = again_->solve(begin, h, wanted > L(0.0));
    again_->accept(found);
    return xsimd::any(found);
  }

  Stepper& stepper_;
  std::optional<Stepper> again_;
};

}  // namespace pendula
