#pragma once

#include <cstddef>
#include <pendula/run/plain_members.hpp>
#include <vector>

namespace pendula::test {

/// Adds up what tangents of members in lanes have grown by.
class Growths : public MemberWatch {
 public:
  explicit Growths(std::size_t members) : grown(members) {}

  bool wants_steps() const override { return true; }
  bool wants_looks() const override { return false; }
  void after_step(MemberSteps& steps) override {
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (steps.took_step(lane)) grown[steps.member(lane)] += steps.growth(lane);
    }
  }
  bool stops() override { return false; }

  std::vector<double> grown;
};

}  // namespace pendula::test
