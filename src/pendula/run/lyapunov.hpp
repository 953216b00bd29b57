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

/// What is told of a spectrum on the way.
struct LyapunovProgress {
  double time = 0;            ///< s, since the start
  Eigen::VectorXd exponents;  ///< as they are so far, of all the time  [1/s]
};

/// And how the run ended that it was found by.
struct LyapunovRun : LyapunovSpectrum {
  RunResult result;
};

/// The leading Lyapunov exponents of a motion: tangents are pushed by the exact derivatives of its steps, and made
/// orthonormal again by QR before they fall into the leading directions (Benettin, Galgani, Giorgilli, Strelcyn 1980).
/// Steps may have any sizes. The first tangent is never turned, so that FTLE and MEGNO are read off it on the way.
///
/// It is a value: a copy, and the integrator's member of the same instant, are all that goes on from there.
class LyapunovTangents {
 public:
  /// `rows` as Integrator::linearize tells; the tangents are random, by `seed`.
  LyapunovTangents(int rows, int count, unsigned seed = 1);

  /// Tangents of the motion's start, whose rows are measured by `scale`, after a next-to-nothing step of `integrator`.
  /// Without it they are whatever the first step makes of them, and what that adds to them is not known.
  void begin(Integrator& integrator, const Eigen::VectorXd& scale);

  /// After a step of `integrator` to `time` since the start. Tells whether there is a new entry of the history.
  bool follow(Integrator& integrator, double time);

  /// Makes the last entry of the history.
  void finish();

  LyapunovProgress progress() const;

  /// The spectrum, when all is done.
  LyapunovSpectrum spectrum() const;

 private:
  double counted() const;
  void push(Integrator& integrator);
  void make_orthonormal();

  Directions<> tangents_;
  Eigen::VectorXd scale_;  // none where they are measured as they are
  bool has_begun_ = false;
  GrowthHistory history_;
  TangentGrowth first_;
  double time_ = 0, interval_ = 0;
  double grown_ = 0;  // logarithm of the first tangent's length
};

/// Runs `integrator` from `start` over `duration` in steps of at most `step`, which may be infinite where it chooses
/// them, and finds the `count` leading exponents of the motion, 0 for all. Calls `on_way` where tangents were made
/// orthonormal; `stop` is asked after every step. Throws std::invalid_argument where there are not so many exponents,
/// and for methods whose steps have no derivative.
LyapunovRun find_lyapunov_spectrum(Integrator& integrator, const Motion& start, double step, double duration, int count,
                                   const std::function<void(const LyapunovProgress&)>& on_way,
                                   const std::function<bool()>& stop);

}  // namespace pendula
