#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/run/lyapunov_spectrum.hpp>
#include <vector>

namespace pendula {

/// How one tangent that is never turned grows along a motion: what its FTLE and MEGNO (Cincotta, Simó 2000) are.
class TangentGrowth {
 public:
  /// By `growth`, a logarithm, in a step from `before` to `time` since the start.
  void follow(double growth, double before, double time);

  double grown() const { return grown_; }
  double megno(double time) const { return time > 0 ? integral_ / time : 0; }

 private:
  double grown_ = 0, weighted_ = 0, integral_ = 0;
};

/// What tangents have grown by until now and then, and the exponents that come of it.
class GrowthHistory {
 public:
  /// Of `count` tangents, from the time 0 on.
  explicit GrowthHistory(Eigen::Index count) : sums_(Eigen::VectorXd::Zero(count)) { entries_.push_back({0, sums_}); }

  /// Logarithms, since the last entry.
  void add(double time, const Eigen::VectorXd& grown);

  double last_time() const { return entries_.back().time; }
  std::size_t size() const { return entries_.size(); }
  /// Of the first entry after the start; 0 where there is none.
  double first_time() const { return entries_.size() < 2 ? 0 : entries_[1].time; }
  const Eigen::VectorXd& sums() const { return sums_; }

  /// Exponents and their errors, of the time from `from` on.
  ///
  /// Errors from means over blocks, of whichever number of blocks scatters most: blocks that are too short are alike by
  /// what they remember. Regular motions drift apart linearly, tangents of any motion swing by a factor: what a run of
  /// the time t cannot tell from zero is some 3/t.
  void average(double from, LyapunovSpectrum& spectrum) const;

  /// Of the time, until tangents have found their directions.
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

}  // namespace pendula
