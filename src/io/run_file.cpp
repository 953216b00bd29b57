#include "io/run_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "io/input_error.hpp"
#include "io/link_target.hpp"
#include "io/output_error.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

// Of a row of the table of checkpoints; after them the numbers of the two members, and the count of events.
enum Place : std::size_t { check, serial, at_time, kept_rows, since_row, integrator_size, record_size, numbers };

/// Slots for checkpoints: what is being written is never the last that is whole.
constexpr std::size_t slots = 2;

/// A number that tells whether all others came through.
double checksum(std::span<const double> row) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const double number : row.subspan(check + 1)) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(number)) * 0x100000001b3U;
    hash ^= hash >> 32;
  }
  return static_cast<double>(hash >> 12);
}

/// `size` is that of the table's rows, if there is one: tables of old have no count of events.
std::vector<double> to_row(const Checkpoint& checkpoint, std::size_t events, std::uint64_t count,
                           std::optional<std::size_t> size = std::nullopt) {
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
  row.push_back(static_cast<double>(events));
  if (size) row.resize(*size);
  row[check] = checksum(row);
  return row;
}

/// Events of the run until then.
std::size_t events_in(std::span<const double> row) {
  const auto size = static_cast<std::size_t>(row[integrator_size] + row[record_size]) + numbers;
  return size < row.size() ? static_cast<std::size_t>(row[size]) : 0;
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
std::optional<std::vector<double>> last_checkpoint(const hdf5::Handle& file, const hdf5::Handle& run) {
  if (!hdf5::has(run, "checkpoint")) return std::nullopt;
  double rows = std::numeric_limits<double>::infinity();
  if (hdf5::has(file, "t")) rows = static_cast<double>(hdf5::extent(hdf5::open_dataset(file, "t"))[0]);
  const hdf5::Handle table = hdf5::open_dataset(run, "checkpoint");
  std::optional<std::vector<double>> last;
  for (std::size_t slot = 0; slot < slots; ++slot) {
    std::vector<double> row = hdf5::read_rows(table, slot, 1);
    if (!is_whole(row) || row[kept_rows] > rows) continue;
    if (!last || row[serial] > (*last)[serial]) last = std::move(row);
  }
  return last;
}

RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run) {
  RunOrigin origin;
  origin.version = hdf5::read_attribute(file, "pendula");
  origin.instruction_set = hdf5::read_attribute(file, "instruction_set");
  origin.solver = hdf5::read_attribute(file, "solver");
  origin.kernel = hdf5::read_attribute(file, "kernel");
  origin.scenario_name = hdf5::read_attribute(run, "scenario_file");
  origin.scenario = hdf5::read_text(run, "scenario");
  origin.overrides = nlohmann::json::parse(hdf5::read_text(run, "set")).get<std::vector<std::string>>();
  origin.model = hdf5::read_text(run, "model");
  return origin;
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

/// Of numbers that all runs of this kind have; a chunk of a quantity has about 32 kB where there are few.
std::size_t chunk_rows(std::size_t columns) {
  constexpr std::size_t block = std::size_t{1} << 17;
  return std::clamp<std::size_t>(block / std::max<std::size_t>(columns, 1), 4, 4096);
}

}  // namespace

SavedRun read_saved_run(const std::string& file) {
  const auto reject = [&](const std::string& what) {
    throw InputError(file + ": expected a run file to go on from, got " + what);
  };
  std::error_code unknown;
  if (!fs::exists(file, unknown)) reject("a file that is not there");
  hdf5::begin();
  try {
    const hdf5::Handle opened = hdf5::open_file(file, false);
    if (!hdf5::has(opened, "run")) reject("a file without the group \"run\"");
    const hdf5::Handle run = hdf5::open_group(opened, "run");
    SavedRun saved;
    saved.origin = read_origin(opened, run);
    saved.has_rows = hdf5::has(opened, "t");
    if (const auto last = last_checkpoint(opened, run)) saved.checkpoint = from_row(*last);
    return saved;
  } catch (const hdf5::Error& error) {
    reject(std::string("one that HDF5 cannot read: ") + error.what());
  } catch (const nlohmann::json::exception& error) {
    reject(error.what());
  }
  return {};
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
  add("event_number", 0, Type::whole, "number of the event, in order of time");
  add("event_name", 0, Type::whole, "which event it is");
  hdf5::write_flags(datasets_.back(), Type::whole, 1, contents.events);
  add("event_direction", 0, Type::byte, "whether its expression went up or down through zero");
  hdf5::write_flags(datasets_.back(), Type::byte, 0, std::vector<std::string>{"down", "up"});
  for (const Quantity& quantity : quantities_) {
    add(quantity.name, quantity.links, Type::real, quantity.meaning);
    write_unit(datasets_.back(), contents.natural, quantity.unit);
  }
  names_ = contents.events;
}

