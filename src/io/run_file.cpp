#include "io/run_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "io/fingerprint.hpp"
#include "io/input_error.hpp"
#include "io/link_target.hpp"
#include "io/output_error.hpp"
#include "io/process.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

// Of a row of the table of checkpoints; after them the numbers of the two members, and three of RunSoFar, which tables
// of old have not.
enum Column : std::size_t { check, serial, at_time, kept_rows, since_row, integrator_size, record_size, numbers };
constexpr std::size_t numbers_so_far = 3;

/// Slots for checkpoints: what is being written is never the last that is whole.
constexpr std::size_t slots = 2;

/// What a run file says that it was not written with.
class Changed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Of numbers to the last bit, `before` being that of those before them.
std::uint64_t fingerprint_of(std::span<const double> numbers, std::uint64_t before = empty_fingerprint) {
  std::uint64_t hash = before;
  for (const double number : numbers) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(number)) * 0x100000001b3U;
    hash ^= hash >> 32;
  }
  return hash;
}

/// What a double holds of it.
double as_number(std::uint64_t fingerprint) {
  return static_cast<double>(fingerprint >> 12);
}

/// A number that tells whether all others came through.
double checksum(std::span<const double> row) {
  return as_number(fingerprint_of(row.subspan(check + 1)));
}

/// Of what a run began with, but for what whoever goes on compares with itself.
std::uint64_t fingerprint_of(const RunOrigin& origin) {
  std::vector<std::string> texts = {origin.history, origin.scenario_name, origin.scenario, origin.model};
  texts.insert(texts.end(), origin.overrides.begin(), origin.overrides.end());
  std::uint64_t hash = empty_fingerprint;
  for (const std::string& text : texts) hash = fingerprint(text, fingerprint(std::to_string(text.size()) + ':', hash));
  return hash;
}

std::vector<double> to_row(const Checkpoint& checkpoint, const RunSoFar& so_far, std::uint64_t count) {
  std::vector<double> row(numbers);
  row[serial] = static_cast<double>(count);
  row[at_time] = checkpoint.time;
  row[kept_rows] = static_cast<double>(checkpoint.rows);
  row[since_row] = static_cast<double>(checkpoint.since_row);
  row[integrator_size] = static_cast<double>(checkpoint.integrator.numbers.size());
  row[record_size] = static_cast<double>(checkpoint.record.numbers.size());
  for (const Member* member : {&checkpoint.integrator, &checkpoint.record}) {
    row.insert(row.end(), member->numbers.begin(), member->numbers.end());
  }
  row.insert(row.end(), {static_cast<double>(so_far.events), so_far.rows_check, so_far.events_check});
  row[check] = checksum(row);
  return row;
}

/// None in a table of old.
std::optional<RunSoFar> so_far_in(std::span<const double> row) {
  const auto before = static_cast<std::size_t>(row[integrator_size] + row[record_size]) + numbers;
  if (row.size() == before) return std::nullopt;
  if (row.size() != before + numbers_so_far) throw Changed("one whose places to go on from are of another layout");
  const auto last = row.last(numbers_so_far);
  return RunSoFar{static_cast<std::size_t>(last[0]), last[1], last[2]};
}

Checkpoint from_row(std::span<const double> row) {
  Checkpoint checkpoint;
  checkpoint.time = row[at_time];
  checkpoint.rows = static_cast<std::int64_t>(row[kept_rows]);
  checkpoint.since_row = static_cast<std::int64_t>(row[since_row]);
  const auto first = row.begin() + numbers, second = first + static_cast<std::ptrdiff_t>(row[integrator_size]);
  checkpoint.integrator.numbers.assign(first, second);
  checkpoint.record.numbers.assign(second, second + static_cast<std::ptrdiff_t>(row[record_size]));
  return checkpoint;
}

bool is_whole(std::span<const double> row) {
  return row[serial] > 0 && row[check] == checksum(row);
}

/// The last checkpoint that is whole, of rows that are there; none where none is.
std::optional<std::vector<double>> last_checkpoint(const hdf5::Handle& run, double rows) {
  if (!hdf5::has(run, "checkpoint")) return std::nullopt;
  const hdf5::Handle table = hdf5::open_dataset(run, "checkpoint");
  std::optional<std::vector<double>> last;
  for (std::size_t slot = 0; slot < slots; ++slot) {
    std::vector<double> row = hdf5::read_rows(table, slot, 1);
    if (!is_whole(row) || row[kept_rows] > rows) continue;
    if (!last || row[serial] > (*last)[serial]) last = std::move(row);
  }
  return last;
}

