#pragma once

#include <optional>
#include <pendula/ensemble/member_view.hpp>
#include <pendula/ensemble/queue_member.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/plain_system.hpp>

namespace pendula {

/// A member of an ensemble of systems of one kernel.
struct QueueSystemMember {
  Motion start;        ///< coordinates and rates
  double end = 0;      ///< s
  PlainSystem system;  ///< its numbers, which outlive it
};

/// How systems come into the lanes of a stepper and out of them.
template <class Stepper>
class SystemSeats {
  struct NoTurns {};
  using Mask = typename Stepper::L::Mask;

 public:
  using Common = MemberSystems<typename Stepper::L>&;
  using Member = QueueSystemMember;
  using Sight = MemberView<Stepper, NoTurns>;

  SystemSeats(Common dynamics, Stepper& stepper) : coordinates_(dynamics.coordinates()), stepper_(stepper) {}

  static Common subject_of(Common dynamics) { return dynamics; }
  void show(std::optional<Sight>& sight) { sight.emplace(stepper_, turns_); }

  Eigen::Index coordinates() const { return coordinates_; }
  bool fits(const Member& /*member*/) const { return true; }

  void take(int lane, const Member& next) {
    stepper_.start(lane, next.start.time, next.system, next.start.q.data(), next.start.v.data());
  }

  void follow(const Mask& /*which*/, const Mask& /*far*/) {}

  void read(int lane, Motion& motion) {
    motion.q.resize(coordinates_);
    motion.v.resize(coordinates_);
    auto& moved = stepper_.chain();
    moved.for_each_rate([&](int i, const auto& rate, const auto&) {
      motion.q[i] = moved.along(i)[0][lane];
      motion.v[i] = rate[0][lane];
    });
  }

 private:
  int coordinates_;
  Stepper& stepper_;
  NoTurns turns_;
};

}  // namespace pendula
