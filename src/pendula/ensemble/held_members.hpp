#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/ensemble/lane_kind.hpp>
#include <pendula/run/plain_members.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Motions of one system side by side, each with inputs of its own, which are held during a move. They go in lanes if
/// the system and the options allow it (lane_kind), else one by one. The result for a motion depends on that motion
/// alone, to the last bit.
class HeldMembers {
 public:
  /// `duration` of each move  [s]. `options` are those of a motion run alone; in lanes another method may replace
  /// theirs (quickest_in_lanes). Throws std::invalid_argument for a subject with drives, or with functions of several
  /// pieces, and for options that make no sense.
  HeldMembers(std::shared_ptr<const Subject> subject, std::size_t coordinates, const RunOptions& options,
              double duration);

  std::size_t coordinates() const { return coordinates_; }
  std::size_t inputs() const { return inputs_; }

  /// The result of a move: how the first member failed, and which it was; ok if none failed.
  struct MoveResult {
    Outcome outcome;
    std::size_t member = 0;
  };

  /// Moves each of `states`, (members x 2 coordinates): coordinates, then rates, over the duration with its row of
  /// `inputs`, (members x inputs). If a member fails, or `stop` ends the move, all states are unchanged. Throws
  /// std::invalid_argument on sizes that do not fit.
  MoveResult move(std::span<const double> inputs, std::span<double> states, const std::function<bool()>& stop);

 private:
  using Numbers = std::span<const double>;
  bool go_in_lanes(Numbers inputs, Numbers states, std::span<MemberEnd> ends, MemberWatch& watch) const;
  Outcome go_alone(Numbers inputs, Numbers state, const MemberEnd& end, const std::function<bool()>& stop) const;

  std::shared_ptr<const Subject> subject_;
  RunOptions options_, in_lanes_;
  double duration_;
  std::size_t coordinates_, inputs_;
  std::optional<LaneKind> kind_;  // nullopt: no lanes
  std::vector<double> ends_;
};

}  // namespace pendula
