#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/run/checkpoint.hpp>

#include "io/hdf5.hpp"

namespace pendula::io {

/// How many events a run file had at a checkpoint, and checksums of its rows and events.
struct RunSoFar {
  std::size_t events = 0;
  double rows_check = 0, events_check = 0;  ///< checksums
};

/// A checkpoint as it stands in a run file.
struct KeptCheckpoint {
  Checkpoint checkpoint;
  std::optional<RunSoFar> so_far;  ///< older files have none
};

/// The newest intact checkpoint in the group `run` that needs at most `rows` rows; empty if there is none. Throws
/// ChangedFile.
std::optional<KeptCheckpoint> last_checkpoint(const hdf5::Handle& run, double rows);

/// The table of checkpoints in a run file. It has two rows, written in turn, so that one is always intact.
class CheckpointTable {
 public:
  /// Makes the table in the group `run`; all checkpoints have the size of this one.
  void create(const hdf5::Handle& run, const Checkpoint& checkpoint);
  bool is_there() const { return table_.get() >= 0; }
  void write(const Checkpoint& checkpoint, const RunSoFar& so_far);
  void close() { table_.close(); }
  void abandon() { table_.abandon(); }

 private:
  hdf5::Handle table_;
  std::uint64_t serial_ = 0;  // number of the last checkpoint
};

}  // namespace pendula::io
