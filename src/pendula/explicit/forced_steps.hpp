#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/explicit/system_forward_dynamics.hpp>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <pendula/system/forcing_look.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Limits the steps of an explicit method so that its stages resolve forces that depend on time.
class ForcedSteps {
 public:
  /// `Gauss`, a kernels::GaussTableau, is a quadrature as accurate as the method. `is_blind`: the error estimate of the
  /// method does not see forces that depend on time only.
  template <class Gauss>
  ForcedSteps(Gauss, std::size_t coordinates, double tolerance, bool is_blind = false)
      : turn_(is_blind ? SineTurn(Gauss::stages, 2 * Gauss::stages).within(tolerance) : Gauss::stages),
        tolerance_(tolerance),
        look_(Gauss::c, Gauss::b, coordinates),
        moved_(coordinates),
        a_(coordinates),
        sizes_(coordinates) {}

  /// Call at the start of a run.
  void start(SystemForwardDynamics& dynamics, double time, const double* q, const double* v) {
    if (dynamics.depends_on_time()) pace_ = pace_of(dynamics, time, q, v);
  }

  /// The longest step up to h from q and v. Drives turn by at most a radian per node: a weak drive that oscillates
  /// often within a step would show in no stage.
  double followed(SystemForwardDynamics& dynamics, double time, const double* q, const double* v, double h) {
    h = std::min(h, turn_ / dynamics.fastest_drive());
    if (!dynamics.depends_on_time()) return h;
    for (std::size_t k = 0; k < a_.size(); ++k) sizes_[k] = std::max(1.0, std::abs(q[k]));
    const std::span<const double> rates(v, a_.size());
    return look_.resolved(time, h, pace_, tolerance_, rates, sizes_, [&](std::span<const double> times, double* found) {
      dynamics.accelerations(times.data(), times.size(), q, v, found);
    });
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(pace_);
  }

 private:
  // The highest frequency at which a single coordinate would oscillate here; 1/s if there is none.
  double pace_of(SystemForwardDynamics& dynamics, double time, const double* q, const double* v) {
    double squared = 0;
    dynamics.acceleration(time, q, v, a_.data());
    const std::vector<double> here = a_;
    for (std::size_t k = 0; k < a_.size(); ++k) {
      const double small = 1e-6 * std::max(1.0, std::abs(q[k]));
      moved_.assign(q, q + a_.size());
      moved_[k] += small;
      dynamics.acceleration(time, moved_.data(), v, a_.data());
      const double swing = std::abs(a_[k] - here[k]) / small;
      if (std::isfinite(swing)) squared = std::max(squared, swing);
    }
    return squared > 0 ? std::sqrt(squared) : 1;
  }

  double turn_;  // largest turn of drives in a step  [rad]
  double tolerance_, pace_ = 1;
  ForcingLook look_;
  std::vector<double> moved_, a_, sizes_;
};

}  // namespace pendula