/// A word, such as the name of a kernel; may be empty. Throws Changed.
std::string read_word(const hdf5::Handle& object, const std::string& name) {
  std::string word = hdf5::read_attribute(object, name);
  if (!std::ranges::all_of(word, [](char c) { return c > ' ' && c < '\x7f'; })) {
    throw Changed("one whose attribute \"" + name + "\" is damaged");
  }
  return word;
}

RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run) {
  RunOrigin origin;
  origin.version = read_word(file, "pendula");
  origin.instruction_set = read_word(file, "instruction_set");
  origin.solver = read_word(file, "solver");
  origin.kernel = read_word(file, "kernel");
  if (hdf5::has_attribute(file, "history")) origin.history = hdf5::read_attribute(file, "history");
  origin.scenario_name = hdf5::read_attribute(run, "scenario_file");
  origin.scenario = hdf5::read_text(run, "scenario");
  origin.overrides = nlohmann::json::parse(hdf5::read_text(run, "set")).get<std::vector<std::string>>();
  origin.model = hdf5::read_text(run, "model");
  return origin;
}

/// Throws Changed unless the file has been written with them.
void require_written(const RunOrigin& origin, const hdf5::Handle& run) {
  if (static_cast<std::uint64_t>(hdf5::read_number(run, "checksum")) == fingerprint_of(origin)) return;
  throw Changed("one whose scenario, settings or model are not what it was written with");
}

/// Does it to a run file that a run goes on from. Throws InputError where the file is damaged.
template <class Do>
auto guarded_source(const std::string& file, Do it) {
  const auto reject = [&](const std::string& what) {
    throw InputError(file + ": expected a run file to go on from, got " + what);
  };
  std::error_code unknown;
  if (!fs::exists(file, unknown)) reject("a file that is not there");
  hdf5::begin();
  try {
    return it();
  } catch (const hdf5::Error& error) {
    reject(std::string("one that HDF5 cannot read: ") + error.what());
  } catch (const nlohmann::json::exception&) {
    reject("one whose list of settings is damaged");
  } catch (const Changed& error) {
    reject(error.what());
  }
  throw std::logic_error("guarded_source");  // not reached
}

/// A scale of the axis of links, where anything has one.
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

/// The array of a quantity in a file, by the name that it has there; empty where it has none.
std::string name_in(const hdf5::Handle& where, const Quantity& quantity) {
  for (const std::string& name : {quantity.name, former_rate_name(quantity.name)}) {
    if (hdf5::has(where, name)) return name;
  }
  return {};
}

std::size_t columns_in(const std::vector<Quantity>& quantities) {
  std::size_t columns = 0;
  for (const Quantity& quantity : quantities) columns += quantity.size();
  return columns;
}

/// Rows of quantities, one after the other; NaN where a file of old does not have one.
std::vector<double> read_block(const hdf5::Handle& where, const std::vector<Quantity>& quantities, std::size_t first,
                               std::size_t rows) {
  const std::size_t columns = columns_in(quantities);
  std::vector<double> block(rows * columns, std::numeric_limits<double>::quiet_NaN());
  for (const Quantity& quantity : quantities) {
    const std::string name = name_in(where, quantity);
    if (name.empty()) continue;
    const std::vector<double> read = hdf5::read_rows(hdf5::open_dataset(where, name), first, rows);
    const std::size_t size = quantity.size();
    if (read.size() != rows * size) throw Changed("one whose rows are not those of its scenario");
    for (std::size_t i = 0; i < read.size(); ++i) block[i / size * columns + quantity.column(i % size)] = read[i];
  }
  return block;
}

/// What a file has of a run that goes on: events only where it had them from the beginning.
RunContents going_on(RunContents contents, const SavedRun& saved) {
  if (saved.checkpoint && !saved.has_events) contents.events.clear();
  return contents;
}

/// Of numbers that all runs of this kind have; a chunk of a quantity has about 32 kB where there are few.
std::size_t chunk_rows(std::size_t columns) {
  constexpr std::size_t block = std::size_t{1} << 17;
  return std::clamp<std::size_t>(block / std::max<std::size_t>(columns, 1), 4, 4096);
}

}  // namespace

