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

/// What was moved.
struct ModelSummary {
  std::string scenario;  ///< the file, as it was named
  std::string space;     ///< "planar" or "spatial"; empty for systems that are no chains
  std::string model;     ///< of such a system
  std::vector<std::pair<std::string, std::vector<double>>> parameters;  ///< of such a system
  int links = 0;
  double mass = 0;    ///< Σ m_i
  double length = 0;  ///< Σ l_i
  double gravity = 0;
  bool loaded = false;                  ///< damping, torque or a drive
  std::optional<NaturalUnits> natural;  ///< units of all numbers; empty for SI
};

/// A state with the bobs, in a form that serves both spaces.
struct Snapshot {
  double time = 0;
  Eigen::VectorXd theta, phi, theta_dot, phi_dot;  ///< (n); phi and phi_dot are empty in the plane
  Eigen::MatrixXd bobs, velocities;                ///< (dimension x n)
};

/// A state of a system that is no chain.
struct SystemSnapshot {
  double time = 0;
  std::vector<std::pair<std::string, double>> q, v;
  std::vector<std::pair<std::string, std::vector<double>>> points;
};

/// How a run ended.
struct Ending {
  std::string status = "ok";  ///< a word for programs
  std::string message;        ///< a sentence for people; empty for "ok"
  Outcome step;               ///< the step that failed, where one did
  std::string coordinate;     ///< that it failed in, of a system that is no chain
  /// That ended it, where one did.
  std::string event = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers

  bool ok() const { return message.empty(); }
};

/// Everything that is told about a run; the text leaves warnings out, since they were told as they came.
struct Summary : RunReport {
  ModelSummary model;
  double accuracy = 0;  ///< as asked for
  double duration = 0;  ///< as asked for
  std::int64_t every = 0;
  std::string kernel_by = "build";  ///< ModelKernel::by, where there is a kernel
  RowTimes at;                      ///< rows are there, where there are any
  Ending ending;
  std::vector<std::string> shown;         ///< columns of the table
  Snapshot final;                         ///< the last state reached, of a chain
  SystemSnapshot system;                  ///< of any other system
  std::optional<std::string> trajectory;  ///< the file that rows were written to; "-" is standard output
  std::int64_t rows_written = 0;          ///< that are in this file: fewer, where the disk is full
  std::optional<std::string> view;        ///< the page
  std::vector<std::string> event_names;   ///< of the events that were looked for
  std::optional<std::string> event_file;
};

/// Whether its steps have stages that are solved for.
inline bool has_stages(const Summary& summary) {
  return !is_explicit(summary.options.method);
}

/// How a run ended; `coordinates` as pendula::message takes them. What an observer threw is thrown again, but for
/// OutputError. `events` are their names.
Ending ending_of(const RunReport& report, std::span<const std::string_view> coordinates = {},
                 std::span<const std::string> events = {});

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
  model.loaded = chain.loaded();
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

/// The summary as one JSON object, ended by a newline. Numbers are read back as the same doubles; what does not apply
/// is null (the stages of "rk4", say), as is a number that is not finite.
std::string to_json(const Summary& summary);

/// The same for the run file, on one line: without the last state, which it has, and with public names of files.
std::string to_json_of_file(const Summary& summary);

/// Which summaries have a key.
enum class Moved { anything, chains, systems };

// A key of the JSON object. NOLINTBEGIN(readability-redundant-member-init): left out in designated initializers
struct SummaryKey {
  std::string_view name;
  std::string_view type;  ///< of JSON, several with blanks between, or a JSON Schema
  std::string_view hint;
  std::string_view unit = {};  ///< in natural units that of their kind
  Moved of = Moved::anything;
  std::span<const std::string_view> choices = {};
};  // NOLINTEND(readability-redundant-member-init)

std::vector<SummaryKey> summary_keys();

/// What every such object is, as a JSON Schema.
std::string summary_schema();

/// The summary for people.
std::string to_text(const Summary& summary);

}  // namespace pendula::io
