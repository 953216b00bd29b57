#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <vector>

namespace pendula {

/// The ends of members, with the memory that they point to.
class MemberEnds {
 public:
  MemberEnds(Eigen::Index coordinates, std::size_t count)
      : q_(coordinates, static_cast<Eigen::Index>(count)), v_(q_.rows(), q_.cols()) {
    for (Eigen::Index k = 0; k < q_.cols(); ++k) ends_.push_back({.q = q_.col(k).data(), .v = v_.col(k).data()});
  }
  MemberEnds(const MemberEnds&) = delete;
  MemberEnds& operator=(const MemberEnds&) = delete;

  std::span<MemberEnd> all() { return ends_; }
  const MemberEnd& end(std::size_t k) const { return ends_[k]; }
  Motion motion(std::size_t k) const {
    const auto column = static_cast<Eigen::Index>(k);
    return {ends_[k].time, q_.col(column), v_.col(column)};
  }

 private:
  Eigen::MatrixXd q_, v_;
  std::vector<MemberEnd> ends_;
};

}  // namespace pendula
