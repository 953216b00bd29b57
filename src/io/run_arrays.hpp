#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/run/observer.hpp>
#include <pendula/run/quantity.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/hdf5.hpp"
#include "io/natural_units.hpp"
#include "io/provenance.hpp"

namespace pendula::io {

/// The quantities of a run file, in SI or in natural units.
struct RunContents {
  std::vector<Quantity> quantities;  ///< columns of a row
  std::vector<Constant> constants;
  std::vector<std::string> events;  ///< names of the events that the run looks for
  std::optional<NaturalUnits> natural;
  /// What points are drawn as, JSON (view/scene.hpp); empty for a chain.
  std::string drawing = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// Attributes with a unit as UDUNITS knows it, and with the natural unit.
std::vector<std::pair<std::string, std::string>> unit_attributes(const std::optional<NaturalUnits>& natural,
                                                                 const std::string& unit);
/// Writes these attributes.
void write_unit(const hdf5::Handle& array, const std::optional<NaturalUnits>& natural, const std::string& unit);

/// Makes the scale of the axis of links, if any array has that axis.
hdf5::Handle create_links(const hdf5::Handle& file, const RunContents& contents);

/// How many numbers a row of quantities has.
std::size_t columns_in(const std::vector<Quantity>& quantities);

/// Reads rows, one after the other; NaN for a quantity that an older file lacks. Throws ChangedFile.
std::vector<double> read_block(const hdf5::Handle& where, const std::vector<Quantity>& quantities, std::size_t first,
                               std::size_t rows);

/// Reads events of the group `events` of a run file, one after the other. Each has its number, the index of the event
/// (from 1), whether it went up, and the row at that instant. Throws ChangedFile.
std::vector<std::vector<double>> read_events(const hdf5::Handle& group, const std::vector<Quantity>& quantities,
                                             std::size_t first, std::size_t count);
/// How many events that group has, and their names.
std::size_t count_events(const hdf5::Handle& group);
std::vector<std::string> event_names(const hdf5::Handle& group);

/// The group `events` of a run file: one row for each event, written in place as it happens.
class EventList {
 public:
  /// Makes the group; nothing is written if the run looks for no events.
  void create(const hdf5::Handle& file, const RunContents& contents, const hdf5::Handle& links);
  /// Copies the first `count` events of another file.
  void take_over(const hdf5::Handle& file, std::size_t count);

  void add(const EventRow& happened);
  bool is_there() const { return !datasets_.empty(); }
  std::size_t count() const { return written_ + pending_.size(); }
  /// The checksum of all events.
  double check() const;
  void write();
  void close();
  void abandon();

 private:
  void add(std::vector<double> row);
  void append(std::size_t dataset, const std::vector<double>& numbers);

  std::vector<Quantity> quantities_;
  std::vector<std::string> names_;
  std::vector<hdf5::Handle> datasets_;  // number, event, direction, quantities
  std::vector<std::vector<double>> pending_;
  std::size_t written_ = 0;
  std::uint64_t hash_ = empty_fingerprint;
};

}  // namespace pendula::io
