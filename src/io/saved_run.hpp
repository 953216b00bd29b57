#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <pendula/run/observer.hpp>
#include <string>
#include <vector>

#include "io/hdf5.hpp"

namespace pendula::io {

/// The origin of the numbers of a run file: program, command, scenario, model.
struct RunOrigin {
  std::string version;                 ///< of pendula
  std::string instruction_set;         ///< of the library that ran it
  std::string solver, kernel;          ///< as in a summary; may be empty
  std::string title;                   ///< one line
  std::string command;                 ///< the present command
  std::string history;                 ///< earlier commands, a line each
  std::string scenario_name;           ///< public name of its file
  std::string scenario;                ///< its text
  std::vector<std::string> overrides;  ///< `key.path=value`
  std::string model;                   ///< text of the model's file; empty where there is none
};

/// Writes an origin into a new file. Returns the group `run`.
hdf5::Handle write_origin(const hdf5::Handle& file, const RunOrigin& origin);

/// Reads the origin from a file and its group `run`. Throws ChangedFile, hdf5::Error, nlohmann::json::exception.
RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run);

/// Throws ChangedFile unless the origin matches its checksum.
void require_written(const RunOrigin& origin, const hdf5::Handle& run);

/// How many events a run file had at a checkpoint, and checksums of its rows and events.
struct RunSoFar {
  std::size_t events = 0;
  double rows_check = 0, events_check = 0;  ///< checksums
};

/// A checkpoint as a run file has it.
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

/// A run to resume, as read from its file.
struct SavedRun {
  RunOrigin origin;                      ///< `history` is that of the file
  std::optional<Checkpoint> checkpoint;  ///< empty if the run had just begun
  std::optional<RunSoFar> so_far;        ///< empty, too, in older files
  /// Time of the last row  [s]; −∞ where there is none.
  double end = -std::numeric_limits<double>::infinity();
  bool has_rows = true;  ///< whether the file keeps the trajectory, too
  bool has_events = true;
};

/// Reads all that is needed to resume a run. Throws InputError if the file is no run file, or is damaged.
SavedRun read_saved_run(const std::string& file);

/// Calls act(), which reads the run file `file`; errors of reading become InputError.
void guarded_source(const std::string& file, const std::function<void()>& act);

}  // namespace pendula::io
