#include "io/saved_run.hpp"

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>

#include "io/errors.hpp"
#include "io/hdf5.hpp"
#include "io/process.hpp"

namespace pendula::io {

void guarded_source(const std::string& file, const std::function<void()>& act) {
  const auto reject = [&](const std::string& what) {
    throw InputError(file + ": expected a run file to go on from, got " + what);
  };
  std::error_code unknown;
  if (!std::filesystem::exists(file, unknown)) reject("a file that is not there");
  hdf5::begin();
  try {
    act();
  } catch (const hdf5::Error& error) {
    reject(std::string("one that HDF5 cannot read: ") + error.what());
  } catch (const nlohmann::json::exception&) {
    reject("one whose list of settings is damaged");
  } catch (const ChangedFile& error) {
    reject(error.what());
  }
}

SavedRun read_saved_run(const std::string& file) {
  SavedRun saved;
  guarded_source(file, [&] {
    const hdf5::Handle opened = hdf5::open_file(file);
    if (!hdf5::has(opened, "run")) throw ChangedFile("a file without the group \"run\"");
    const hdf5::Handle run = hdf5::open_group(opened, "run");
    // HDF5 has no checksums for texts, and may loop forever in damaged ones.
    if (!comes_to_an_end([&] { read_origin(opened, run); })) throw ChangedFile("one that is damaged");
    saved.origin = read_origin(opened, run);
    saved.has_rows = hdf5::has(opened, "t");
    double rows = std::numeric_limits<double>::infinity();
    if (saved.has_rows) rows = static_cast<double>(hdf5::extent(hdf5::open_dataset(opened, "t"))[0]);
    if (const auto last = last_checkpoint(run, rows)) {
      saved.checkpoint = last->checkpoint;
      saved.so_far = last->so_far;
    }
    // Older files have no checksums.
    const bool is_old = saved.checkpoint ? !saved.so_far : !hdf5::has_attribute(run, "checksum");
    if (!is_old) require_written(saved.origin, run);
    saved.has_events = hdf5::has(opened, "events");
  });
  return saved;
}

}  // namespace pendula::io
