#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <pendula/chain/chain_end.hpp>
#include <pendula/chain/closed_start.hpp>
#include <pendula/numeric/number_text.hpp>
#include <string>
#include <string_view>

#include "io/scenario.hpp"
#include "io/section.hpp"

namespace pendula::io {

/// Whether the start is that of a chain that hangs between its hooks.
inline bool hangs(const Section& start) {
  return start.choice("shape") == 1;
}

/// What holds the last bob, if something does.
template <class Space>
std::optional<ChainEnd> read_end(const Section& chain) {
  if (!chain.find("end")) return {};
  const Section end(chain, "end");
  const bool is_ring = end.truth("ring");
  ChainEnd read;
  const auto take = [&](std::string_view key, std::array<double, 3>& numbers) {
    const std::optional<Entry> entry = end.find(key);
    if (!entry) return false;
    const Eigen::VectorXd given = entry->vector(Space::dimension);
    std::ranges::copy(given, numbers.begin());
    return true;
  };
  if (is_ring && end.find("at")) end.find("at")->fail("nothing beside ring = true, which is held at the pivot");
  if (!is_ring) end.require("at");
  take("at", read.at);
  const bool moves = take("amplitude", read.amplitude);
  const bool has_frequency = take("frequency", read.frequency), has_phase = take("phase", read.phase);
  if (moves && !has_frequency) end.require("frequency");
  if (!moves && (has_frequency || has_phase)) end.require("amplitude");
  return read;
}

/// Brings the start of a chain whose last bob is held to where it is.
template <class Space>
void close_start(const Section& chain, const Section& start_keys, Scenario<Space>& scenario) {
  const bool has_to_hang = hangs(start_keys);
  if (!scenario.chain.is_held()) {
    if (has_to_hang) start_keys.find("shape")->fail("angles for a chain whose end is free; chain.end holds it");
    return;
  }
  const Section end(chain, "end");
  const Entry where = end.find("at") ? *end.find("at") : *end.find("ring");
  const ClosedStart<Space> closed(scenario.chain);
  State<Space>& start = scenario.start;
  if (const std::string against = closed.against(start.time); !against.empty()) where.fail(against);
  if (has_to_hang) {
    if (const auto theta = start_keys.find("theta") ? start_keys.find("theta") : start_keys.find("phi"))
      theta->fail("no angles beside shape = \"hanging\"");
    if (const std::string against = closed.hang(start); !against.empty()) where.fail(against);
    scenario.hangs = true;
    return;
  }
  const auto given = start.q;
  const double gap = closed.gap(start);
  if (!closed.close(start)) {
    start_keys.find("theta")->fail("angles that nearly close: they lead " + shortest(gap) +
                                   " beside where the last bob is held");
  }
  if (closed.is_straight(start)) {
    where.fail("a point to which the chain is not stretched straight, so that it can move");
  }
  scenario.closed_by = (start.q - given).cwiseAbs().maxCoeff();
}

}  // namespace pendula::io
