#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "io/ensemble_plan.hpp"
#include "io/hdf5.hpp"
#include "io/journal.hpp"
#include "io/natural_units.hpp"
#include "io/run_file.hpp"

namespace pendula::io {

/// How a member ended, as numbered in the data set `status`: the words of Ending::status, and those that only members
/// can have.
inline constexpr std::array<std::string_view, 10> member_statuses = {
    "ok",         "stopped_by_event",     "not_converged", "wrong_root",  "tolerance_not_met",
    "not_finite", "singular_mass_matrix", "failed",        "wrong_input", "stuck_at_switch"};
inline constexpr int not_run = -1;

/// The number of a status; any unknown name counts as "failed".
int member_status(std::string_view name);
/// Whether a member ran to its end.
constexpr bool is_ok(int status) {
  return status == 0 || status == 1;
}

/// Result of a second look at a member, as numbered in the data set `trusted`; −1 if there was no second look.
enum class Trusted { no, yes };

/// A quantity that is kept for every member.
struct EnsembleColumn {
  std::string name;    ///< as asked for, `event:flip`; its data set is named in letters, digits and underscores
  std::string unit;    ///< in SI
  bool whole = false;  ///< a count: an integer in the file, −1 where there is none
  /// Long name, if the name alone does not say it.
  std::string meaning = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// The contents of an ensemble's file besides the results of its members.
struct EnsembleHead {
  RunOrigin origin;
  EnsemblePlan plan;
  std::vector<EnsembleColumn> columns;
  std::int64_t chunk = 1;               ///< members in one record of a journal
  std::optional<NaturalUnits> natural;  ///< units of the scenario's numbers; nullopt for SI

  std::int64_t chunks() const { return (plan.count + chunk - 1) / chunk; }
  Chunk members_of(std::int64_t k) const;
  /// Length of a row in a journal: the status, Trusted or NaN, then the columns.
  std::size_t width() const { return flags + columns.size(); }
  static constexpr std::size_t flags = 2;
  JournalKind kind() const;
};

/// Whether the file has all members of this very ensemble.
bool is_complete(const std::string& file, const EnsembleHead& head);

/// The chunks that the journals hold.
std::vector<bool> done_chunks(const std::string& folder, const EnsembleHead& head);

/// Results of all members that are done.
struct EnsembleTally {
  std::int64_t done = 0;
  std::array<std::int64_t, member_statuses.size()> statuses{};
  std::int64_t looked_at = 0, untrusted = 0;  ///< among those that ran to their end
  std::int64_t first_untrusted = -1;          ///< number of a member
  DoneChunk::Message first_failure{-1, {}};   ///< message of the first member that has one

  /// Adds the rows of members, of `width` numbers each.
  void add(const DoneChunk& chunk, std::size_t width);
  std::int64_t failed() const { return done - statuses[0] - statuses[1]; }
};

/// Writes the journals in `folder` as one HDF5 file. Every column becomes a data set in the shape of the axes, NaN
/// where a member is not done; the attribute `complete` says whether all are. Data sets do not depend on who wrote the
/// journals, to the byte. Only one record and the messages are held in memory. Throws InputError if the file cannot be
/// opened, OutputError if it cannot be written.
EnsembleTally write_ensemble(const std::string& file, const EnsembleHead& head, const std::string& folder);

/// A data set of an ensemble: its scale, or one number of each member.
struct EnsembleArray {
  enum class Source {
    axis,    ///< values of an axis; a scale
    number,  ///< numbers of the members; a scale where there are no axes
    row,     ///< a column of the rows of journals
    draw     ///< values of a key that each member has for itself
  };

  std::string name;     ///< letters, digits and underscores
  std::string meaning;  ///< long name
  std::string unit;     ///< in SI; empty if there is none
  hdf5::Type type = hdf5::Type::real;
  Source source = Source::row;
  std::size_t index = 0;           ///< of the axis, the column or the draw
  std::vector<std::string> flags;  ///< meanings of -1, 0, 1, ...; empty where values are numbers

  bool is_scale() const { return source == Source::axis || source == Source::number; }
};

/// A number of a row as its data set has it: among integers, -1 stands for a missing one.
template <class Number>
Number stored(double value) {
  return std::is_floating_point_v<Number> || !std::isnan(value) ? static_cast<Number>(value) : Number(-1);
}

/// The data sets of an ensemble's file, scales first, in the order of the axes.
std::vector<EnsembleArray> arrays_of(const EnsembleHead& head);

/// Attributes of the file: its origin, and how many members are done.
using EnsembleAttribute = std::pair<std::string, std::variant<std::string, std::int64_t>>;
std::vector<EnsembleAttribute> attributes_of(const EnsembleHead& head, std::int64_t done);

}  // namespace pendula::io
