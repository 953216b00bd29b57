#include "io/checkpoint_table.hpp"

#include <span>
#include <utility>
#include <vector>

#include "io/changed_file.hpp"
#include "io/fingerprint.hpp"

namespace pendula::io {
namespace {

// First columns of the table. The numbers of the two members follow, then three numbers of RunSoFar and the layout of
// the members, which older tables lack.
enum Column : std::size_t { check, serial, at_time, kept_rows, since_row, integrator_size, record_size, numbers };
constexpr std::size_t numbers_so_far = 4;

// Raised when the numbers of members get another order or other meanings while there are as many.
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

/// Empty for an older table.
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

}  // namespace pendula::io