SavedRun read_saved_run(const std::string& file) {
  return guarded_source(file, [&] {
    const hdf5::Handle opened = hdf5::open_file(file);
    if (!hdf5::has(opened, "run")) throw Changed("a file without the group \"run\"");
    const hdf5::Handle run = hdf5::open_group(opened, "run");
    SavedRun saved;
    // Where texts are, HDF5 has no checksums, and goes in circles through what is damaged.
    if (!comes_to_an_end([&] { read_origin(opened, run); })) throw Changed("one that is damaged");
    saved.origin = read_origin(opened, run);
    saved.has_rows = hdf5::has(opened, "t");
    double rows = std::numeric_limits<double>::infinity();
    if (saved.has_rows) rows = static_cast<double>(hdf5::extent(hdf5::open_dataset(opened, "t"))[0]);
    if (const auto last = last_checkpoint(run, rows)) {
      saved.checkpoint = from_row(*last);
      saved.so_far = so_far_in(*last);
    }
    // Files of old have no checksums.
    const bool is_old = saved.checkpoint ? !saved.so_far : !hdf5::has_attribute(run, "checksum");
    if (!is_old) require_written(saved.origin, run);
    saved.has_events = hdf5::has(opened, "events");
    return saved;
  });
}

void write_saved_run(const std::string& file, const RunOrigin& origin, const Checkpoint& checkpoint) {
  RunFile written(file, origin, {});
  written.keep(checkpoint);
  written.finish();
  written.conclude("");
}

void write_unit(const hdf5::Handle& array, const std::optional<NaturalUnits>& natural, const std::string& unit) {
  const std::string own = in_units(natural, unit);
  hdf5::write_attribute(array, "units", own == unit ? unit : "1");
  if (own != unit) hdf5::write_attribute(array, "natural_unit", own);
}

namespace {

/// Arrays that tell of an event, before those of its row.
constexpr std::array<const char*, 3> told = {"event_number", "event_name", "event_direction"};

}  // namespace

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
  const std::size_t columns = columns_in(quantities_);
  constexpr std::size_t at_once = 1024;
  for (std::size_t first = 0; first < count; first += at_once) {
    const std::size_t rows = std::min(at_once, count - first);
    const std::vector<double> block = read_block(group, quantities_, first, rows);
    std::vector<std::vector<double>> events(rows);
    for (const char* name : told) {
      const std::vector<double> read = hdf5::read_rows(hdf5::open_dataset(group, name), first, rows);
      if (read.size() != rows) throw Changed("one whose events are not those of its scenario");
      for (std::size_t k = 0; k < rows; ++k) events[k].push_back(read[k]);
    }
    for (std::size_t k = 0; k < rows; ++k) {
      const auto begin = block.begin() + static_cast<std::ptrdiff_t>(k * columns);
      events[k].insert(events[k].end(), begin, begin + static_cast<std::ptrdiff_t>(columns));
      add(std::move(events[k]));
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
  hash_ = fingerprint_of(row, hash_);
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

RunFile::Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

// Of the kind that HDF5 does not use: readers of the file take that one.
void RunFile::Lock::take(const std::string& file, const std::string& name) {
  descriptor_ = open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor_ < 0) reject_output(name, file, errno);
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (fcntl(descriptor_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES)) {
    reject_output(name, "one that another run writes");
  }
}

RunFile::RunFile(const std::string& name, const RunOrigin& origin, RunContents contents)
    : contents_(std::move(contents)) {
  open_part(name);
  guarded([&] { create(origin); });
}

RunFile::RunFile(const std::string& name, const std::string& from, const SavedRun& saved, const RunOrigin& origin,
                 RunContents contents)
    : RunFile(name, origin, going_on(std::move(contents), saved)) {
  if (saved.checkpoint) guarded_source(from, [&] { take_over(from, saved); });
}

RunFile::~RunFile() {
  try {
    close();
  } catch (...) {  // said where somebody listens: in finish
  }
  if (path_ != target_) unlink(path_.c_str());  // nobody has asked for it: what was there before stays
}

void RunFile::open_part(const std::string& name) {
  name_ = name;
  std::error_code unknown;
  target_ = link_target(name);
  if (name.empty()) reject_output(name, name, ENOENT);
  if (fs::is_directory(target_, unknown)) reject_output(name, name, EISDIR);
  if (fs::exists(target_, unknown)) {
    if (!fs::is_regular_file(target_, unknown)) reject_output(name, "no regular file; HDF5 files are");
    before_.take(target_, name);
  }
  path_ = target_ + ".part";  // what a run leaves that is killed at once, the next one takes
  const int descriptor = open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) reject_output(name, target_, errno);
  ::close(descriptor);
  lock_.take(path_, name);
  columns_ = columns_in(contents_.quantities);
  hdf5::begin();
}

/// What HDF5 complains of is told with the name of the file.
template <class Action>
void RunFile::guarded(Action action) {
  try {
    action();
  } catch (const hdf5::Error& error) {
    abandon();
    throw OutputError(name_, error.what());
  }
}

