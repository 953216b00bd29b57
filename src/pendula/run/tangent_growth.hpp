#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/run/lyapunov_spectrum.hpp>
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
  /// Of `count` tangents, from the time 0 on.
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

}  // namespace pendula
