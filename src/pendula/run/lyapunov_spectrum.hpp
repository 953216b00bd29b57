#pragma once

#include <Eigen/Core>

namespace pendula {

/// Lyapunov exponents of a motion, and other measures of how its neighbours part.
struct LyapunovSpectrum {
  Eigen::VectorXd exponents;  ///< the leading ones, descending; of the time after the settling  [1/s]
  Eigen::VectorXd errors;     ///< of each  [1/s]; infinite where the run was too short to tell
  double sum = 0;             ///< of them; of a whole spectrum the mean divergence  [1/s]
  double duration = 0;        ///< s, that was run
  double ftle = 0;            ///< finite-time exponent of one tangent over all of that  [1/s]
  double megno = 0;           ///< mean exponential growth of nearby orbits: 2 where motion is regular, λ t/2 in chaos
};

}  // namespace pendula
