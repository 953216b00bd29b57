#pragma once

#include <toml++/toml.h>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/ensemble_plan.hpp"
#include "io/event_reader.hpp"
#include "io/journal.hpp"
#include "io/kept.hpp"
#include "io/scenario.hpp"
#include "io/scenario_run.hpp"
#include "io/toolchain.hpp"

namespace pendula::io {

/// A scenario with [ensemble] that is parsed once and read many times with other numbers.
class ScenarioDocument {
 public:
  /// Throws InputError as parse_scenario, and where there is no [ensemble].
  ScenarioDocument(std::string_view text, std::string_view name, std::span<const std::string> overrides);

  const EnsemblePlan& plan() const { return plan_; }

  /// Whether it starts with momenta, of which rates are made by the mass matrix at the coordinates.
  bool starts_with_momenta() const;

  /// The scenario with further overrides. An InputError names these; lines of the file only where there are none.
  AnyScenario with(std::span<const std::string> overrides, const FindSystem& find) const;
  /// The scenario with numbers[k] as the value of keys[k]. Neither it nor the InputError that it throws knows places in
  /// the file.
  AnyScenario with(std::span<const std::string> keys, std::span<const double> numbers, const FindSystem& find) const;

 private:
  std::string name_;
  toml::table root_;  // without [ensemble], which may list every member
  EnsemblePlan plan_;
};

/// Thrown when a member is stopped.
struct Interrupted {};

/// What a member runs. Members that differ in their starts alone share all else.
struct MemberScenario {
  std::shared_ptr<const AnyScenario> scenario;  ///< but for its start
  /// Without events, and not judged. Trials for an accuracy are made only if one is asked for.
  RunSetup setup;

  explicit MemberScenario(AnyScenario read);

  const RunPlan& plan() const {
    return std::visit([](const auto& read) -> const RunPlan& { return read; }, *scenario);
  }
};

/// The scenario of an ensemble, and those of its members, which have other numbers.
class MemberScenarios {
 public:
  using Tell = std::function<void(const std::string&)>;

  /// `tell` is called before a model's kernel is made. Throws InputError.
  MemberScenarios(ScenarioText text, std::vector<std::string> overrides, Toolchain toolchain, Tell tell);

  const ScenarioText& text() const { return text_; }
  const std::vector<std::string>& overrides() const { return overrides_; }
  const EnsemblePlan& plan() const { return document_.plan(); }
  /// The text of the model's file, once a scenario was read; empty if there is none.
  const std::string& model() const { return model_; }

  AnyScenario base() { return document_.with({}, find()); }

  /// The scenario of a member; "quickly" is without places in the file (ScenarioDocument). Several threads may call
  /// them. Throws InputError.
  AnyScenario of_member(std::int64_t member);
  MemberScenario quickly_of_member(std::int64_t member);

 private:
  /// A scenario, and for each key the indices of its number in the start: those in q, then those in v.
  struct Shared {
    MemberScenario scenario;
    std::vector<std::vector<Eigen::Index>> places;
  };
  AnyScenario with(std::span<const double> numbers) { return document_.with(plan().keys(), numbers, find()); }
  std::optional<Shared> find_shared();

  std::shared_ptr<const SystemTable> find_system(const ModelName& name);

  FindSystem find() {
    return [this](const ModelName& name) { return find_system(name); };
  }

  ScenarioText text_;
  std::vector<std::string> overrides_;
  ScenarioDocument document_;
  Toolchain toolchain_;
  Tell tell_;
  std::mutex guard_;
  std::map<ModelName, std::shared_ptr<const SystemTable>> systems_;
  std::string model_;
  std::once_flag is_looked_for_;
  std::optional<Shared> shared_;  // if keys are numbers of the start alone
};

/// Runs members. Several threads may share it.
class MemberRuns {
 public:
  /// If `stop` returns true, members stop.
  MemberRuns(MemberScenarios& scenarios, const KeptQuantities& kept, std::function<bool()> stop);

  /// Runs a chunk of members, some of them again as a second look. A member that cannot be run has a message. Throws
  /// Interrupted.
  DoneChunk run(const Chunk& members) const;

 private:
  struct Member;

  bool is_looked_at(std::int64_t number) const;
  Member member(std::int64_t number, SharedExpressions& shared) const;
  Member member_of(MemberScenario scenario, std::int64_t number, SharedExpressions& shared) const;
  void find_exponents(std::vector<Member>& all) const;
  std::string append(const Member& member, std::vector<double>& rows) const;
  LyapunovSpectrum leading_exponent(const MemberScenario& scenario) const;

  MemberScenarios& scenarios_;
  const EnsemblePlan& plan_;
  const KeptQuantities& kept_;
  std::function<bool()> stop_;
  std::size_t width_;
};

}  // namespace pendula::io
