#pragma once

#include <functional>
#include <optional>
#include <pendula/run/checkpoint.hpp>
#include <string>

#include "io/checkpoint_table.hpp"
#include "io/run_origin.hpp"

namespace pendula::io {

/// A run to resume, as read from its file.
struct SavedRun {
  RunOrigin origin;                      ///< `history` is that of the file
  std::optional<Checkpoint> checkpoint;  ///< empty if the run had just begun
  std::optional<RunSoFar> so_far;        ///< empty, too, in older files
  bool has_rows = true;                  ///< whether the file keeps the trajectory, too
  bool has_events = true;
};

/// Reads all that a run needs to go on. Throws InputError if the file is no run file, or is damaged.
SavedRun read_saved_run(const std::string& file);

/// Calls act(), which reads the run file `file`; errors of reading become InputError.
void guarded_source(const std::string& file, const std::function<void()>& act);

}  // namespace pendula::io
