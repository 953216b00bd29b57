#pragma once

#include <Eigen/Core>

namespace pendula {

/// Lyapunov exponents of a motion, and other measures of the divergence of nearby motions.
struct LyapunovSpectrum {
  Eigen::VectorXd exponents;  ///< leading ones, descending, averaged after the transient  [1/s]
  Eigen::VectorXd errors;     ///< of each  [1/s]; infinite if the run was too short
  double sum = 0;             ///< of the exponents; for a whole spectrum the mean divergence  [1/s]
  double duration = 0;        ///< of the run  [s]
  double since = 0;           ///< time from which exponents are averages  [s]
  double ftle = 0;            ///< finite-time exponent of one tangent over the whole duration  [1/s]
  double megno = 0;           ///< mean exponential growth of nearby orbits: 2 for regular motion, λ t/2 in chaos
};

}  // namespace pendula
