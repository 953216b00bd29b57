#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/lyapunov_spectrum.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula {

/// Growth of one tangent along a motion, without reorthogonalisation: its FTLE and MEGNO (Cincotta, Simó 2000).
class TangentGrowth {
 public:
  /// Adds `growth`, a logarithm, in a step from `before` to `time` since the start.
  void follow(double growth, double before, double time);

  double grown() const { return grown_; }
  double megno(double time) const { return time > 0 ? integral_ / time : 0; }

 private:
  double grown_ = 0, weighted_ = 0, integral_ = 0;
};

/// The history of the growth of tangents, and the exponents that follow from it.
class GrowthHistory {
 public:
  /// The history of `count` tangents, from the time 0 on.
  explicit GrowthHistory(Eigen::Index count) : sums_(Eigen::VectorXd::Zero(count)) { entries_.push_back({0, sums_}); }

  /// Adds logarithms of the growth since the last entry.
  void add(double time, const Eigen::VectorXd& grown);

  double last_time() const { return entries_.back().time; }
  std::size_t size() const { return entries_.size(); }
  /// Time of the first entry after the start; 0 if there is none.
  double first_time() const { return entries_.size() < 2 ? 0 : entries_[1].time; }
  const Eigen::VectorXd& sums() const { return sums_; }

  /// Exponents and their errors over the time after `from`.
  ///
  /// Errors come from the scatter of block means, for the number of blocks with the largest scatter, since short blocks
  /// are correlated. Tangents of regular motions grow linearly and those of any motion oscillate by a factor, so that
  /// exponents below about 3/t cannot be told from zero in a run of duration t.
  void average(double from, LyapunovSpectrum& spectrum) const;

  /// Fraction of the time until tangents have found their directions.
  static constexpr double settling = 0.1;

 private:
  struct Entry {
    double time;
    Eigen::VectorXd logarithms;
  };

  Eigen::VectorXd sums_at(double time) const;

  Eigen::VectorXd sums_;
  std::vector<Entry> entries_;
};

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

  /// Adds the last entry of the history. Returns false if it was there already.
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
/// tangents were made orthonormal, and at the end; asks `stop` after every step. Throws std::invalid_argument if the
/// motion has fewer than `count` exponents, and for methods whose steps have no derivative.
LyapunovRun find_lyapunov_spectrum(Integrator& integrator, const Motion& start, double step, double duration, int count,
                                   const std::function<void(const LyapunovProgress&)>& on_way,
                                   const std::function<bool()>& stop);

}  // namespace pendula
