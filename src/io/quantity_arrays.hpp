#pragma once

#include <cstddef>
#include <optional>
#include <pendula/run/quantity.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/hdf5.hpp"
#include "io/natural_units.hpp"

namespace pendula::io {

/// The quantities of a run file, in SI or in natural units.
struct RunContents {
  std::vector<Quantity> quantities;  ///< columns of a row
  std::vector<Constant> constants;
  std::vector<std::string> events;  ///< names of the events that the run looks for
  std::optional<NaturalUnits> natural;
  /// What points are drawn as, JSON (view/scene.hpp); empty of a chain.
  std::string drawing = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// Attributes that tell a unit as UDUNITS knows it, and beside it the natural unit.
std::vector<std::pair<std::string, std::string>> unit_attributes(const std::optional<NaturalUnits>& natural,
                                                                 const std::string& unit);
/// Writes them.
void write_unit(const hdf5::Handle& array, const std::optional<NaturalUnits>& natural, const std::string& unit);

/// Makes the scale of the axis of links, if any array has that axis.
hdf5::Handle create_links(const hdf5::Handle& file, const RunContents& contents);

/// Numbers in a row of quantities.
std::size_t columns_in(const std::vector<Quantity>& quantities);

/// Reads rows, one after the other; NaN for a quantity that an older file lacks. Throws ChangedFile.
std::vector<double> read_block(const hdf5::Handle& where, const std::vector<Quantity>& quantities, std::size_t first,
                               std::size_t rows);

}  // namespace pendula::io
