#pragma once

#include <optional>
#include <pendula/ensemble/member_view.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/plain_system.hpp>

namespace pendula {

/// How systems come into the lanes of a stepper and out of them.
template <class Stepper>
class SystemSeats {
  struct NoTurns {};
  using Mask = typename Stepper::L::Mask;

 public:
  using MemberType = PlainMember<PlainSystem>;
  using Sight = MemberView<Stepper, NoTurns>;

  explicit SystemSeats(Stepper& stepper) : stepper_(stepper) {}

  void show(std::optional<Sight>& sight) { sight.emplace(stepper_, turns_); }

  int coordinates() const { return stepper_.chain().links(); }
  void require(const MemberType& /*member*/, std::size_t /*number*/) const {}

  void take(int lane, const MemberType& next) { stepper_.start(lane, next.start, next.model, next.q, next.v); }

  void follow(const Mask& /*which*/, const Mask& /*far*/) {}

  /// Where the member in a lane is.
  void read(int lane, double* q, double* v) {
    auto& moved = stepper_.chain();
    moved.for_each_rate([&](int i, const auto& rate, const auto&) {
      q[i] = moved.along(i)[0][lane];
      v[i] = rate[0][lane];
    });
  }

 private:
  Stepper& stepper_;
  NoTurns turns_;
};

}  // namespace pendula
