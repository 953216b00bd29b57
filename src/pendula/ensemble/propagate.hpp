#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// One motion of an ensemble: a subject, which members may share, and its start.
struct EnsembleMember {
  std::shared_ptr<const Subject> subject;
  Motion start;
};

/// How members are moved.
struct EnsembleSchedule {
  RunOptions options;
  double duration = 10;    ///< s
  std::int64_t every = 1;  ///< steps from one look at the energy to the next
  /// Looked for in each member.
  std::vector<Event> events = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  bool estimate = false;           ///< whether to look at members again, and warn in their reports
  bool chooses_method = false;     ///< as RunSetup's
  int threads = 1;
  std::int64_t chunk = 64;  ///< members that a thread takes at once
  /// Called on the way by several threads at once; if it returns true, all members stop and report that.
  std::function<bool()> stop = [] { return false; };
};

/// Moves every member, and calls observe(number, report) with its number from 0 on and all that is known of its run:
/// from several threads at once and in any order. A report depends on its member alone, to the last bit; one that
/// failed says so and stops nobody else. Throws as Run does on a schedule that makes no sense, and what `observe`
/// throws.
inline void propagate(std::span<const EnsembleMember> members, const EnsembleSchedule& schedule,
                      const std::function<void(std::size_t number, const RunReport& report)>& observe) {
  std::atomic<std::int64_t> next = 0;
  const auto count = static_cast<std::int64_t>(members.size());
  const std::int64_t size = std::max<std::int64_t>(schedule.chunk, 1);
  const auto claim = [&]() -> std::optional<Chunk> {
    const std::int64_t first = next.fetch_add(size);
    if (first >= count) return std::nullopt;
    return Chunk{first, std::min(first + size, count)};
  };
  for_each_chunk(schedule.threads, claim, [&](const Chunk& chunk) {
    std::vector<RunSetup> setups;
    const auto first = static_cast<std::size_t>(chunk.first);
    for (const EnsembleMember& member : members.subspan(first, static_cast<std::size_t>(chunk.size()))) {
      setups.push_back({.subject = member.subject,
                        .start = member.start,
                        .options = schedule.options,
                        .duration = schedule.duration,
                        .every = schedule.every,
                        .doubted = schedule.estimate,
                        .events = schedule.events,
                        .chooses_method = schedule.chooses_method});
    }
    const std::vector<RunReport> reports = run_members(setups, schedule.stop);
    for (std::size_t k = 0; k < reports.size(); ++k) observe(first + k, reports[k]);
  });
}

}  // namespace pendula
