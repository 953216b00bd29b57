#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/run_record.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/files.hpp"
#include "view/scene.hpp"

namespace pendula::view {

/// Rows of a run, thinned to at most a given number: every stride-th, with stride a power of two, and always the first
/// and the last.
class KeptRows {
 public:
  /// width    numbers of a row
  /// most     rows to keep, at least 3
  KeptRows(std::size_t width, std::size_t most);

  void add(std::span<const double> row);

  std::size_t size() const { return regular() + (last_is_regular() ? 0 : 1); }
  std::span<const double> operator[](std::size_t i) const;

  std::int64_t seen() const { return seen_; }      ///< rows that were added
  std::int64_t stride() const { return stride_; }  ///< every stride-th of these is kept

 private:
  std::size_t regular() const { return rows_.size() / width_; }
  bool last_is_regular() const { return seen_ == 0 || (seen_ - 1) % stride_ == 0; }
  void halve();

  std::size_t width_, most_;
  std::vector<double> rows_, last_;
  std::int64_t seen_ = 0, stride_ = 1;
};

/// Limits of the size of a page: bytes of its rows, as text.
struct PageLimits {
  std::size_t rows = 1'100'000;  ///< of all runs; the rest of a page is 75 kB, in space 320, and 900 of a laboratory
  /// The limit instead of `rows` where rows are so long that a run would have less than 512 of them.
  std::size_t long_rows = 6'000'000;
};

/// A page to look at one run, or at several together: one HTML file that needs nothing else.
///
/// Rows are thinned, evenly and in bounded memory, and the page says so. The first run keeps all columns as doubles if
/// 2048 such rows fit; then the CSV that the page offers has all digits. Otherwise, and in later runs, rows are floats
/// of the columns that are drawn. Events are marks on the line of time, thinned in the same way; step sizes are shown
/// if the method is adaptive.
class Page : public Observer {
 public:
  /// Opens the file. `runs` is the number of runs that will follow and share the page. Throws io::InputError.
  Page(const std::string& file, Scene scene, std::size_t runs = 1, const PageLimits& limits = {});

  /// The times at which the page wants rows of a run of this duration, so that it moves evenly: as many as it can keep
  /// and a viewer needs  [s]. `run` is the number of the run, from 0 on.
  RowTimes times(double duration, std::size_t run = 0) const;

  /// The description of what the page shows.
  const Scene& scene() const { return scene_; }

  /// Begins a run that the page calls `label`; the rows that follow are its rows.
  void begin_run(const std::string& label);

  /// Takes a row, in the order of the columns, and the size of the step that contains it, NaN if there is none  [s].
  void add_row(std::span<const double> row, double step = std::numeric_limits<double>::quiet_NaN());

  /// Takes an event of the run.
  void add_event(const std::string& name, double time, bool up);

  /// The same for a run that has the page as its observer.
  void take(const Row& row) override;
  void happen(const EventRow& happened) override;

  /// Ends a run. `energy` is RunReport::energy_error, which is complete with the last row. Without this call the page
  /// has no energy errors of the run.
  void end_run(const EnergyError& energy);

  /// Writes the page; without any row, does nothing and leaves no file. Throws io::OutputError.
  void close();

 private:
  struct Run {
    std::string label;
    KeptRows rows;      // with the step size as the last number
    std::size_t share;  // bytes for the rows, as text
    EnergyError energy;
    std::map<std::string, KeptRows> events;  // by name: time, and whether from − to +
  };

  std::size_t share_of(std::size_t run) const;
  std::size_t most_rows(std::size_t run) const;
  bool is_exact(const Run& run) const;
  const std::vector<std::size_t>& columns_of(const Run& run) const;
  std::vector<float> energy_errors(const Run& run) const;
  std::vector<float> separations(const Run& run) const;
  std::vector<float> steps(const Run& run) const;
  double distance(std::span<const double> a, std::span<const double> b) const;
  std::string encoded(const Run& run) const;
  nlohmann::json described(const Run& run) const;
  nlohmann::json described() const;
  std::string part(const std::string& name) const;
  std::string text() const;

  Scene scene_;
  PageLimits limits_;
  std::size_t expected_;
  std::vector<std::size_t> all_columns_, drawn_columns_;  // besides the time
  io::WholeFile file_;
  std::vector<Run> runs_;
  std::vector<double> row_;  // with its step
};

}  // namespace pendula::view
