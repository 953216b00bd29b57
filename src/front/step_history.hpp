#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <iterator>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula::front {

/// Where steps began, and the last one ended.
class StepHistory {
 public:
  void add(const Motion& motion) {
    times_.push_back(motion.time);
    numbers_.insert(numbers_.end(), motion.q.begin(), motion.q.end());
    numbers_.insert(numbers_.end(), motion.v.begin(), motion.v.end());
  }

  /// The last one ended at this time, up to rounding.
  void end_at(double time) { times_.back() = time; }

  /// Of the last one nothing is known any more: the run went on from elsewhere, later.
  void clear() {
    times_.clear();
    numbers_.clear();
  }

  bool covers(double time) const { return !times_.empty() && time >= times_.front() && time <= times_.back(); }

  /// The last one that is not after a time, which it covers.
  Motion before(double time) const {
    const auto after = std::ranges::upper_bound(times_, time);
    const std::size_t place = static_cast<std::size_t>(std::distance(times_.begin(), after)) - 1;
    const std::size_t size = numbers_.size() / times_.size();
    const auto half = static_cast<Eigen::Index>(size / 2);
    const Eigen::Map<const Eigen::VectorXd> both(numbers_.data() + place * size, 2 * half);
    return {times_[place], both.head(half), both.tail(half)};
  }

 private:
  std::vector<double> times_, numbers_;  // q and v of each
};

}  // namespace pendula::front
