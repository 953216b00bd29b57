#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/ensemble_file.hpp"

namespace pendula::io {

/// A part of an ensemble that runs by itself.
struct Shard {
  int number = 1, of = 1;
};

/// Where results of an ensemble go.
struct EnsembleTarget {
  std::string file;  ///< HDF5
  std::optional<Shard> shard;
  bool resumes = false;  ///< continues with the journals beside the file
};

/// The file of an ensemble, and the journals beside it, which other processes may write, too.
class EnsembleOutput {
 public:
  /// Keeps a reference to `head`.
  EnsembleOutput(EnsembleTarget target, const EnsembleHead& head);

  /// The folder of the journals.
  const std::string& folder() const { return folder_; }
  /// Throws InputError if the file could not be written, or is that of the scenario.
  void require_writable(const std::string& scenario) const;
  /// Whether the file has all members already: another shard has just written it, or it was there before.
  bool is_complete() const;
  /// Whether an existing file is replaced by an ensemble that is no shard and does not resume.
  bool replaces() const;

  /// Chunks of this shard that are not done. Throws InputError if there are journals, and the run does not resume them,
  /// or they belong to another ensemble. on_all(b) returns whether b is true in all processes of a job.
  std::vector<std::int64_t> find_missing(const std::function<bool(bool)>& on_all = [](bool mine) { return mine; });
  /// Members that were done before.
  std::int64_t already() const { return already_; }

  /// Writes the file. Returns nullopt if another shard has written the complete file before: shards that end at the
  /// same time write one after the other.
  std::optional<EnsembleTally> write() const;
  void remove_journals() const;

 private:
  EnsembleTarget target_;
  const EnsembleHead& head_;
  std::string folder_;
  std::int64_t already_ = 0;
};

}  // namespace pendula::io
