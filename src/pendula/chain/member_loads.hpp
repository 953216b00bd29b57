#pragma once

#include <array>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/member_inputs.hpp>
#include <vector>

namespace pendula {

/// Loads on the chains of several members, one in each lane: damping, and torques, each at its own time. A member
/// without loads moves as if no member had any, to the last bit.
template <class Space, int N, class L>
class MemberLoads {
  static constexpr std::size_t components = Space::torque_components;

 public:
  explicit MemberLoads(int links)
      : links_(links), torques_(components * static_cast<std::size_t>(links)), inputs_(torques_.rows()) {}

  /// Whether any member so far had loads; which of those in the lanes have.
  bool any() const { return any_; }
  auto loaded() const { return loaded_ > L(0.0); }

  void take(int lane, const Chain<Space, N>& chain, const ChainLinks<Space, N, double>& links) {
    set(loaded_, lane, chain.loaded() ? 1 : 0);
    if (!chain.loaded() && !any_) return;
    if (!any_) drag_.assign(static_cast<std::size_t>(links_), L(0.0));
    any_ = true;
    const std::vector<PlainChain::Drive> drives = plain_drives(chain);
    const ChainSystem system(plain(chain, drives), Space::torque_components);
    inputs_.take(lane, system.plain().inputs, system.plain().sines);
    for (int i = 0; i < links_; ++i) set(drag_[static_cast<std::size_t>(i)], lane, links[i].drag);
  }

  void set_time(const L& time) { inputs_.at(time, torques_); }

  /// The highest frequency that a member is driven with; 0 where there is none.
  L fastest_drive() const { return inputs_.fastest(); }

  /// Torque on a link at the time that was set, over l_i².
  auto torque(int i, const LinkConstants<L>& link) const {
    typename Space::Link::template Torque<L> torque;
    for (std::size_t k = 0; k < components; ++k) {
      torque[k] = link.inverse_square * from_row<L>(torques_[static_cast<std::size_t>(i) * components + k]);
    }
    return torque;
  }

  /// (torque_i × ξ_i − λ_i ξ̇_i)/l_i² of a rod; torque: as above.
  template <class Number, std::size_t D>
  std::array<Number, D> of_rod(int i, const typename Space::Link::template Torque<L>& torque,
                               const std::array<Number, D>& rod, const std::array<Number, D>& rate) const {
    typename Space::Link::template Torque<Number> turning;
    for (std::size_t k = 0; k < components; ++k) turning[k] = Number(torque[k]);
    std::array<Number, D> load;
    Space::Link::torque_load(turning, rod, load);
    const L& drag = drag_[static_cast<std::size_t>(i)];
    for (std::size_t k = 0; k < D; ++k) load[k] = fma(-drag, rate[k], load[k]);
    return load;
  }

 private:
  int links_;
  bool any_ = false;
  L loaded_{0.0};
  PackRows<width_of<L>> torques_;  // at the time that was set
  MemberInputs<L> inputs_;         // torques as functions of time
  std::vector<L> drag_;            // damping, λ_i/l_i²
};

}  // namespace pendula
