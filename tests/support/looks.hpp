#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula::test {

/// Looks into the last steps of members, by both ways that there are.
class Looks : public MemberWatch {
 public:
  Looks(std::size_t members, Eigen::Index coordinates, double share)
      : share_(share), looked(members, Motion(0, Eigen::VectorXd(coordinates), Eigen::VectorXd(coordinates))) {
    glanced = looked;
  }

  bool wants_steps() const override { return true; }
  bool wants_looks() const override { return true; }
  void after_step(MemberSteps& steps) override {
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (!steps.took_step(lane)) continue;
      Motion &look = looked[steps.member(lane)], &glance = glanced[steps.member(lane)];
      look.time = glance.time = steps.begin(lane) + share_ * (steps.end(lane) - steps.begin(lane));
      if (!steps.at_full_order(lane, share_, look.q.data(), look.v.data())) ++failed;
      steps.at(lane, share_, glance.q.data(), glance.v.data());
    }
  }
  bool stops() override { return false; }

 private:
  double share_;

 public:
  std::vector<Motion> looked, glanced;  ///< of the last step of each
  int failed = 0;
};

}  // namespace pendula::test
