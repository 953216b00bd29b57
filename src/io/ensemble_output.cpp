#include "io/ensemble_output.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/journal.hpp"

namespace pendula::io {

namespace fs = std::filesystem;

EnsembleOutput::EnsembleOutput(EnsembleTarget target, const EnsembleHead& head)
    : target_(std::move(target)), head_(head), folder_(link_target(target_.file) + ".parts") {}

void EnsembleOutput::require_writable(const std::string& scenario) const {
  std::error_code unknown;
  const std::string& file = target_.file;
  if (file == "-") reject_output(file, "standard output");
  require_format(file, FileFormat::hdf5, "an ensemble (HDF5)");
  if (fs::is_directory(file, unknown)) reject_output(file, "a folder");
  if (fs::exists(file, unknown) && !fs::is_regular_file(file, unknown)) {
    reject_output(file, "a device, a pipe or a socket, whose place a file would take");
  }
  if (fs::exists(file, unknown) && access(file.c_str(), W_OK) != 0) reject_output(file, file, errno);
  if (fs::equivalent(file, scenario, unknown)) {
    throw InputError(file + ": expected a file for the ensemble, got the scenario itself");
  }
}

bool EnsembleOutput::is_complete() const {
  return (target_.resumes || target_.shard) && io::is_complete(target_.file, head_);
}

bool EnsembleOutput::replaces() const {
  std::error_code unknown;
  return !target_.resumes && !target_.shard && fs::exists(target_.file, unknown);
}

std::vector<std::int64_t> EnsembleOutput::find_missing(const std::function<bool(bool)>& on_all) {
  std::error_code unknown;
  const bool is_begun = fs::is_directory(folder_, unknown) && !fs::is_empty(folder_, unknown);
  if (is_begun && !target_.resumes && !target_.shard) {
    throw InputError(folder_ +
                     ": expected --resume, or no such folder, got what an ensemble that was not finished left; to "
                     "begin anew, delete it");
  }
  if (target_.resumes && !fs::is_directory(folder_, unknown) && !fs::exists(target_.file, unknown)) {
    throw InputError(folder_ + ": expected what an ensemble has left, to go on with, got nothing");
  }
  const std::vector<bool> there = done_chunks(folder_, head_);
  const bool none = std::ranges::none_of(there, [](bool is) { return is; });
  if (!on_all(!is_begun || !none || journals_are_of(folder_, head_.kind()))) {
    throw InputError(folder_ +
                     ": expected the journals of this ensemble, got those of another scenario, program or "
                     "instruction set");
  }
  std::vector<std::int64_t> missing;
  for (std::int64_t k = 0; k < head_.chunks(); ++k) {
    const bool is_there = there[static_cast<std::size_t>(k)];
    if (is_there) already_ += head_.members_of(k).size();
    if (!is_there && (!target_.shard || k % target_.shard->of == target_.shard->number - 1)) missing.push_back(k);
  }
  return missing;
}

std::optional<EnsembleTally> EnsembleOutput::write() const {
  const FolderLock lock(folder_);
  if (target_.shard && io::is_complete(target_.file, head_)) return std::nullopt;
  EnsembleTally tally = write_ensemble(target_.file, head_, folder_);
  if (tally.done == head_.plan.count) remove_journals();
  return tally;
}

void EnsembleOutput::remove_journals() const {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace pendula::io
