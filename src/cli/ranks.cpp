#include "cli/ranks.hpp"

#include <cstdlib>
#include <memory>

#ifdef PENDULA_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace pendula::cli {

#ifdef PENDULA_MPI

namespace {

/// A number that all ranks add to.
struct Counter {
  std::int64_t* number = nullptr;
  MPI_Win window = MPI_WIN_NULL;
};

/// Whether a launcher of MPI has started this process: Open MPI, Slurm's, MPICH and those that come from it.
bool is_launched() {
  for (const char* const name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

}  // namespace

Ranks::Ranks() {
  if (!is_launched()) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  auto counter = std::make_unique<Counter>();
  MPI_Win_allocate(rank_ == 0 ? sizeof(std::int64_t) : 0, sizeof(std::int64_t), MPI_INFO_NULL, MPI_COMM_WORLD,
                   static_cast<void*>(&counter->number), &counter->window);
  MPI_Win_lock_all(0, counter->window);
  if (rank_ == 0) *counter->number = 0;
  MPI_Win_sync(counter->window);
  MPI_Barrier(MPI_COMM_WORLD);
  shared_ = counter.release();
}

Ranks::~Ranks() {
  if (shared_ == nullptr) return;
  const std::unique_ptr<Counter> counter(static_cast<Counter*>(shared_));
  MPI_Win_unlock_all(counter->window);
  MPI_Win_free(&counter->window);
  MPI_Finalize();
}

std::int64_t Ranks::claim() {
  if (shared_ == nullptr) return next_.fetch_add(1);
  const std::scoped_lock lock(guard_);
  const Counter& counter = *static_cast<const Counter*>(shared_);
  const std::int64_t one = 1;
  std::int64_t mine = 0;
  MPI_Fetch_and_op(&one, &mine, MPI_INT64_T, 0, 0, MPI_SUM, counter.window);
  MPI_Win_flush(0, counter.window);
  return mine;
}

void Ranks::abort(int status) {
  if (shared_ != nullptr) MPI_Abort(MPI_COMM_WORLD, status);
  std::_Exit(status);
}

bool Ranks::all(bool mine) {
  if (shared_ == nullptr) return mine;
  const int here = mine ? 1 : 0;
  int everywhere = 0;
  MPI_Allreduce(&here, &everywhere, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
  return everywhere != 0;
}

#else

Ranks::Ranks() = default;
Ranks::~Ranks() = default;

std::int64_t Ranks::claim() {
  return next_.fetch_add(1);
}

void Ranks::abort(int status) {
  std::_Exit(status);
}

bool Ranks::all(bool mine) {
  return mine;
}

#endif

}  // namespace pendula::cli
