#pragma once

#include <Eigen/Core>
#include <functional>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/lyapunov_spectrum.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/run/tangent_growth.hpp>
#include <pendula/system/motion.hpp>

namespace pendula {

/// The spectrum so far.
struct LyapunovProgress {
  double time = 0;            ///< s, since the start
  Eigen::VectorXd exponents;  ///< averaged over all the time so far  [1/s]
};

/// A spectrum, and the result of the run that found it.
struct LyapunovRun : LyapunovSpectrum {
  RunResult result;
};

/// The leading Lyapunov exponents of a motion. Tangents are propagated by the exact derivatives of the steps and made
/// orthonormal by QR before they align with the leading directions (Benettin, Galgani, Giorgilli, Strelcyn 1980). Step
/// sizes may vary. QR does not turn the first tangent, so that FTLE and MEGNO follow from its growth.
///
/// The object is a value: a copy, together with the integrator's member of the same instant, continues the computation.
class LyapunovTangents {
 public:
  /// `rows` as from Integrator::linearize; tangents are random, by `seed`.
  LyapunovTangents(int rows, int count, unsigned seed = 1);

  /// Starts with tangents at the motion's start whose rows are scaled by `scale`, after `integrator` has taken a tiny
  /// step. Without this call, the growth of tangents in the first step is unknown and left out.
  void begin(Integrator& integrator, const Eigen::VectorXd& scale);

  /// Call after each step of `integrator`, to `time` since the start. Returns whether the history has a new entry.
  bool follow(Integrator& integrator, double time);

  /// Adds the last entry of the history. Returns whether it was not there.
  bool finish();

  LyapunovProgress progress() const;

  /// The final spectrum; call after finish().
  LyapunovSpectrum spectrum() const;

 private:
  double counted() const;
  void push(Integrator& integrator);
  void make_orthonormal();

  Directions<> tangents_;
  Eigen::VectorXd scale_;  // empty: no scaling
  bool has_begun_ = false;
  GrowthHistory history_;
  TangentGrowth first_;
  double time_ = 0, interval_ = 0;
  double grown_ = 0;  // logarithm of the first tangent's length
};

/// Runs `integrator` from `start` over `duration` in steps of at most `step`, which may be infinite if the method
/// chooses its steps, and finds the `count` leading exponents of the motion, 0 for all. Calls `on_way` whenever
/// tangents were made orthonormal, and at the end; asks `stop` after every step. Throws std::invalid_argument if there
/// are fewer exponents, and for methods whose steps have no derivative.
LyapunovRun find_lyapunov_spectrum(Integrator& integrator, const Motion& start, double step, double duration, int count,
                                   const std::function<void(const LyapunovProgress&)>& on_way,
                                   const std::function<bool()>& stop);

}  // namespace pendula
