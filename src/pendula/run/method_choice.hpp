#pragma once

#include <pendula/run/run_report.hpp>
#include <string>

namespace pendula {

/// Taylor series or Gauss steps, and why.
struct MethodChoice {
  double series_tolerance = 0;  ///< of a step; 0: Gauss steps, as the options of the run say
  std::string reason;           ///< a few words
};

/// Whether a run that is set up for Gauss steps takes less time by Taylor series: of models and planar chains of few
/// links, not long, not damped strongly, without forces that are narrow or depend on time. Their tolerance, of a step,
/// is a hundredth of that of the motion, less for long runs, whose energy drifts. It depends on the setup alone.
MethodChoice choose_method(const RunSetup& setup);

}  // namespace pendula
