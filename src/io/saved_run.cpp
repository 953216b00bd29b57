#include "io/saved_run.hpp"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "io/errors.hpp"
#include "io/hdf5.hpp"
#include "io/process.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

/// Fingerprint of the origin of a run, without versions and solvers: a resumed run compares these itself.
std::uint64_t fingerprint_of(const RunOrigin& origin) {
  std::vector<std::string> texts = {origin.history, origin.scenario_name, origin.scenario, origin.model};
  texts.insert(texts.end(), origin.overrides.begin(), origin.overrides.end());
  std::uint64_t hash = empty_fingerprint;
  for (const std::string& text : texts) hash = fingerprint(text, fingerprint(std::to_string(text.size()) + ':', hash));
  return hash;
}

/// Reads a word, such as the name of a kernel; it may be empty. Throws ChangedFile.
std::string read_word(const hdf5::Handle& object, const std::string& name) {
  std::string word = hdf5::read_attribute(object, name);
  if (!std::ranges::all_of(word, [](char c) { return c > ' ' && c < '\x7f'; })) {
    throw ChangedFile("one whose attribute \"" + name + "\" is damaged");
  }
  return word;
}

}  // namespace

hdf5::Handle write_origin(const hdf5::Handle& file, const RunOrigin& origin) {
  hdf5::write_attribute(file, "Conventions", "CF-1.11");
  hdf5::write_attribute(file, "title", origin.title);
  RunOrigin written = origin;
  if (!written.history.empty()) written.history += '\n';
  written.history += history_line(origin.command);
  hdf5::write_attribute(file, "history", written.history);
  hdf5::write_attribute(file, "source", "pendula " + origin.version);
  hdf5::write_attribute(file, "pendula", origin.version);
  hdf5::write_attribute(file, "instruction_set", origin.instruction_set);
  hdf5::write_attribute(file, "solver", origin.solver);
  hdf5::write_attribute(file, "kernel", origin.kernel);
  hdf5::Handle run = hdf5::create_group(file, "run");
  hdf5::write_attribute(run, "scenario_file", origin.scenario_name);
  hdf5::write_text(run, "scenario", origin.scenario);
  hdf5::write_text(run, "set", nlohmann::json(origin.overrides).dump());
  hdf5::write_text(run, "model", origin.model);
  hdf5::write_attribute(run, "checksum", static_cast<std::int64_t>(fingerprint_of(written)));
  return run;
}

RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run) {
  RunOrigin origin;
  origin.version = read_word(file, "pendula");
  origin.instruction_set = read_word(file, "instruction_set");
  origin.solver = read_word(file, "solver");
  origin.kernel = read_word(file, "kernel");
  if (hdf5::has_attribute(file, "history")) origin.history = hdf5::read_attribute(file, "history");
  origin.scenario_name = hdf5::read_attribute(run, "scenario_file");
  origin.scenario = hdf5::read_text(run, "scenario");
  origin.overrides = nlohmann::json::parse(hdf5::read_text(run, "set")).get<std::vector<std::string>>();
  origin.model = hdf5::read_text(run, "model");
  return origin;
}

void require_written(const RunOrigin& origin, const hdf5::Handle& run) {
  if (static_cast<std::uint64_t>(hdf5::read_number(run, "checksum")) == fingerprint_of(origin)) return;
  throw ChangedFile("one whose scenario, settings or model are not what it was written with");
}

namespace {

// First columns of the table. The numbers of the two members follow, then three numbers of RunSoFar and the layout of
// the members, which older tables lack.
enum Column : std::size_t { check, serial, at_time, kept_rows, since_row, integrator_size, record_size, numbers };
constexpr std::size_t numbers_so_far = 4;

// Raised when the numbers of members change their order or their meanings, but not their count.
constexpr double layout = 1;

// Rows of the table, written in turn.
constexpr std::size_t slots = 2;

/// Checksum of a row: it does not match if the row was written in part.
double checksum(std::span<const double> row) {
  return as_number(fingerprint(row.subspan(check + 1)));
}

std::vector<double> to_row(const Checkpoint& checkpoint, const RunSoFar& so_far, std::uint64_t count) {
  std::vector<double> row(numbers);
  row[serial] = static_cast<double>(count);
  row[at_time] = checkpoint.time;
  row[kept_rows] = static_cast<double>(checkpoint.rows);
  row[since_row] = static_cast<double>(checkpoint.since_row);
  row[integrator_size] = static_cast<double>(checkpoint.integrator.numbers.size());
  row[record_size] = static_cast<double>(checkpoint.record.numbers.size());
  for (const Member* member : {&checkpoint.integrator, &checkpoint.record}) {
    row.insert(row.end(), member->numbers.begin(), member->numbers.end());
  }
  row.insert(row.end(), {static_cast<double>(so_far.events), so_far.rows_check, so_far.events_check, layout});
  row[check] = checksum(row);
  return row;
}

/// nullopt for an older table.
std::optional<RunSoFar> so_far_in(std::span<const double> row) {
  const auto before = static_cast<std::size_t>(row[integrator_size] + row[record_size]) + numbers;
  if (row.size() == before) return std::nullopt;
  const auto last = row.last(numbers_so_far);
  if (row.size() != before + numbers_so_far || last[3] != layout) {
    throw ChangedFile("one of another version of pendula, whose places to go on from are of another layout");
  }
  return RunSoFar{static_cast<std::size_t>(last[0]), last[1], last[2]};
}

Checkpoint from_row(std::span<const double> row) {
  Checkpoint checkpoint;
  checkpoint.time = row[at_time];
  checkpoint.rows = static_cast<std::int64_t>(row[kept_rows]);
  checkpoint.since_row = static_cast<std::int64_t>(row[since_row]);
  const auto first = row.begin() + numbers, second = first + static_cast<std::ptrdiff_t>(row[integrator_size]);
  checkpoint.integrator.numbers.assign(first, second);
  checkpoint.record.numbers.assign(second, second + static_cast<std::ptrdiff_t>(row[record_size]));
  return checkpoint;
}

bool is_whole(std::span<const double> row) {
  return row[serial] > 0 && row[check] == checksum(row);
}

}  // namespace

std::optional<KeptCheckpoint> last_checkpoint(const hdf5::Handle& run, double rows) {
  if (!hdf5::has(run, "checkpoint")) return std::nullopt;
  const hdf5::Handle table = hdf5::open_dataset(run, "checkpoint");
  std::optional<std::vector<double>> last;
  for (std::size_t slot = 0; slot < slots; ++slot) {
    std::vector<double> row = hdf5::read_rows(table, slot, 1);
    if (!is_whole(row) || row[kept_rows] > rows) continue;
    if (!last || row[serial] > (*last)[serial]) last = std::move(row);
  }
  if (!last) return std::nullopt;
  return KeptCheckpoint{from_row(*last), so_far_in(*last)};
}

void CheckpointTable::create(const hdf5::Handle& run, const Checkpoint& checkpoint) {
  table_ = hdf5::create_table(run, "checkpoint", slots, to_row(checkpoint, {}, 0).size());
}

void CheckpointTable::write(const Checkpoint& checkpoint, const RunSoFar& so_far) {
  ++serial_;
  hdf5::write_rows(table_, serial_ % slots, to_row(checkpoint, so_far, serial_));
}

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
    if (saved.has_rows) {
      const hdf5::Handle times = hdf5::open_dataset(opened, "t");
      const auto count = hdf5::extent(times)[0];
      rows = static_cast<double>(count);
      if (count > 0) saved.end = hdf5::read_rows(times, static_cast<std::size_t>(count) - 1, 1)[0];
    }
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
