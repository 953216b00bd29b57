#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/natural_units.hpp"

namespace pendula::io {

/// The chain or system of a run.
struct ModelSummary {
  std::string scenario;  ///< the file, as it was named
  std::string space;     ///< "planar" or "spatial"; empty for systems that are no chains
  std::string model;     ///< of a system that is no chain
  std::vector<std::pair<std::string, std::vector<double>>> parameters;  ///< of a system that is no chain
  std::vector<std::pair<std::string, double>> assembled;                ///< of its start, by constraints
  std::vector<std::pair<std::string, double>> guesses;                  ///< of the first of these, the coordinates
  int constraints = 0, degrees_of_freedom = 0;
  double closed_by = 0;  ///< of a chain whose end is held: the largest change of an angle of its start  [rad]
  bool hangs = false;    ///< the same: whether it starts as it hangs at rest
  int links = 0;
  double mass = 0;    ///< Σ m_i
  double length = 0;  ///< Σ l_i
  double gravity = 0;
  bool loaded = false;                  ///< damping, torque, a drive or feedback
  std::vector<std::string> feedback;    ///< inputs that have some
  std::vector<std::string> signals;     ///< the same
  std::optional<NaturalUnits> natural;  ///< units of all numbers; SI if empty
};

/// A state of a chain with its bobs.
struct Snapshot {
  double time = 0;
  Eigen::VectorXd theta, phi, theta_dot, phi_dot;  ///< (n); phi and phi_dot are empty in the plane
  Eigen::MatrixXd bobs, velocities;                ///< (dimension x n)
};

/// A state of another system.
struct SystemSnapshot {
  double time = 0;
  std::vector<std::pair<std::string, double>> q, v;
  std::vector<std::pair<std::string, std::vector<double>>> points;
};

/// How a run ended.
struct Ending {
  std::string status = "ok";  ///< one word
  std::string message;        ///< a sentence; empty for "ok"
  Outcome step;               ///< the failed step, if one failed
  std::string coordinate;     ///< the coordinate that it failed in
  /// The event that ended it, if one did.
  std::string event = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers

  bool ok() const { return message.empty(); }
};

/// The summary of a run. Its text has no warnings, since those were printed as they came.
struct Summary : RunReport {
  ModelSummary model;
  RunRequest asked;
  std::string kernel_by = "build";  ///< ModelKernel::by, where there is a kernel
  Ending ending;
  std::vector<std::string> shown;         ///< columns of the table that is shown
  Snapshot final;                         ///< the last state reached, of a chain
  SystemSnapshot system;                  ///< of any other system
  std::optional<std::string> trajectory;  ///< the file of rows; "-" is standard output
  std::int64_t rows_written = 0;          ///< rows in this file; fewer if the disk is full
  std::optional<std::string> view;        ///< the page
  std::optional<std::string> film;        ///< if there is one
  std::vector<std::string> event_names;   ///< of the events that were looked for
  std::optional<std::string> event_file;
};

/// Whether its steps are implicit.
inline bool has_stages(const Summary& summary) {
  return !is_explicit(summary.options.method);
}

/// How a run ended. `coordinates` is as for pendula::message, `events` are the names of the events. Throws again what
/// an observer threw, except OutputError.
Ending ending_of(const RunReport& report, std::span<const std::string_view> coordinates = {},
                 std::span<const std::string> events = {}, std::span<const std::string_view> switches = {});

template <class Space>
ModelSummary model_summary(const std::string& scenario, const Chain<Space>& chain,
                           const std::optional<NaturalUnits>& natural) {
  ModelSummary model;
  model.scenario = scenario;
  model.space = Space::name;
  model.links = chain.links();
  model.mass = chain.masses().sum();
  model.length = chain.lengths().sum();
  model.gravity = chain.gravity();
  model.loaded = chain.exchanges_energy();
  model.constraints = chain.is_held() ? Space::dimension : 0;
  model.degrees_of_freedom = chain.degrees_of_freedom();
  model.natural = natural;
  return model;
}

ModelSummary model_summary(const std::string& scenario, const SystemSubject& system);

template <class Space, class Motion>
Snapshot snapshot(const Chain<Space>& chain, const Motion& motion) {
  const State<Space> state = motion;
  Snapshot snapshot{
      state.time, state.theta(), {}, state.theta_dot(), {}, bob_positions(chain, state), bob_velocities(chain, state)};
  if constexpr (Space::dof == 2) {
    snapshot.phi = state.phi();
    snapshot.phi_dot = state.phi_dot();
  }
  return snapshot;
}

SystemSnapshot snapshot(const SystemSubject& system, const Motion& motion);

/// The summary as one JSON object, ended by a newline. Numbers read back as the same doubles. What does not apply is
/// null (the stages of "rk4", say), and so is a number that is not finite.
std::string to_json(const Summary& summary);

/// The same for the run file, on one line: without the last state, which the file has, and with public names of files.
std::string to_json_of_file(const Summary& summary);

/// The summaries that have a key.
enum class SummaryScope { anything, chains, systems };

// A key of the JSON object. NOLINTBEGIN(readability-redundant-member-init): left out in designated initializers
struct SummaryKey {
  std::string_view name;
  std::string_view type;  ///< JSON types, separated by blanks, or a JSON Schema
  std::string_view hint;
  std::string_view unit = {};  ///< SI; natural units have the same dimension
  SummaryScope of = SummaryScope::anything;
  std::span<const std::string_view> choices = {};
};  // NOLINTEND(readability-redundant-member-init)

std::vector<SummaryKey> summary_keys();

/// The JSON Schema of summaries.
std::string summary_schema();

/// The summary for people.
std::string to_text(const Summary& summary);

}  // namespace pendula::io
