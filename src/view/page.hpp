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

/// Rows of a run, thinned so that they never are more than a given number: every stride-th, stride a power of two, and
/// always the first and the last.
class KeptRows {
 public:
  /// width    numbers of a row
  /// most     rows to keep, at least 3
  KeptRows(std::size_t width, std::size_t most);

  void add(std::span<const double> row);

  std::size_t size() const { return regular() + (last_is_regular() ? 0 : 1); }
  std::span<const double> operator[](std::size_t i) const;

  std::int64_t seen() const { return seen_; }      ///< rows that were added
  std::int64_t stride() const { return stride_; }  ///< of those, each so-many-th is here

 private:
  std::size_t regular() const { return rows_.size() / width_; }
  bool last_is_regular() const { return seen_ == 0 || (seen_ - 1) % stride_ == 0; }
  void halve();

  std::size_t width_, most_;
  std::vector<double> rows_, last_;
  std::int64_t seen_ = 0, stride_ = 1;
};

/// How large a page may become: bytes of the rows in it, as text.
struct PageLimits {
  std::size_t rows = 1'100'000;  ///< of all runs; the rest of a page is 75 kB, in space 320, and 900 of a laboratory
  /// Where a row is so long that `rows` leaves less than 512 of them to a run, up to so many.
  std::size_t long_rows = 6'000'000;
};

/// A page to look at one run, or at several together: one HTML file that needs nothing else.
///
/// Rows are thinned, evenly and in bounded memory, and the page says so. As long as 2048 of them can be kept with all
/// their columns as doubles, they are, and the CSV that the page gives has all of their digits; longer rows, and those
/// of the second run and later ones, are floats of what is drawn. Events are marks on the line of time, thinned in the
/// same way; the sizes of steps are shown where the method chooses them.
class Page : public Observer {
 public:
  /// Opens the file. `runs` is how many will follow: they share the page. Throws io::InputError.
  Page(const std::string& file, Scene scene, std::size_t runs = 1, const PageLimits& limits = {});

  /// The times at which the page wants rows of a run of this duration, so that it moves evenly: as many as it can keep,
  /// but no more than serve to be looked at  [s]. `run` is its number, from 0 on.
  RowTimes times(double duration, std::size_t run = 0) const;

  /// What it shows.
  const Scene& scene() const { return scene_; }

  /// Rows that follow are those of a run that the page calls `label`.
  void begin_run(const std::string& label);

  /// Takes a row, in the order of the columns, and the size of the step that it lies in, NaN where there is none  [s].
  void add_row(std::span<const double> row, double step = std::numeric_limits<double>::quiet_NaN());

  /// Takes an event of the run.
  void add_event(const std::string& name, double time, bool up);

  /// The same of a run whose observer the page is.
  void take(const Row& row) override;
  void happen(const EventRow& happened) override;

  /// Says what the energies of the run are compared with: RunReport::energy_error, which is complete with the last row.
  /// Without it the page has no energy errors of the run.
  void end_run(const EnergyError& energy);

  /// Writes the page; does nothing, and leaves no file, where no row came. Throws io::OutputError.
  void close();

 private:
  struct Run {
    std::string label;
    KeptRows rows;      // and the size of the step as the last number
    std::size_t share;  // bytes for the rows, as text
    EnergyError energy;
    std::map<std::string, KeptRows> events;  // by name: when, and whether from − to +
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
