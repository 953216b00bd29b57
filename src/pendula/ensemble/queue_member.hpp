#pragma once

#include <cstdint>
#include <pendula/chain/chain.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/outcome.hpp>

namespace pendula {

/// One member of an ensemble: where it starts, when it ends, and its chain where that is its own.
template <class Space, int N = Eigen::Dynamic>
struct QueueMember {
  static constexpr int links_known = N;

  Motion start;                            ///< angles and rates, (dof·n)  rad, rad/s
  double end = 0;                          ///< s
  const Chain<Space, N>* chain = nullptr;  ///< with as many links; nullptr: that of the ensemble
};

/// What became of it.
struct MemberEnd {
  Motion motion;               ///< at the end; where it failed, where its last accepted step ended
  Status status = Status::ok;  ///< otherwise a scalar stepper may do it
  std::int64_t steps = 0;      ///< that were accepted
  std::int64_t rejected_steps = 0;
  double energy_error = 0;  ///< the largest |H − H_0| where it was looked at  [J]
  double energy_sum = 0;    ///< of systems, the largest |T| + |U| there  [J]
};

/// How members are moved.
struct QueueOptions {
  double step = 0;          ///< s; 0: of each member's own choice, by tolerance
  double tolerance = 1e-9;  ///< of the motion, relative to its size, as RunOptions::tolerance
  double enough = 0;  ///< MembersStepperOptions; 0: round-off of constant steps, of chosen ones a part of the tolerance
  std::int64_t energy_every = 0;  ///< steps from one look at the energy to the next; 0: it is not looked at
};

}  // namespace pendula
