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
#include <stdexcept>
#include <system_error>
#include <utility>

#include "io/fingerprint.hpp"
#include "io/input_error.hpp"
#include "io/link_target.hpp"
#include "io/output_error.hpp"
#include "io/process.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

// Of a row of the table of checkpoints; after them the numbers of the two members.
enum Place : std::size_t {
  check,
  serial,
  at_time,
  kept_rows,
  rows_check,
  since_row,
  integrator_size,
  record_size,
  numbers
};

/// Slots for checkpoints: what is being written is never the last that is whole.
constexpr std::size_t slots = 2;

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
  std::vector<std::string> texts = {origin.scenario_name, origin.scenario, origin.model};
  texts.insert(texts.end(), origin.overrides.begin(), origin.overrides.end());
  std::uint64_t hash = empty_fingerprint;
  for (const std::string& text : texts) hash = fingerprint(text, fingerprint(std::to_string(text.size()) + ':', hash));
  return hash;
}

std::vector<double> to_row(const Checkpoint& checkpoint, std::uint64_t rows, std::uint64_t count) {
  std::vector<double> row(numbers);
  row[serial] = static_cast<double>(count);
  row[at_time] = checkpoint.time;
  row[kept_rows] = static_cast<double>(checkpoint.rows);
  row[rows_check] = as_number(rows);
  row[since_row] = static_cast<double>(checkpoint.since_row);
  row[integrator_size] = static_cast<double>(checkpoint.integrator.numbers.size());
  row[record_size] = static_cast<double>(checkpoint.record.numbers.size());
  for (const Member* member : {&checkpoint.integrator, &checkpoint.record}) {
    row.insert(row.end(), member->numbers.begin(), member->numbers.end());
  }
  row[check] = checksum(row);
  return row;
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

/// What a run file says that it was not written with.
class Changed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

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
  origin.scenario_name = hdf5::read_attribute(run, "scenario_file");
  origin.scenario = hdf5::read_text(run, "scenario");
  origin.overrides = nlohmann::json::parse(hdf5::read_text(run, "set")).get<std::vector<std::string>>();
  origin.model = hdf5::read_text(run, "model");
  if (static_cast<std::uint64_t>(hdf5::read_number(run, "checksum")) != fingerprint_of(origin)) {
    throw Changed("one whose scenario, settings or model are not what it was written with");
  }
  return origin;
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
      saved.rows_check = (*last)[rows_check];
    }
    return saved;
  });
}

void write_saved_run(const std::string& file, const RunOrigin& origin, const Checkpoint& checkpoint) {
  RunFile written(file, origin, {});
  written.keep(checkpoint);
  written.finish();
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

RunFile::RunFile(const std::string& name, const RunOrigin& origin, std::vector<Quantity> quantities)
    : quantities_(std::move(quantities)) {
  open_part(name);
  guarded([&] { create(origin); });
}

RunFile::RunFile(const std::string& name, const std::string& from, const SavedRun& saved, const RunOrigin& origin,
                 std::vector<Quantity> quantities)
    : RunFile(name, origin, std::move(quantities)) {
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
  for (const Quantity& quantity : quantities_) columns_ += quantity.size();
  chunk_rows_ = chunk_rows(columns_);
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
  hdf5::write_attribute(file_, "pendula", origin.version);
  hdf5::write_attribute(file_, "instruction_set", origin.instruction_set);
  hdf5::write_attribute(file_, "solver", origin.solver);
  hdf5::write_attribute(file_, "kernel", origin.kernel);
  run_ = hdf5::create_group(file_, "run");
  hdf5::write_attribute(run_, "scenario_file", origin.scenario_name);
  hdf5::write_text(run_, "scenario", origin.scenario);
  hdf5::write_text(run_, "set", nlohmann::json(origin.overrides).dump());
  hdf5::write_text(run_, "model", origin.model);
  hdf5::write_attribute(run_, "checksum", static_cast<std::int64_t>(fingerprint_of(origin)));
  hdf5::Handle links;
  for (const Quantity& quantity : quantities_) {
    datasets_.push_back(hdf5::create_rows(file_, quantity.name, quantity.links, chunk_rows_));
    hdf5::write_attribute(datasets_.back(), "units", quantity.unit);
    if (quantity.links > 0 && links.get() < 0) {
      links = hdf5::create_numbering(file_, "link", quantity.links);
      hdf5::make_scale(links, "link");
    }
  }
  if (quantities_.empty()) return;
  hdf5::make_scale(datasets_[0], "t");
  for (std::size_t k = 1; k < datasets_.size(); ++k) {
    hdf5::attach_scale(datasets_[k], datasets_[0], 0);
    if (quantities_[k].links > 0) hdf5::attach_scale(datasets_[k], links, 1);
  }
}

// Row by row, so that what is damaged is noticed, and not handed on.
void RunFile::take_over(const std::string& from, const SavedRun& saved) {
  const hdf5::Handle source = hdf5::open_file(from);
  std::vector<hdf5::Handle> datasets;
  for (const Quantity& quantity : quantities_) datasets.push_back(hdf5::open_dataset(source, quantity.name));
  const auto rows = static_cast<std::size_t>(saved.checkpoint->rows);
  for (std::size_t first = 0; first < rows; first += chunk_rows_) {
    const std::size_t count = std::min(chunk_rows_, rows - first);
    block_.resize(count * columns_);
    for (std::size_t k = 0; k < datasets.size(); ++k) {
      const std::vector<double> read = hdf5::read_rows(datasets[k], first, count);
      const std::size_t size = quantities_[k].size();
      for (std::size_t i = 0; i < read.size(); ++i) {
        block_[i / size * columns_ + quantities_[k].column(i % size)] = read[i];
      }
    }
    rows_hash_ = fingerprint_of(block_, rows_hash_);
    write_if_full();
  }
  if (as_number(rows_hash_) != saved.rows_check) throw Changed("one whose rows are not those that were written");
  waits_ = !block_.empty();
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

void RunFile::keep(const Checkpoint& checkpoint) {
  kept_ = checkpoint;
  kept_hash_ = rows_hash_;
  if (checkpoint_.get() < 0) {
    guarded([&] {
      checkpoint_ = hdf5::create_table(run_, "checkpoint", slots, to_row(checkpoint, 0, 0).size());
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
    const Quantity& quantity = quantities_[k];
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
  const bool has_its_rows = kept_ && (columns_ == 0 || static_cast<std::size_t>(kept_->rows) <= rows);
  if (has_its_rows && checkpoint_.get() >= 0) {
    ++serial_;
    hdf5::write_row(checkpoint_, serial_ % slots, to_row(*kept_, kept_hash_, serial_));
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
  close();
  put_in_place();
}

void RunFile::close() {
  if (file_.get() < 0) return;
  guarded([&] { write_rest(); });
  checkpoint_.close();
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
  for (hdf5::Handle& dataset : datasets_) dataset.abandon();
  run_.abandon();
  file_.abandon();
}

void RunFile::write_rest() {
  write_rows();
  flush(begun_ + block_rows());
}

}  // namespace pendula::io
