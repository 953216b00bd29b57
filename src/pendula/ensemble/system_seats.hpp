#pragma once

#include <optional>
#include <pendula/ensemble/member_view.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/plain_system.hpp>

namespace pendula {

/// Puts systems into the lanes of a stepper and reads them there.
template <class Stepper>
class SystemSeats {
  struct NoTurns {};
  using Mask = typename Stepper::L::Mask;

 public:
  using MemberType = PlainMember<PlainSystem>;
  using View = MemberView<CoordinateSpace, typename Stepper::L, NoTurns>;

  explicit SystemSeats(Stepper& stepper) : stepper_(stepper), sight_(stepper) {}

  void show(std::optional<View>& view) { view.emplace(sight_, turns_); }

  int coordinates() const { return stepper_.chain().count(); }
  void require(const MemberType& /*member*/, std::size_t /*number*/) const {}

  void take(int lane, const MemberType& next) { stepper_.start(lane, next.start, next.model, next.q, next.v); }

  void follow(const Mask& /*which*/, const Mask& /*far*/) {}

  /// Reads the state of the member in a lane.
  void read(int lane, double* q, double* v) {
    auto& moved = stepper_.chain();
    moved.for_each_rate([&](int i, const auto& rate, const auto&) {
      q[i] = moved.along(i)[0][lane];
      v[i] = rate[0][lane];
    });
  }

 private:
  Stepper& stepper_;
  SightOf<Stepper> sight_;
  NoTurns turns_;
};

}  // namespace pendula
