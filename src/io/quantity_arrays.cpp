#include "io/quantity_arrays.hpp"

#include <algorithm>
#include <limits>

#include "io/errors.hpp"

namespace pendula::io {
namespace {

/// The name of a quantity's array in a file, which may be an older name; empty if there is none.
std::string name_in(const hdf5::Handle& where, const Quantity& quantity) {
  for (const std::string& name : {quantity.name, former_rate_name(quantity.name)}) {
    if (hdf5::has(where, name)) return name;
  }
  return {};
}

}  // namespace

void write_unit(const hdf5::Handle& array, const std::optional<NaturalUnits>& natural, const std::string& unit) {
  for (const auto& [name, text] : unit_attributes(natural, unit)) hdf5::write_attribute(array, name, text);
}

std::vector<std::pair<std::string, std::string>> unit_attributes(const std::optional<NaturalUnits>& natural,
                                                                 const std::string& unit) {
  const std::string own = in_units(natural, unit);
  if (own == unit) return {{"units", unit}};
  return {{"units", "1"}, {"natural_unit", own}};
}

hdf5::Handle create_links(const hdf5::Handle& file, const RunContents& contents) {
  std::size_t links = 0;
  for (const Quantity& quantity : contents.quantities) links = std::max(links, quantity.links);
  for (const Constant& constant : contents.constants) {
    if (constant.per_link) links = std::max(links, constant.values.size());
  }
  if (links == 0) return {};
  hdf5::Handle scale = hdf5::create_numbering(file, "link", links);
  hdf5::write_attribute(scale, "long_name", "number of the link, from the pivot outwards");
  hdf5::write_attribute(scale, "units", "1");
  hdf5::make_scale(scale, "link");
  return scale;
}

std::size_t columns_in(const std::vector<Quantity>& quantities) {
  std::size_t columns = 0;
  for (const Quantity& quantity : quantities) columns += quantity.size();
  return columns;
}

std::vector<double> read_block(const hdf5::Handle& where, const std::vector<Quantity>& quantities, std::size_t first,
                               std::size_t rows) {
  const std::size_t columns = columns_in(quantities);
  std::vector<double> block(rows * columns, std::numeric_limits<double>::quiet_NaN());
  for (const Quantity& quantity : quantities) {
    const std::string name = name_in(where, quantity);
    if (name.empty()) continue;
    const std::vector<double> read = hdf5::read_rows(hdf5::open_dataset(where, name), first, rows);
    const std::size_t size = quantity.size();
    if (read.size() != rows * size) throw ChangedFile("one whose rows are not those of its scenario");
    for (std::size_t i = 0; i < read.size(); ++i) block[i / size * columns + quantity.column(i % size)] = read[i];
  }
  return block;
}

}  // namespace pendula::io