void EventList::reopen(const hdf5::Handle& file, const RunContents& contents, std::size_t kept) {
  if (!hdf5::has(file, "events") || contents.events.empty()) return;
  const hdf5::Handle group = hdf5::open_group(file, "events");
  for (const char* name : {"event_number", "event_name", "event_direction"})
    datasets_.push_back(hdf5::open_dataset(group, name));
  for (const Quantity& quantity : contents.quantities) {
    datasets_.push_back(hdf5::open_dataset(group, name_in(group, quantity)));
  }
  quantities_ = contents.quantities;
  names_ = contents.events;
  written_ = kept;
  for (const hdf5::Handle& dataset : datasets_) hdf5::set_rows(dataset, written_);
}

void EventList::add(const EventRow& happened) {
  if (!is_there()) return;
  const auto which = std::ranges::find(names_, happened.event.name) - names_.begin();
  std::vector<double> row{static_cast<double>(count() + 1), static_cast<double>(which + 1), happened.up ? 1.0 : 0.0};
  row.insert(row.end(), happened.row.numbers.begin(), happened.row.numbers.end());
  pending_.push_back(std::move(row));
}

void EventList::append(std::size_t dataset, const std::vector<double>& numbers) {
  hdf5::set_rows(datasets_[dataset], count());
  hdf5::write_rows(datasets_[dataset], written_, numbers);
}

void EventList::write() {
  if (pending_.empty()) return;
  constexpr std::size_t before = 3;  // numbers before those of the row
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

RunFile::RunFile(const std::string& name, const std::string& from, const RunOrigin& origin, RunContents contents)
    : contents_(std::move(contents)) {
  open_part(name);
  std::error_code error;
  fs::copy_file(from, path_, fs::copy_options::overwrite_existing, error);
  if (error) throw OutputError(name_, error.value());
  hdf5::mark_as_closed(path_);
  guarded([&] { reopen(origin); });
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
  hdf5::write_attribute(file_, "history", history_line(origin.command));
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

// A file keeps the names that it began with, and what it has of a row.
void RunFile::reopen(const RunOrigin& origin) {
  file_ = hdf5::open_file(path_, true);
  run_ = hdf5::open_group(file_, "run");
  if (hdf5::has_attribute(file_, "history")) {
    const std::string before = hdf5::read_attribute(file_, "history");
    hdf5::write_attribute(file_, "history", before + "\n" + history_line(origin.command));
  }
  if (hdf5::has(run_, "summary")) {
    summary_ = hdf5::open_dataset(run_, "summary");
    hdf5::set_rows(summary_, 0);
  }
  const auto last = last_checkpoint(file_, run_);
  if (last) serial_ = static_cast<std::uint64_t>((*last)[serial]);
  if (last) in_file_ = static_cast<std::size_t>((*last)[kept_rows]);
  std::erase_if(contents_.quantities, [&](const Quantity& quantity) { return name_in(file_, quantity).empty(); });
  if (contents_.quantities.empty()) return;
  for (const Quantity& quantity : contents_.quantities) {
    datasets_.push_back(hdf5::open_dataset(file_, name_in(file_, quantity)));
  }
  events_.reopen(file_, contents_, last ? events_in(*last) : 0);
  chunk_rows_ = chunk_rows(columns_in(contents_.quantities));
  read_begun_block();
}

/// Rows of a chunk that is not full are taken back into the block.
void RunFile::read_begun_block() {
  begun_ = in_file_ - in_file_ % chunk_rows_;
  const std::size_t pending = in_file_ - begun_;
  block_.resize(pending * columns_);
  for (std::size_t k = 0; k < datasets_.size(); ++k) {
    hdf5::set_rows(datasets_[k], in_file_);
    if (pending == 0) continue;
    const std::vector<double> read = hdf5::read_rows(datasets_[k], begun_, pending);
    const Quantity& quantity = contents_.quantities[k];
    for (std::size_t i = 0; i < read.size(); ++i) {
      block_[i / quantity.size() * columns_ + quantity.column(i % quantity.size())] = read[i];
    }
  }
}

void RunFile::take(const Row& row) {
  block_.insert(block_.end(), row.numbers.begin(), row.numbers.end());
  const bool full = block_.size() == chunk_rows_ * columns_;
  if (full) guarded([&] { write_rows(); });
  if (full || is_due()) guarded([&] { flush(); });
}

void RunFile::happen(const EventRow& happened) {
  events_.add(happened);
}

void RunFile::keep(const Checkpoint& checkpoint) {
  kept_ = checkpoint;
  kept_events_ = events_.count();
  if (checkpoint_.get() < 0) {
    guarded([&] {
      checkpoint_ = hdf5::has(run_, "checkpoint")
                        ? hdf5::open_dataset(run_, "checkpoint")
                        : hdf5::create_table(run_, "checkpoint", slots, to_row(checkpoint, 0, 0).size());
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
    hdf5::write_rows(checkpoint_, serial_ % slots, to_row(*kept_, kept_events_, serial_, hdf5::extent(checkpoint_)[1]));
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
