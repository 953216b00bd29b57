#pragma once

#include <pendula/run/run_report.hpp>
#include <string>

namespace pendula {

/// Taylor series or Gauss steps, and why.
struct MethodChoice {
  double series_tolerance = 0;  ///< of a step; 0: Gauss steps, as the options of the run say
  std::string reason;           ///< a few words
};

/// The tolerance of a step for a motion with the tolerance `asked`: a hundredth of it, since the motion amplifies the
/// errors of steps. For a run that is `longer` than a short one by some factor, it is smaller by that factor, too,
/// since errors of the energy add up. It is rounded to a power of ten, so that runs of about the same length have the
/// same one.
double step_tolerance(double asked, double longer, double finest);

/// Whether a run that is set up for Gauss steps takes less time by Taylor series: of models and planar chains of few
/// links, not long, not damped strongly, without forces that are narrow or depend on time. It depends on the setup
/// alone.
MethodChoice choose_method(const RunSetup& setup);

}  // namespace pendula
