#pragma once

#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

/// The last step of a motion, for all that needs states within it: events, rows between steps, tracks.
class StepView {
 public:
  StepView() = default;
  StepView(const StepView&) = delete;
  StepView& operator=(const StepView&) = delete;
  virtual ~StepView() = default;

  /// When the step ended  [s], and the state there.
  virtual double time() const = 0;
  virtual void read_state(Motion& motion) const = 0;

  /// The state at `time` by dense output, the polynomial through the step's stages: cheap. Its order is one more than
  /// the number of stages for positions, that number for rates.
  virtual void at(double time, Motion& motion) = 0;

  /// The same, where `share`, the fraction of the step done at `time`, is known. States of members in lanes are found
  /// for all of them at once if they ask for the same share.
  virtual void at(double /*share*/, double time, Motion& motion) { at(time, motion); }

  /// The state at `time` at the full order of the method: by a step from where the last one began. `motion` is set if
  /// the outcome is ok.
  virtual Outcome at_full_order(double time, Motion& motion) = 0;

  /// Sets `farthest` to bounds of how far each coordinate and rate gets from its value at the start of the step, for
  /// rates of Gauss steps from the stage polynomial's rate there. Cheaper than dense output. False if they are not
  /// known. The caller gives vectors of the right size.
  virtual bool bound_excursions(Motion& /*farthest*/) const { return false; }

  Motion state() const {
    Motion motion;
    read_state(motion);
    return motion;
  }
  Motion at(double time) {
    Motion motion;
    at(time, motion);
    return motion;
  }
};

}  // namespace pendula
