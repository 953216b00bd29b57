#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/ensemble/member_view.hpp>
#include <pendula/ensemble/turn_counter.hpp>
#include <pendula/run/plain_members.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Puts chains into the lanes of a stepper, reads their angles there, and counts full turns along their motions.
template <class Stepper>
class ChainSeats {
  using Space = typename Stepper::SpaceType;
  static constexpr int N = Stepper::links_known;
  using L = typename Stepper::L;
  using Mask = typename L::Mask;
  using Turns = TurnCounter<Space, L>;

 public:
  using MemberType = PlainMember<PlainChain>;
  using View = MemberView<Space, L, Turns>;

  explicit ChainSeats(Stepper& stepper) : stepper_(stepper), sight_(stepper), turns_(links()) {}

  void show(std::optional<View>& view) { view.emplace(sight_, turns_); }

  int coordinates() const { return Space::dof * links(); }
  /// Throws std::invalid_argument if a member, with its number from 0 on, has another number of links.
  void require(const MemberType& member, std::size_t number) const {
    if (member.model.links == links()) return;
    throw std::invalid_argument("ensemble: member " + std::to_string(number + 1) + ": expected " +
                                std::to_string(links()) + " links, got " + std::to_string(member.model.links));
  }

  void take(int lane, const MemberType& next) {
    const Chain<Space, N> chain = chain_of<Space, N>(next.model);
    stepper_.start(lane, next.start, chain, ChainLinks<Space, N, double>(chain), next.q, next.v);
    turns_.start(lane, next.q, [this](int i) -> decltype(auto) { return stepper_.chain().along(i); });
  }

  /// Counts the turns of members that have taken a step; `far` are those that may have turned far and come back.
  void follow(const Mask& which, const Mask& far) { turns_.follow(which, far, stepper_.chain(), sight_); }

  /// Reads the state of the member in a lane.
  void read(int lane, double* q, double* v) {
    auto& chain = stepper_.chain();
    chain.find_rates();
    for (int i = 0; i < links(); ++i) {
      std::array<long double, Space::dof> near;
      for (std::size_t a = 0; a < near.size(); ++a) near[a] = turns_.angles(lane, i)[a];
      const auto angles = user_angles(chain.heading(lane, i), near);
      for (std::size_t a = 0; a < near.size(); ++a) {
        const std::size_t entry = a * static_cast<std::size_t>(links()) + static_cast<std::size_t>(i);
        q[entry] = static_cast<double>(angles.q[a]);
        v[entry] = static_cast<double>(angles.v[a]);
      }
    }
  }

 private:
  int links() const { return stepper_.chain().count(); }

  Stepper& stepper_;
  SightOf<Stepper> sight_;
  Turns turns_;
};

}  // namespace pendula
