#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/run/observer.hpp>
#include <string>
#include <vector>

#include "io/files.hpp"
#include "io/hdf5.hpp"
#include "io/provenance.hpp"
#include "io/run_arrays.hpp"
#include "io/saved_run.hpp"
#include "io/trajectory.hpp"

namespace pendula::io {

/// Writes a run file without rows, from which a run can be resumed. Throws InputError if it cannot be opened,
/// OutputError if it cannot be written.
void write_saved_run(const std::string& file, const RunOrigin& origin, const Checkpoint& checkpoint);

/// A run as an HDF5 file: quantities with units, the scenario, and a checkpoint. It can be read at any time; a killed
/// program loses at most the rows of the last two seconds. docs/reference/run-file.md.
class RunFile : public RowsFile {
 public:
  /// Begins a file beside `name`, which replaces `name` once it can be read. Throws InputError if `name` cannot be
  /// written, or another process writes it.
  RunFile(const std::string& name, const RunOrigin& origin, RunContents contents);

  /// The same, beginning with the rows and events of the file `from` up to its checkpoint. Throws InputError, too, if
  /// those do not match their checksums.
  RunFile(const std::string& name, const std::string& from, const SavedRun& saved, const RunOrigin& origin,
          RunContents contents);

  ~RunFile() override;

  /// Throws OutputError if rows cannot be written.
  void take(const Row& row) override;
  void happen(const EventRow& happened) override;
  void keep(const Checkpoint& checkpoint) override;
  bool wants_checkpoint() const override { return full_ != 0; }
  /// Writes all rows; the file stays open for its summary.
  void finish() override;

  /// Writes the summary and closes the file, if it could be finished. Throws OutputError.
  void conclude(const std::string& summary);

  std::int64_t rows() const override { return static_cast<std::int64_t>(in_file_); }

 private:
  using Clock = std::chrono::steady_clock;

  void open_part(const std::string& name);
  void create(const RunOrigin& origin);
  void create_rows(const hdf5::Handle& links);
  void create_constants(const hdf5::Handle& links) const;
  void take_over(const std::string& from, const SavedRun& saved);
  void put_in_place();
  void close();
  bool write_if_full();
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

  std::string name_, target_, path_;  // name in messages; target of links; present path
  RunContents contents_;
  std::size_t columns_ = 0, chunk_rows_ = 0;
  FileLock before_, lock_;  // of the file to be replaced, and of the new one
  hdf5::Handle file_, run_, summary_;
  CheckpointTable checkpoints_;
  std::vector<hdf5::Handle> datasets_;
  EventList events_;
  std::vector<double> block_;    // rows of the present chunk
  std::vector<double> numbers_;  // of one dataset
  std::size_t begun_ = 0;        // row that the block begins with
  std::size_t in_file_ = 0;      // rows that can be read
  bool waits_ = false;           // the block began before the last flush
  bool unpacked_ =
      false;  // the block was written before it was full; it stays uncompressed, since its place cannot be used again
  bool finished_ = false;  // all rows are written
  int full_ = 0;           // errno of a disk that has room only for the last rows and the checkpoint
  std::uint64_t rows_hash_ = empty_fingerprint;
  std::optional<Checkpoint> kept_;  // a checkpoint not yet written
  RunSoFar so_far_;                 // at that checkpoint
  Clock::time_point flushed_ = Clock::now();
};

}  // namespace pendula::io
