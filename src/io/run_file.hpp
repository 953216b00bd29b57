#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/run/checkpoint.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/quantity.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/hdf5.hpp"
#include "io/natural_units.hpp"
#include "io/rows_file.hpp"

namespace pendula::io {

/// What a run file says of the run besides its numbers.
struct RunOrigin {
  std::string version;                 ///< of pendula
  std::string instruction_set;         ///< of the library that ran it
  std::string solver, kernel;          ///< as in a summary; may be empty
  std::string title;                   ///< one line
  std::string command;                 ///< that began it, or goes on with it
  std::string scenario_name;           ///< its file, by its public name
  std::string scenario;                ///< its text
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string model;                   ///< text of the model's file; empty where there is none
};

/// The numbers of a run file, in SI but for those of natural units.
struct RunContents {
  std::vector<Quantity> quantities;  ///< of each row
  std::vector<Constant> constants;
  std::vector<std::string> events;  ///< names of those that are looked for
  std::optional<NaturalUnits> natural;
};

/// Writes the unit of an array: one that udunits knows, and beside it that of natural numbers.
void write_unit(const hdf5::Handle& array, const std::optional<NaturalUnits>& natural, const std::string& unit);

/// What a run goes on from.
struct SavedRun {
  RunOrigin origin;
  std::optional<Checkpoint> checkpoint;  ///< none where it had just begun
  bool has_rows = true;                  ///< whether the file keeps the trajectory, too
};

/// Reads all that a run needs to go on. Throws InputError where the file has none.
SavedRun read_saved_run(const std::string& file);

/// Writes a file that has only what a run needs to go on. Throws InputError where it cannot be opened, OutputError.
void write_saved_run(const std::string& file, const RunOrigin& origin, const Checkpoint& checkpoint);

/// The events of a run in its run file: the group `events`, a row each. It is written in place, as it comes.
class EventList {
 public:
  /// Where a file has none, nothing is written.
  void create(const hdf5::Handle& file, const RunContents& contents, const hdf5::Handle& links);
  void reopen(const hdf5::Handle& file, const RunContents& contents, std::size_t kept);

  void add(const EventRow& happened);
  bool is_there() const { return !datasets_.empty(); }
  std::size_t count() const { return written_ + pending_.size(); }
  void write();
  void close();
  void abandon();

 private:
  void append(std::size_t dataset, const std::vector<double>& numbers);

  std::vector<Quantity> quantities_;
  std::vector<std::string> names_;
  std::vector<hdf5::Handle> datasets_;  // number, event, direction, quantities
  std::vector<std::vector<double>> pending_;
  std::size_t written_ = 0;
};

/// A run as an HDF5 file: quantities with units, the scenario, and where to go on from. It can be read at any time, and
/// whatever ends the program leaves rows but those of the last two seconds. docs/run-file.md.
class RunFile : public RowsFile {
 public:
  /// Begins a file beside `name`, which takes its place when it can be read. Throws InputError where that cannot be
  /// written or is just being written by somebody else.
  RunFile(const std::string& name, const RunOrigin& origin, RunContents contents);

  /// Goes on with a copy of the file `from`, after what it had at the checkpoint.
  RunFile(const std::string& name, const std::string& from, const RunOrigin& origin, RunContents contents);

  ~RunFile() override;

  /// Throws OutputError where rows cannot be written.
  void take(const Row& row) override;
  void happen(const EventRow& happened) override;
  void keep(const Checkpoint& checkpoint) override;
  bool wants_checkpoint() const override { return full_ != 0; }
  /// Writes all that there is; the file stays open for its summary.
  void finish() override;

  /// Writes the summary and closes the file; nothing where it could not be finished. Throws OutputError.
  void conclude(const std::string& summary);

  std::int64_t rows() const override { return static_cast<std::int64_t>(in_file_); }

 private:
  using Clock = std::chrono::steady_clock;

  /// A file descriptor that holds a lock while it is there.
  class Lock {
   public:
    ~Lock();
    void take(const std::string& file, const std::string& name);
    int descriptor() const { return descriptor_; }

   private:
    int descriptor_ = -1;
  };

  void open_part(const std::string& name);
  void create(const RunOrigin& origin);
  void create_rows(const hdf5::Handle& links);
  void create_constants(const hdf5::Handle& links) const;
  void reopen(const RunOrigin& origin);
  void read_begun_block();
  void put_in_place();
  void close();
  void write_rows();
  void write_rest();
  void reserve();
  void abandon();
  void flush();
  void flush(std::size_t rows);
  bool is_due() const { return Clock::now() - flushed_ >= std::chrono::seconds(1); }
  std::size_t block_rows() const { return columns_ > 0 ? block_.size() / columns_ : 0; }
  std::size_t written() const { return begun_ + (unpacked_ ? block_rows() : 0); }
  template <class Action>
  void guarded(Action action);

  std::string name_, target_, path_;  // as messages call it; what it leads to; where it is now
  RunContents contents_;
  std::size_t columns_ = 0, chunk_rows_ = 0;
  Lock before_, lock_;  // of a file that is to be replaced, and of this one
  hdf5::Handle file_, run_, checkpoint_, summary_;
  std::vector<hdf5::Handle> datasets_;
  EventList events_;
  std::vector<double> block_;    // rows of the chunk that is being filled
  std::vector<double> numbers_;  // of one dataset
  std::size_t begun_ = 0;        // row that the block begins with
  std::size_t in_file_ = 0;      // rows that can be read
  bool waits_ = false;           // the block began before the last flush
  bool unpacked_ = false;        // it was written before it was full, and so stays: its place could not be used again
  bool finished_ = false;        // all rows are written
  int full_ = 0;                 // errno: the disk has room only for what is to be written last
  std::optional<Checkpoint> kept_;  // and not yet written
  std::size_t kept_events_ = 0;     // that there were then
  std::uint64_t serial_ = 0;        // of checkpoints
  Clock::time_point flushed_ = Clock::now();
};

}  // namespace pendula::io
