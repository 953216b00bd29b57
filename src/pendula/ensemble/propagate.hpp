#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/run_report.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Moves every member by run_members, on `threads` threads, each of which takes `chunk` members at once. Calls
/// observe(number, report) with a member's number from 0 on and all that is known of its run: from several threads at
/// once and in any order. Several threads ask `stop` on the way; if it returns true, all members stop and report that.
/// A report depends on its member alone, to the last bit; one that failed says so and stops nobody else. Throws as Run
/// does on a setup that makes no sense, and what `observe` throws.
inline void propagate(
    std::span<const RunSetup> members, int threads,
    const std::function<void(std::size_t number, const RunReport& report)>& observe,
    const std::function<bool()>& stop = [] { return false; }, std::int64_t chunk = 64) {
  std::atomic<std::int64_t> next = 0;
  const auto count = static_cast<std::int64_t>(members.size());
  const std::int64_t size = std::max<std::int64_t>(chunk, 1);
  const auto claim = [&]() -> std::optional<Chunk> {
    const std::int64_t first = next.fetch_add(size);
    if (first >= count) return std::nullopt;
    return Chunk{first, std::min(first + size, count)};
  };
  for_each_chunk(threads, claim, [&](const Chunk& taken) {
    const auto first = static_cast<std::size_t>(taken.first);
    const std::vector<RunReport> reports =
        run_members(members.subspan(first, static_cast<std::size_t>(taken.size())), stop);
    for (std::size_t k = 0; k < reports.size(); ++k) observe(first + k, reports[k]);
  });
}

}  // namespace pendula
