#pragma once

namespace pendula {

/// What the stages of a step are predicted from.
enum class PredictedFrom {
  last_step,  ///< the step that led to this state, if it was of about this size; otherwise nothing
  same_step,  ///< the last step that was solved from this state, of another size
  nothing     ///< the motion goes on as it does at the start of the step
};

/// A step whose stage equations are to be solved.
struct StepTask {
  double time, h;  ///< where it begins, and its size  [s]
  PredictedFrom from = PredictedFrom::last_step;
  bool may_use_newton = true;  ///< where a fixed point does not contract; otherwise the step fails there
};

}  // namespace pendula