void RunFile::create(const RunOrigin& origin) {
  file_ = hdf5::create_file(path_);
  hdf5::write_attribute(file_, "Conventions", "CF-1.11");
  hdf5::write_attribute(file_, "title", origin.title);
  RunOrigin written = origin;
  if (!written.history.empty()) written.history += '\n';
  written.history += history_line(origin.command);
  hdf5::write_attribute(file_, "history", written.history);
  hdf5::write_attribute(file_, "source", "pendula " + origin.version);
  hdf5::write_attribute(file_, "pendula", origin.version);
  hdf5::write_attribute(file_, "instruction_set", origin.instruction_set);
  hdf5::write_attribute(file_, "solver", origin.solver);
  hdf5::write_attribute(file_, "kernel", origin.kernel);
  run_ = hdf5::create_group(file_, "run");
  hdf5::write_attribute(run_, "scenario_file", origin.scenario_name);
  hdf5::write_text(run_, "scenario", origin.scenario);
  hdf5::write_text(run_, "set", nlohmann::json(origin.overrides).dump());
  hdf5::write_text(run_, "model", origin.model);
  hdf5::write_attribute(run_, "checksum", static_cast<std::int64_t>(fingerprint_of(written)));
  if (contents_.quantities.empty()) return;
  // Of an event a name, a count, two times and a warning; of all else far less than the rest.
  constexpr std::size_t room = std::size_t{1} << 16, room_of_event = 1024;
  summary_ = hdf5::create_late_text(run_, "summary", room + room_of_event * contents_.events.size());
  const hdf5::Handle links = create_links(file_, contents_);
  create_rows(links);
  create_constants(links);
  events_.create(file_, contents_, links);
}

void RunFile::create_rows(const hdf5::Handle& links) {
  chunk_rows_ = chunk_rows(columns_);
  for (const Quantity& quantity : contents_.quantities) {
    datasets_.push_back(hdf5::create_rows(file_, quantity.name, quantity.links, chunk_rows_));
    write_unit(datasets_.back(), contents_.natural, quantity.unit);
    hdf5::write_attribute(datasets_.back(), "long_name", quantity.meaning);
    if (datasets_.size() == 1) hdf5::make_scale(datasets_[0], "t");
    if (datasets_.size() > 1) hdf5::attach_scale(datasets_.back(), datasets_[0], 0);
    if (quantity.links > 0) hdf5::attach_scale(datasets_.back(), links, 1);
  }
}

void RunFile::create_constants(const hdf5::Handle& links) const {
  for (const Constant& constant : contents_.constants) {
    const hdf5::Handle array = constant.per_link ? hdf5::create_vector(file_, constant.name, constant.values)
                                                 : hdf5::create_number(file_, constant.name, constant.values.front());
    write_unit(array, contents_.natural, constant.unit);
    hdf5::write_attribute(array, "long_name", constant.meaning);
    if (constant.per_link) hdf5::attach_scale(array, links, 0);
  }
}

// Row by row, so that what is damaged is noticed, and not handed on.
void RunFile::take_over(const std::string& from, const SavedRun& saved) {
  const hdf5::Handle source = hdf5::open_file(from);
  const auto rows = static_cast<std::size_t>(saved.checkpoint->rows);
  for (std::size_t first = 0; first < rows && columns_ > 0; first += chunk_rows_) {
    block_ = read_block(source, contents_.quantities, first, std::min(chunk_rows_, rows - first));
    rows_hash_ = fingerprint_of(block_, rows_hash_);
    write_if_full();
  }
  events_.take_over(source, saved.so_far ? saved.so_far->events : 0);
  waits_ = !block_.empty();
  if (!saved.so_far) return;
  if (as_number(rows_hash_) != saved.so_far->rows_check)
    throw Changed("one whose rows are not those that were written");
  if (events_.check() != saved.so_far->events_check) throw Changed("one whose events are not those that were written");
}

void RunFile::take(const Row& row) {
  block_.insert(block_.end(), row.numbers.begin(), row.numbers.end());
  rows_hash_ = fingerprint_of(row.numbers, rows_hash_);
  if (write_if_full() || is_due()) guarded([&] { flush(); });
}

bool RunFile::write_if_full() {
  if (block_.size() < chunk_rows_ * columns_) return false;
  guarded([&] { write_rows(); });
  return true;
}

void RunFile::happen(const EventRow& happened) {
  events_.add(happened);
}

