#include "cli/ranks.hpp"

#include <cstdlib>
#include <initializer_list>
#include <string>

#ifdef PENDULA_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>

#include <mutex>
#else
#include "io/errors.hpp"
#endif

namespace pendula::cli {

#ifdef PENDULA_MPI

/// A counter shared by all ranks, in the memory of rank 0.
struct Ranks::Shared {
  std::int64_t* number = nullptr;
  MPI_Win window = MPI_WIN_NULL;
  std::mutex guard;
};

namespace {

/// Whether an MPI launcher has started this process: that of Open MPI, Slurm, MPICH or its descendants.
bool is_launched() {
  for (const char* const name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

}  // namespace

Ranks::Ranks(bool /*has_shard*/) {
  if (!is_launched()) return;
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  shared_ = std::make_unique<Shared>();
  MPI_Win_allocate(rank_ == 0 ? sizeof(std::int64_t) : 0, sizeof(std::int64_t), MPI_INFO_NULL, MPI_COMM_WORLD,
                   static_cast<void*>(&shared_->number), &shared_->window);
  MPI_Win_lock_all(0, shared_->window);
  if (rank_ == 0) *shared_->number = 0;
  MPI_Win_sync(shared_->window);
  MPI_Barrier(MPI_COMM_WORLD);
}

Ranks::~Ranks() {
  if (!shared_) return;
  MPI_Win_unlock_all(shared_->window);
  MPI_Win_free(&shared_->window);
  MPI_Finalize();
}

std::int64_t Ranks::claim() {
  if (!shared_) return next_.fetch_add(1);
  const std::scoped_lock lock(shared_->guard);
  const std::int64_t one = 1;
  std::int64_t mine = 0;
  MPI_Fetch_and_op(&one, &mine, MPI_INT64_T, 0, 0, MPI_SUM, shared_->window);
  MPI_Win_flush(0, shared_->window);
  return mine;
}

void Ranks::abort(int status) {
  if (shared_) MPI_Abort(MPI_COMM_WORLD, status);
  std::_Exit(status);
}

bool Ranks::all(bool mine) {
  if (!shared_) return mine;
  const int here = mine ? 1 : 0;
  int everywhere = 0;
  MPI_Allreduce(&here, &everywhere, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
  return everywhere != 0;
}

#else

struct Ranks::Shared {};

namespace {

/// The first of some environment variables that is a number of at least `least`; empty if there is none.
std::string variable_of_at_least(int least, std::initializer_list<const char*> names) {
  for (const char* const name : names) {
    const char* const value = std::getenv(name);
    if (value != nullptr && std::atoi(value) >= least) return std::string(name) + '=' + value;
  }
  return {};
}

/// The variable that shows that this process is one of several. Slurm's number of tasks counts only under srun.
std::string sign_of_others() {
  std::string size =
      variable_of_at_least(2, {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"});
  if (!size.empty()) return size;
  return variable_of_at_least(1, {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"});
}

}  // namespace

Ranks::Ranks(bool has_shard) {
  const std::string sign = has_shard ? "" : sign_of_others();
  if (sign.empty()) return;
  throw io::InputError(
      "ensemble: expected one process, since this build of pendula does not know MPI, got one of several (" + sign +
      "); install MPI (Debian: libopenmpi-dev) and build again with -DPENDULA_MPI=ON, or give "
      "each process a part of its own by --shard I/N");
}

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
