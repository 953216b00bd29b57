#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/ensemble_plan.hpp"
#include "io/journal.hpp"
#include "io/natural_units.hpp"
#include "io/run_file.hpp"

namespace pendula::io {

/// How a member ended, as the data set `status` numbers it: Ending::status, and what only members can be.
inline constexpr std::array<std::string_view, 9> member_statuses = {
    "ok",         "stopped_by_event",     "not_converged", "wrong_root", "tolerance_not_met",
    "not_finite", "singular_mass_matrix", "failed",        "wrong_input"};
inline constexpr int not_run = -1;

/// Of a member's status by name; that of "failed" for any other name.
int member_status(std::string_view name);
/// Whether a member came to its end.
constexpr bool is_ok(int status) {
  return status == 0 || status == 1;
}

/// Whether a member that was looked at again can be trusted, as the data set `trusted` numbers it; −1 of others.
enum class Trusted { no, yes };

/// A number that is kept of every member.
struct EnsembleColumn {
  std::string name;    ///< as it is asked for, `event:flip`: a data set is called so in letters, digits and underscores
  std::string unit;    ///< in SI
  bool whole = false;  ///< a count: an integer in the file, −1 where there is none
  /// In words, where the name has none.
  std::string meaning = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// What an ensemble's file says besides what came of the members.
struct EnsembleHead {
  RunOrigin origin;
  EnsemblePlan plan;
  std::vector<EnsembleColumn> columns;
  std::int64_t chunk = 1;               ///< members of a record of a journal
  std::optional<NaturalUnits> natural;  ///< that the scenario's numbers are in; none for SI

  std::int64_t chunks() const { return (plan.count + chunk - 1) / chunk; }
  Chunk members_of(std::int64_t k) const;
  /// A row of a journal: the status, Trusted or NaN, then the columns.
  std::size_t width() const { return flags + columns.size(); }
  static constexpr std::size_t flags = 2;
  JournalKind kind() const;
};

/// Whether the file has all members of this very ensemble.
bool is_complete(const std::string& file, const EnsembleHead& head);

/// Which chunks are in the journals.
std::vector<bool> done_chunks(const std::string& folder, const EnsembleHead& head);

/// What came of all members that are done.
struct EnsembleTally {
  std::int64_t done = 0;
  std::array<std::int64_t, member_statuses.size()> statuses{};
  std::int64_t looked_at = 0, untrusted = 0;  ///< of those that came to their ends
  std::int64_t first_untrusted = -1;          ///< number of a member
  DoneChunk::Message first_failure{-1, {}};   ///< of the first member that has one

  std::int64_t failed() const { return done - statuses[0] - statuses[1]; }
};

/// Writes the journals in `folder` as one HDF5 file: for every column a data set in the shape of the axes, NaN where a
/// member is not done, and the attribute `complete`. Data sets are the same to the byte whoever wrote the journals.
/// Memory is that of one record, and of the messages. Throws InputError where the file cannot be written, OutputError.
EnsembleTally write_ensemble(const std::string& file, const EnsembleHead& head, const std::string& folder);

}  // namespace pendula::io
