#pragma once

#include <cstdint>
#include <optional>
#include <pendula/run/run_report.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/system_table.hpp>
#include <tuple>

namespace pendula {

/// The properties that runs must share to go in lanes together.
struct LaneKind {
  int dimension = 0, links = 0;         // of chains
  const SystemTable* kernel = nullptr;  // of other systems, and of chains that move by its series
  int stages = 0;
  Method method = Method::gauss;
  Iteration iteration = Iteration::automatic;
  double step = 0, tolerance = 0;
  std::int64_t every = 0;

  auto tied() const { return std::tie(dimension, links, kernel, stages, method, iteration, step, tolerance, every); }
  bool operator<(const LaneKind& other) const { return tied() < other.tied(); }
  bool operator==(const LaneKind& other) const { return tied() == other.tied(); }
};

/// The kind of a run that goes in lanes with `options`; nullopt for any other run. In lanes go
///   by Gauss steps     chains with the chain solver, if constant steps resolve them, and systems that depend on time
///                      through inputs only; with the numbers of stages that lanes are compiled for
///   by Taylor series   systems
///   by fehlberg78      all chains and systems
/// but no systems whose forces may be narrow by functions other than powers and logarithms.
std::optional<LaneKind> lane_kind(const RunSetup& setup, const RunOptions& options);
std::optional<LaneKind> lane_kind(const RunSetup& setup);
/// The same where each member has a tangent.
std::optional<LaneKind> tangent_lane_kind(const RunSetup& setup, const RunOptions& options);

namespace detail {

/// Whether a substituted method has to prove itself, as for systems and loaded chains: it must conserve the energy
/// where the motion does, and finish soon.
bool has_to_be_tried(const Subject& subject);

}  // namespace detail

}  // namespace pendula
