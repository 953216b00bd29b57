#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

namespace pendula::cli {

/// The processes that share one job: those that mpirun has started, where this build knows MPI, or this one alone.
class Ranks {
 public:
  /// Throws io::InputError where a launcher has started several processes and this build does not know MPI: each would
  /// think itself alone. That is right for those that have a shard of their own.
  explicit Ranks(bool has_shard);
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// 0, 1, 2, …, each handed out once, to whichever thread of whichever rank asks first.
  std::int64_t claim();

  /// Ends the job, the other ranks too, which may wait for this one.
  [[noreturn]] void abort(int status);

  /// Waits for all ranks; gives whether `mine` holds on every one.
  bool all(bool mine);

 private:
  struct Shared;

  int rank_ = 0, size_ = 1;
  std::atomic<std::int64_t> next_ = 0;  // of one process
  std::unique_ptr<Shared> shared_;      // of several
};

}  // namespace pendula::cli
