#include "io/run_arrays.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <sstream>
#include <utility>

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

namespace {

/// Arrays of an event, before those of its row.
constexpr std::array<const char*, 3> told = {"event_number", "event_name", "event_direction"};

}  // namespace

std::vector<std::vector<double>> read_events(const hdf5::Handle& group, const std::vector<Quantity>& quantities,
                                             std::size_t first, std::size_t count) {
  const std::vector<double> block = read_block(group, quantities, first, count);
  std::vector<std::vector<double>> events(count);
  for (const char* name : told) {
    const std::vector<double> read = hdf5::read_rows(hdf5::open_dataset(group, name), first, count);
    if (read.size() != count) throw ChangedFile("one whose events are not those of its scenario");
    for (std::size_t k = 0; k < count; ++k) events[k].push_back(read[k]);
  }
  const std::size_t columns = columns_in(quantities);
  for (std::size_t k = 0; k < count; ++k) {
    const auto begin = block.begin() + static_cast<std::ptrdiff_t>(k * columns);
    events[k].insert(events[k].end(), begin, begin + static_cast<std::ptrdiff_t>(columns));
  }
  return events;
}

std::size_t count_events(const hdf5::Handle& group) {
  return hdf5::extent(hdf5::open_dataset(group, told[0]))[0];
}

std::vector<std::string> event_names(const hdf5::Handle& group) {
  std::istringstream words(hdf5::read_attribute(hdf5::open_dataset(group, told[1]), "flag_meanings"));
  return {std::istream_iterator<std::string>(words), {}};
}

void EventList::create(const hdf5::Handle& file, const RunContents& contents, const hdf5::Handle& links) {
  if (contents.events.empty() || contents.quantities.empty()) return;
  using hdf5::Type;
  const hdf5::Handle group = hdf5::create_group(file, "events");
  quantities_ = contents.quantities;
  constexpr std::size_t block = std::size_t{1} << 13, most_rows = 256;
  const std::size_t rows = std::clamp<std::size_t>(block / columns_in(quantities_), 1, most_rows);
  const auto add = [&](const std::string& name, std::size_t size, Type type, const std::string& meaning) {
    datasets_.push_back(hdf5::create_list(group, name, size, rows, type));
    hdf5::write_attribute(datasets_.back(), "long_name", meaning);
    if (datasets_.size() == 1) hdf5::make_scale(datasets_[0], "event_number");
    if (datasets_.size() > 1) hdf5::attach_scale(datasets_.back(), datasets_[0], 0);
    if (size > 0) hdf5::attach_scale(datasets_.back(), links, 1);
  };
  add(told[0], 0, Type::whole, "number of the event, in order of time");
  add(told[1], 0, Type::whole, "which event it is");
  hdf5::write_flags(datasets_.back(), Type::whole, 1, contents.events);
  add(told[2], 0, Type::byte, "whether its expression went up or down through zero");
  hdf5::write_flags(datasets_.back(), Type::byte, 0, std::vector<std::string>{"down", "up"});
  for (const Quantity& quantity : quantities_) {
    add(quantity.name, quantity.links, Type::real, quantity.meaning);
    write_unit(datasets_.back(), contents.natural, quantity.unit);
  }
  names_ = contents.events;
}

void EventList::take_over(const hdf5::Handle& file, std::size_t count) {
  if (!is_there()) return;
  const hdf5::Handle group = hdf5::open_group(file, "events");
  constexpr std::size_t at_once = 1024;
  for (std::size_t first = 0; first < count; first += at_once) {
    for (std::vector<double>& event : read_events(group, quantities_, first, std::min(at_once, count - first))) {
      add(std::move(event));
    }
    write();
  }
}

void EventList::add(const EventRow& happened) {
  if (!is_there()) return;
  const auto which = std::ranges::find(names_, happened.event.name) - names_.begin();
  std::vector<double> row{static_cast<double>(count() + 1), static_cast<double>(which + 1), happened.up ? 1.0 : 0.0};
  row.insert(row.end(), happened.row.numbers.begin(), happened.row.numbers.end());
  add(std::move(row));
}

void EventList::add(std::vector<double> row) {
  hash_ = fingerprint(row, hash_);
  pending_.push_back(std::move(row));
}

double EventList::check() const {
  return as_number(hash_);
}

void EventList::append(std::size_t dataset, const std::vector<double>& numbers) {
  hdf5::set_rows(datasets_[dataset], count());
  hdf5::write_rows(datasets_[dataset], written_, numbers);
}

void EventList::write() {
  if (pending_.empty()) return;
  constexpr std::size_t before = told.size();
  for (std::size_t k = 0; k < datasets_.size(); ++k) {
    std::vector<double> numbers;
    for (const std::vector<double>& row : pending_) {
      if (k < before) {
        numbers.push_back(row[k]);
        continue;
      }
      const Quantity& quantity = quantities_[k - before];
      for (std::size_t i = 0; i < quantity.size(); ++i) numbers.push_back(row[before + quantity.column(i)]);
    }
    append(k, numbers);
  }
  written_ = count();
  pending_.clear();
}

void EventList::close() {
  for (hdf5::Handle& dataset : datasets_) dataset.close();
}

void EventList::abandon() {
  for (hdf5::Handle& dataset : datasets_) dataset.abandon();
}

}  // namespace pendula::io
