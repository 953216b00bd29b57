#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/ensemble_file.hpp"
#include "io/kept.hpp"
#include "io/members.hpp"
#include "io/natural_units.hpp"

namespace pendula::io {

/// What an ensemble is made of.
struct EnsembleSource {
  ScenarioText scenario;
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string command;                 ///< as typed, for the file
  Toolchain toolchain;
};

/// An ensemble that a scenario asks for. Its members are moved in chunks, by any threads, in any order.
class EnsembleJob {
 public:
  /// `tell` is called before a model's kernel is made; if `stop` returns true, members stop. Throws InputError.
  EnsembleJob(const EnsembleSource& source, MemberScenarios::Tell tell, std::function<bool()> stop);
  EnsembleJob(const EnsembleJob&) = delete;
  EnsembleJob& operator=(const EnsembleJob&) = delete;

  const EnsembleHead& head() const { return head_; }
  /// The name of the scenario's file in messages.
  const std::string& name() const { return scenarios_.text().name; }

  /// Throws InputError if none of some evenly chosen members has a valid scenario: then a key is wrong, not a number.
  void require_members();

  /// Moves members. Throws Interrupted.
  DoneChunk run(const Chunk& members) const { return runs_.run(members); }

  /// What to be warned of when all members are done.
  std::vector<std::string> warnings(const EnsembleTally& tally) const;

 private:
  bool go_in_lanes() const;
  RunOrigin origin(const std::string& command) const;

  MemberScenarios scenarios_;
  AnyScenario base_;
  KeptQuantities kept_;
  EnsembleHead head_;
  MemberRuns runs_;
};

/// Moves the chunks whose numbers `claim` hands out, on `threads` threads, and calls take(chunk) of each that is done,
/// from several of them at once. Those that were stopped are left out.
void run_chunks(const EnsembleJob& job, int threads, const std::function<std::optional<std::int64_t>()>& claim,
                const std::function<void(const DoneChunk&)>& take);

}  // namespace pendula::io
