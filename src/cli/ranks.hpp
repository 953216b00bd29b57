#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

namespace pendula::cli {

/// The processes of a job: those of mpirun, if this build has MPI, else this one only.
class Ranks {
 public:
  /// Throws io::InputError if a launcher has started several processes, this build has no MPI, and there are no shards:
  /// each process would run the whole job.
  explicit Ranks(bool has_shard);
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// Returns 0, 1, 2, …, each once over all threads of all ranks.
  std::int64_t claim();

  /// Ends the job on all ranks, which may be waiting for this one.
  [[noreturn]] void abort(int status);

  /// Waits for all ranks. Returns whether `mine` is true on all.
  bool all(bool mine);

 private:
  struct Shared;

  int rank_ = 0, size_ = 1;
  std::atomic<std::int64_t> next_ = 0;  // for one process
  std::unique_ptr<Shared> shared_;      // for several ranks
};

}  // namespace pendula::cli
