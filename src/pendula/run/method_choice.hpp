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
/// errors of steps. Where `longer`, the length of the run over that of a short one, exceeds 1, the tolerance is divided
/// by it, too, since errors of the energy add up. The divisor is rounded up to a power of ten, so that runs of about
/// the same length have the same tolerance. No result is below `finest`.
double step_tolerance(double asked, double longer, double finest);

/// The choice for a run that is set up for Gauss steps. Taylor series take less time for models and planar chains of
/// few links, if the run is not long, damping is not strong, and no force is narrow or depends on time. The choice
/// depends on the setup alone.
MethodChoice choose_method(const RunSetup& setup);

}  // namespace pendula
