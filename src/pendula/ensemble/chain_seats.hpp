#pragma once

#include <array>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/ensemble/member_view.hpp>
#include <pendula/ensemble/queue_member.hpp>
#include <pendula/ensemble/turn_counter.hpp>

namespace pendula {

/// How chains come into the lanes of a stepper and out of them: by angles, whose full turns are counted on the way.
template <class Stepper>
class ChainSeats {
  using Space = typename Stepper::SpaceType;
  static constexpr int N = Stepper::links_known;
  using L = typename Stepper::L;
  using Mask = typename L::Mask;
  using Turns = TurnCounter<Space, N, L>;
  using Links = ChainLinks<Space, N, double>;

 public:
  using Common = const Chain<Space, N>&;  ///< the chain of members who have none of their own
  using Member = QueueMember<Space, N>;
  using Sight = MemberView<Stepper, Turns>;

  ChainSeats(Common chain, Stepper& stepper) : chain_(chain), links_(chain), stepper_(stepper), turns_(chain.links()) {}

  /// What a stepper of such members is made from.
  static int subject_of(Common chain) { return chain.links(); }
  void show(std::optional<Sight>& sight) { sight.emplace(stepper_, turns_); }

  /// Coordinates of a member that fits.
  Eigen::Index coordinates() const { return static_cast<Eigen::Index>(Space::dof) * chain_.links(); }
  bool fits(const Member& member) const { return member.chain == nullptr || member.chain->links() == chain_.links(); }

  void take(int lane, const Member& next) {
    const bool own = next.chain != nullptr;
    const double* q = next.start.q.data();
    stepper_.start(lane, next.start.time, own ? *next.chain : chain_, own ? Links(*next.chain) : links_, q,
                   next.start.v.data());
    turns_.start(lane, q, [this](int i) -> decltype(auto) { return stepper_.chain().along(i); });
  }

  /// These members have taken steps; `far` are those that may have turned far and come back.
  void follow(const Mask& which, const Mask& far) { turns_.follow(which, far, stepper_); }

  /// Where the member in a lane is.
  void read(int lane, Motion& motion) {
    auto& chain = stepper_.chain();
    const int links = chain_.links();
    chain.find_rates();
    motion.q.resize(coordinates());
    motion.v.resize(coordinates());
    for (int i = 0; i < links; ++i) {
      std::array<long double, Space::dof> near;
      for (std::size_t a = 0; a < near.size(); ++a) near[a] = turns_.angles(lane, i)[a];
      const auto angles = user_angles(chain.heading(lane, i), near);
      for (std::size_t a = 0; a < near.size(); ++a) {
        const auto entry = static_cast<Eigen::Index>(a) * links + i;
        motion.q[entry] = static_cast<double>(angles.q[a]);
        motion.v[entry] = static_cast<double>(angles.v[a]);
      }
    }
  }

 private:
  Chain<Space, N> chain_;
  Links links_;
  Stepper& stepper_;
  Turns turns_;
};

}  // namespace pendula