void RunFile::keep(const Checkpoint& checkpoint) {
  kept_ = checkpoint;
  so_far_ = {events_.count(), as_number(rows_hash_), events_.check()};
  if (checkpoint_.get() < 0) {
    guarded([&] {
      checkpoint_ = hdf5::create_table(run_, "checkpoint", slots, to_row(checkpoint, {}, 0).size());
      hdf5::let_others_read(file_);
      flush();
    });
    put_in_place();
  }
  if (full_ != 0) {
    waits_ = true;
    guarded([&] { flush(); });
    throw OutputError(name_, full_);
  }
  if (is_due()) guarded([&] { flush(); });
}

/// Writes the rows of the block; begins a new one where it is full.
void RunFile::write_rows() {
  const std::size_t count = block_rows();
  if (count == 0) return;
  for (std::size_t k = 0; k < datasets_.size(); ++k) {
    const Quantity& quantity = contents_.quantities[k];
    const std::size_t size = quantity.size();
    numbers_.assign(chunk_rows_ * size, std::numeric_limits<double>::quiet_NaN());
    for (std::size_t row = 0; row < count; ++row) {
      for (std::size_t i = 0; i < size; ++i) numbers_[row * size + i] = block_[row * columns_ + quantity.column(i)];
    }
    hdf5::set_rows(datasets_[k], begun_ + count);
    hdf5::write_chunk(datasets_[k], begun_, numbers_, !unpacked_);
  }
  if (count < chunk_rows_) return;
  begun_ += count;
  block_.clear();
  waits_ = unpacked_ = false;
}

/// Writes what has waited for a second, and the last checkpoint that has all its rows in the file.
void RunFile::flush() {
  if (waits_) {
    unpacked_ = true;
    write_rows();
  }
  waits_ = !block_.empty();
  flush(written());
}

void RunFile::flush(std::size_t rows) {
  events_.write();
  const bool has_its_rows = kept_ && (columns_ == 0 || static_cast<std::size_t>(kept_->rows) <= rows);
  if (has_its_rows && checkpoint_.get() >= 0) {
    ++serial_;
    hdf5::write_rows(checkpoint_, serial_ % slots, to_row(*kept_, so_far_, serial_));
    kept_.reset();
  }
  hdf5::flush(file_, path_);
  in_file_ = rows;
  flushed_ = Clock::now();
  reserve();
}

/// Takes room on the disk for one more block, packed and not, and what leads to it: where there is none, this run can
/// still write its last rows and where to go on from.
void RunFile::reserve() {
  const std::size_t wanted = 2 * sizeof(double) * chunk_rows_ * columns_ + (std::size_t{1} << 18);
  struct stat status {};
  if (fstat(lock_.descriptor(), &status) != 0) return;
  if (fallocate(lock_.descriptor(), FALLOC_FL_KEEP_SIZE, status.st_size, static_cast<off_t>(wanted)) == 0) return;
  if (errno == ENOSPC || errno == EDQUOT) full_ = errno;  // other files cannot be asked
}

void RunFile::put_in_place() {
  if (path_ == target_) return;
  if (std::rename(path_.c_str(), target_.c_str()) != 0) throw OutputError(name_, errno);
  path_ = target_;
}

void RunFile::finish() {
  if (file_.get() < 0) return;
  guarded([&] {
    if (checkpoint_.get() < 0) hdf5::let_others_read(file_);
    write_rest();
  });
  put_in_place();
  finished_ = true;
}

void RunFile::conclude(const std::string& summary) {
  if (file_.get() < 0) return;
  guarded([&] {
    if (summary_.get() >= 0) hdf5::write_late_text(summary_, summary);
    hdf5::flush(file_, path_);
  });
  close();
}

void RunFile::close() {
  if (file_.get() < 0) return;
  if (!finished_) guarded([&] { write_rest(); });
  checkpoint_.close();
  summary_.close();
  events_.close();
  for (hdf5::Handle& dataset : datasets_) dataset.close();
  run_.close();
  const bool closed = file_.close();
  hdf5::mark_as_closed(path_);
  struct stat status {};
  const bool released = fstat(lock_.descriptor(), &status) == 0 && ftruncate(lock_.descriptor(), status.st_size) == 0;
  if (!closed || !released) throw OutputError(name_, "HDF5 could not close it");
}

/// Leaves the file as it was flushed last.
void RunFile::abandon() {
  checkpoint_.abandon();
  summary_.abandon();
  events_.abandon();
  for (hdf5::Handle& dataset : datasets_) dataset.abandon();
  run_.abandon();
  file_.abandon();
}

void RunFile::write_rest() {
  write_rows();
  flush(begun_ + block_rows());
}

}  // namespace pendula::io
