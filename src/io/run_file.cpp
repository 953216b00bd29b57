#include "io/run_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "io/errors.hpp"
#include "io/files.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

/// What the file of a resumed run contains. If the file that it goes on from has no table of events, the new one gets
/// none.
RunContents going_on(RunContents contents, const SavedRun& saved) {
  if (saved.checkpoint && !saved.has_events) contents.events.clear();
  return contents;
}

/// Rows in a chunk. They depend on the number of columns only; few columns make chunks of about 32 kB.
std::size_t chunk_rows(std::size_t columns) {
  constexpr std::size_t block = std::size_t{1} << 17;
  return std::clamp<std::size_t>(block / std::max<std::size_t>(columns, 1), 4, 4096);
}

}  // namespace

void write_saved_run(const std::string& file, const RunOrigin& origin, const Checkpoint& checkpoint) {
  RunFile written(file, origin, {});
  written.keep(checkpoint);
  written.finish();
  written.conclude("");
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
  } catch (...) {  // finish() reports it
  }
  if (path_ != target_) unlink(path_.c_str());  // not finished: the file that it was to replace stays
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
  path_ = target_ + ".part";  // the next run reuses what a killed run leaves
  const int descriptor = open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) reject_output(name, target_, errno);
  ::close(descriptor);
  lock_.take(path_, name);
  columns_ = columns_in(contents_.quantities);
  hdf5::begin();
}

/// Adds the name of the file to errors of HDF5.
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
  run_ = write_origin(file_, origin);
  if (!contents_.drawing.empty()) hdf5::write_text(run_, "drawing", contents_.drawing);
  if (contents_.quantities.empty()) return;
  // Each event needs a name, a count, two times and a warning; `room` is ample for the rest.
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

// Copies row by row, so that damage is noticed.
void RunFile::take_over(const std::string& from, const SavedRun& saved) {
  const hdf5::Handle source = hdf5::open_file(from);
  const auto rows = static_cast<std::size_t>(saved.checkpoint->rows);
  for (std::size_t first = 0; first < rows && columns_ > 0; first += chunk_rows_) {
    block_ = read_block(source, contents_.quantities, first, std::min(chunk_rows_, rows - first));
    rows_hash_ = fingerprint(block_, rows_hash_);
    write_if_full();
  }
  events_.take_over(source, saved.so_far ? saved.so_far->events : 0);
  waits_ = !block_.empty();
  if (!saved.so_far) return;
  if (as_number(rows_hash_) != saved.so_far->rows_check)
    throw ChangedFile("one whose rows are not those that were written");
  if (events_.check() != saved.so_far->events_check)
    throw ChangedFile("one whose events are not those that were written");
}

void RunFile::take(const Row& row) {
  block_.insert(block_.end(), row.numbers.begin(), row.numbers.end());
  rows_hash_ = fingerprint(row.numbers, rows_hash_);
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
  if (!checkpoints_.is_there()) {
    guarded([&] {
      checkpoints_.create(run_, checkpoint);
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

/// Writes the rows of the block; begins a new block if that is full.
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

/// Writes a block that has waited for a second, and the last checkpoint if all its rows are in the file.
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
  if (has_its_rows && checkpoints_.is_there()) {
    checkpoints_.write(*kept_, so_far_);
    kept_.reset();
  }
  hdf5::flush(file_, path_);
  in_file_ = rows;
  flushed_ = Clock::now();
  reserve();
}

/// Reserves disk space for one more block, compressed and not, with its index. If there is none, this run can still
/// write its last rows and a checkpoint.
void RunFile::reserve() {
  const std::size_t wanted = 2 * sizeof(double) * chunk_rows_ * columns_ + (std::size_t{1} << 18);
  struct stat status {};
  if (fstat(lock_.descriptor(), &status) != 0) return;
  if (fallocate(lock_.descriptor(), FALLOC_FL_KEEP_SIZE, status.st_size, static_cast<off_t>(wanted)) == 0) return;
  if (errno == ENOSPC || errno == EDQUOT) full_ = errno;  // other errors: the file system cannot reserve space
}

void RunFile::put_in_place() {
  if (path_ == target_) return;
  if (std::rename(path_.c_str(), target_.c_str()) != 0) throw OutputError(name_, errno);
  path_ = target_;
}

void RunFile::finish() {
  if (file_.get() < 0) return;
  guarded([&] {
    if (!checkpoints_.is_there()) hdf5::let_others_read(file_);
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
  checkpoints_.close();
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

/// Gives the file up: it stays as it was at the last flush.
void RunFile::abandon() {
  checkpoints_.abandon();
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
