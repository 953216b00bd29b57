#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/system/system_table.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cli/interrupt.hpp"
#include "cli/kept.hpp"
#include "io/ensemble_plan.hpp"
#include "io/event_reader.hpp"
#include "io/journal.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"

namespace pendula::cli {

/// Thrown when the user interrupts a member.
struct Interrupted {};

/// The setup of a member's run, without events. Trials for an accuracy are made only if one is asked for.
template <class Scenario>
RunSetup member_setup(const Scenario& scenario) {
  return {.subject = io::subject_of(scenario),
          .start = scenario.start,
          .options = scenario.run,
          .duration = scenario.duration,
          .every = scenario.every,
          .accuracy = scenario.places.contains("accuracy") ? scenario.accuracy : Accuracy{},
          .doubted = false,
          .estimate = scenario.estimate};
}

/// The scenario of an ensemble, and those of its members, which have other numbers.
class MemberScenarios {
 public:
  /// Reads the file. Unless `quiet`, it says on standard error that a model's kernel is made. Throws io::InputError.
  MemberScenarios(const std::string& file, std::vector<std::string> overrides, bool quiet);

  const io::ScenarioText& text() const { return text_; }
  const std::vector<std::string>& overrides() const { return overrides_; }
  /// The text of the model's file, once a scenario was read; empty if there is none.
  const std::string& model() const { return model_; }

  io::AnyScenario base() { return parse(overrides_); }

  /// The scenario of a member; "quickly" is without places in the file (io::ScenarioDocument). Several threads may call
  /// them. Throws io::InputError.
  io::AnyScenario of_member(const io::EnsemblePlan& plan, std::int64_t member);
  io::AnyScenario quickly_of_member(const io::EnsemblePlan& plan, std::int64_t member);

 private:
  io::AnyScenario parse(const std::vector<std::string>& overrides);
  std::shared_ptr<const SystemTable> find_system(const std::string& name, std::optional<int> links,
                                                 const std::filesystem::path& folder);

  io::FindSystem find() {
    return [this](const std::string& name, std::optional<int> links, const std::filesystem::path& folder) {
      return find_system(name, links, folder);
    };
  }

  io::ScenarioText text_;
  std::vector<std::string> overrides_;
  io::ScenarioDocument document_;
  bool quiet_;
  std::mutex guard_;
  std::map<std::pair<std::string, int>, std::shared_ptr<const SystemTable>> systems_;
  std::string model_;
};

/// Runs members. Several threads may share it.
class MemberRuns {
 public:
  MemberRuns(MemberScenarios& scenarios, const io::EnsemblePlan& plan, const Kept& kept, const InterruptGuard& guard);

  /// Runs a chunk of members, some of them again as a second look. A member that cannot be run has a message. Throws
  /// Interrupted.
  io::DoneChunk run(const Chunk& members) const;

 private:
  struct Member;

  MemberMethod method() const { return plan_.chooses_method ? MemberMethod::quickest : MemberMethod::asked; }
  bool is_looked_at(std::int64_t number) const;
  Member member(std::int64_t number, io::SharedExpressions& shared) const;
  Member member_of(io::AnyScenario scenario, std::int64_t number, io::SharedExpressions& shared) const;
  RunSetup setup_of(const io::AnyScenario& scenario, io::SharedExpressions& shared) const;
  void find_exponents(std::vector<Member>& all) const;
  template <class Scenario>
  RunReport run_alone(const Scenario& scenario, RunSetup setup) const;
  std::string append(const Member& member, std::vector<double>& rows) const;
  template <class Scenario>
  LyapunovSpectrum leading_exponent(const Scenario& scenario) const;

  MemberScenarios& scenarios_;
  const io::EnsemblePlan& plan_;
  const Kept& kept_;
  const InterruptGuard& guard_;
  std::size_t width_;
};

}  // namespace pendula::cli
