#pragma once

#include <array>
#include <cstddef>
#include <pendula/lanes/lane_columns.hpp>
#include <pendula/lanes/lane_links.hpp>
#include <pendula/lanes/lane_loads.hpp>
#include <pendula/system/forcing_look.hpp>
#include <vector>

namespace pendula {

/// LaneLoads at the stages of a Gauss step.
template <class Space, int S, int N, class L>
class LaneStageLoads {
 public:
  using Columns = LaneColumns<S, L>;
  static constexpr std::size_t D = Space::dimension;

  explicit LaneStageLoads(int links) : loads_(links), links_(static_cast<std::size_t>(links)) {}

  bool any() const { return loads_.any(); }
  auto loaded() const { return loads_.loaded(); }

  void take(int lane, const Chain<Space, N>& chain, const ChainLinks<Space, N, double>& links) {
    loads_.take(lane, chain, links);
    if (any()) torques_.resize(links_);
  }

  /// The longest step in which stages sum up what members are driven by, to a tolerance.
  L longest_step(double tolerance) const { return L(SineTurn(S, 2 * S).within(tolerance)) / loads_.fastest_drive(); }

  /// Of steps from `time` on, for which the columns are; link(i): a LaneLink.
  template <class LinkAt>
  void prepare(const L& time, const Columns& columns, LinkAt link) {
    for (int j = 0; j < S; ++j) {
      loads_.set_time(time + columns.hc(j));
      for (std::size_t i = 0; i < links_; ++i) {
        const Torque torque = loads_.torque(static_cast<int>(i), link(static_cast<int>(i)));
        for (std::size_t k = 0; k < torque.size(); ++k) {
          torques_[i][static_cast<std::size_t>(j)][k] = columns.hb(j) * torque[k];
        }
      }
    }
  }

  /// h b times what they add to the pull of a rod; rods, and h b times their rates, at the stages.
  template <class Stages>
  std::array<Stages, D> pull(int i, const std::array<Stages, D>& rods, const std::array<Stages, D>& advance) const {
    std::array<Stages, D> pull;
    for (std::size_t j = 0; j < static_cast<std::size_t>(S); ++j) {
      const auto at_stage = [j](const std::array<Stages, D>& of) {
        return components<D>([&](std::size_t k) { return of[k][j]; });
      };
      const auto load = loads_.of_rod(i, torques_[static_cast<std::size_t>(i)][j], at_stage(rods), at_stage(advance));
      for (std::size_t k = 0; k < D; ++k) pull[k][j] = -load[k];
    }
    return pull;
  }

 private:
  using Torque = typename Space::Link::template Torque<L>;

  LaneLoads<Space, N, L> loads_;
  std::size_t links_;
  std::vector<std::array<Torque, static_cast<std::size_t>(S)>> torques_;  // h b times these, over l²
};

}  // namespace pendula
