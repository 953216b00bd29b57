#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// Time between rows of a table of about ten rows of a run: a round number, if the rows of the run lie on its
/// multiples. `spacing` is the distance of these in time, 0 if unknown.
inline double table_interval(double duration, double spacing) {
  constexpr double wanted = 10, most = 15, fewest = 5, slack = 1e-6;
  if (!(duration > 0) || !(spacing > 0)) return duration / wanted;
  const auto is_whole = [](double x) { return x > 0.5 && std::abs(x - std::round(x)) <= slack * x; };
  double best = 0, best_off = 0;
  const auto consider = [&](double interval) {
    const double rows = duration / interval;
    if (rows > most + slack || rows < fewest - slack || !is_whole(interval / spacing)) return;
    const double off = std::abs(std::log(rows / wanted)) + (is_whole(rows) ? 0 : 1);
    if (best > 0 && off >= best_off) return;
    best = interval;
    best_off = off;
  };
  for (const double round : std::array{1.0, 2.0, 2.5, 5.0, 10.0}) {
    consider(round * std::pow(10, std::floor(std::log10(duration / most))));
  }
  if (best > 0) return best;
  const double all = duration / spacing, first = std::max(1.0, std::ceil(all / most - slack));
  for (double count = first; count <= all / fewest + slack && count < first + 1e3; ++count) consider(count * spacing);
  return best > 0 ? best : std::ceil(all / wanted - slack) * spacing;
}

/// Energy errors |H − H₀|, for a chain relative to Σ M_i |g| l_i, or to |H₀| without gravity; for any other system
/// relative to the largest |T| + |U| over the rows.
struct EnergyError {
  double initial = std::nan("");  ///< H₀, NaN before the first row
  double scale = 0;               ///< divisor of errors
  double largest = 0;  ///< over the rows so far; NaN, and staying so, if the scale is zero and an error is not

  /// The relative error of an energy.
  double of(double energy) const {
    const double error = std::abs(energy - initial);
    return error == 0 ? 0 : error / (scale > 0 ? scale : std::nan(""));
  }
};

namespace detail {

/// Scale of the energy errors of a chain, given Σ M_i |g| l_i.
inline double compared_with(std::optional<double> scale, double initial) {
  return scale.value_or(0) > 0 ? *scale : std::abs(initial);
}

}  // namespace detail

/// Extremes, over the rows, of the energy less the initial one and the work of loads, relative to all energy involved.
struct EnergyBalance {
  double most = 0, least = 0;  ///< relative, above and below
};

/// A row of the table in a summary.
struct TableRow {
  double time = 0;
  std::vector<double> shown;  ///< Subject::shown_columns
  double energy_error = 0;    ///< relative

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(time, energy_error);
    numbers.range(shown.data(), shown.size());
  }
};

/// The record of the rows of a run, besides the file: energy errors, a thinned table, the last state.
///
/// Errors are kept in joules, since their scale may be known only when the run ends.
class RunRecord {
 public:
  /// The table has a few rows spread evenly over `duration`; `spacing` is the distance of rows in time, 0 if unknown.
  RunRecord(const Subject& subject, Motion start, double duration, double spacing = 0)
      : scale_(subject.energy_scale()),
        shown_(subject.shown_columns()),
        interval_(table_interval(duration, spacing)),
        last_(std::move(start)),
        last_row_(empty_row()) {}

  /// `row` holds the numbers of the trajectory; `work` is the work of loads so far  [J].
  void add(const Motion& motion, const Observation& seen, const std::vector<double>& row, double work) {
    if (rows_++ == 0) start(seen, work);
    follow(seen, work);
    last_ = motion;
    const auto first = row.begin() + static_cast<std::ptrdiff_t>(shown_.first);
    last_row_ = {motion.time, {first, first + static_cast<std::ptrdiff_t>(shown_.second)}, seen.energy - initial_};
    add_to_table(last_row_);
  }

  std::int64_t rows() const { return rows_; }
  EnergyError energy_error() const {
    EnergyError error{initial_, compared_with(), 0};
    error.largest = std::isnan(largest_) ? largest_ : error.of(initial_ + largest_);
    return error;
  }
  double energy() const { return energy_; }     ///< of the last row
  const Motion& last() const { return last_; }  ///< state of the last row, or the start

  EnergyBalance balance() const {
    if (scale_) return balance_;
    const double whole = std::max(whole_, rounding * largest_sum_);
    if (!(whole > 0)) return {};
    return {balance_.most / whole, balance_.least / whole};
  }

  /// The thinned table; its last row is the last row of the run.
  std::vector<TableRow> table() const {
    std::vector<TableRow> table = table_;
    if (!table.empty() && table.back().time != last_row_.time) table.push_back(last_row_);
    const EnergyError error{initial_, compared_with(), 0};
    for (TableRow& row : table) row.energy_error = error.of(initial_ + row.energy_error);
    return table;
  }

  /// Visits the numbers of the record. The table is thinned again when read, since this run may be longer than the one
  /// that it was saved in.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(rows_, initial_, energy_, brought_before_, largest_, largest_sum_, whole_, balance_.most, balance_.least);
    numbers(last_.time, last_.q, last_.v, last_row_);
    std::vector<TableRow> table = std::exchange(table_, {});
    auto count = static_cast<double>(table.size());
    numbers(count);
    table.resize(most_table_rows, empty_row());
    for (TableRow& row : table) numbers(row);
    place_ = -1;
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) add_to_table(table[k]);
  }

 private:
  static constexpr std::size_t most_table_rows = 16;
  // The scale is at least this fraction of |T| + |U|: smaller energies are lost in the rounding of that sum.
  static constexpr double rounding = 1e-10;

  TableRow empty_row() const { return {0, std::vector<double>(shown_.second), 0}; }

  // The slack 1e-6 accepts a row that rounding puts just before its place.
  void add_to_table(const TableRow& row) {
    const double place = interval_ > 0 ? std::floor(row.time / interval_ + 1e-6) : 0;
    if (place <= place_ || table_.size() == most_table_rows) return;
    place_ = place;
    table_.push_back(row);
  }

  void start(const Observation& seen, double work) {
    initial_ = seen.energy;
    brought_before_ = work;
    whole_ = scale_.value_or(0) + std::abs(seen.kinetic);
  }

  void follow(const Observation& seen, double work) {
    energy_ = seen.energy;
    const double error = std::abs(energy_ - initial_);
    if (!std::isnan(largest_) && !(error <= largest_)) largest_ = error;
    largest_sum_ = std::max(largest_sum_, std::abs(seen.kinetic) + std::abs(seen.potential()));
    const double brought = work - brought_before_, off = energy_ - initial_ - brought;
    // All energy involved: for a chain the initial kinetic energy and what gravity can give; for other systems the
    // largest kinetic energy seen, which is known only at the end.
    if (!scale_) whole_ = std::max(whole_, std::abs(seen.kinetic) + std::abs(brought));
    const double whole = scale_ ? whole_ + std::abs(brought) : 1;
    if (off == 0 || !(whole > 0)) return;
    balance_.most = std::max(balance_.most, off / whole);
    balance_.least = std::min(balance_.least, off / whole);
  }

  double compared_with() const { return scale_ ? detail::compared_with(scale_, initial_) : largest_sum_; }

  std::optional<double> scale_;
  std::pair<std::size_t, std::size_t> shown_;
  double interval_;
  double place_ = -1;
  std::int64_t rows_ = 0;
  double initial_ = std::nan(""), energy_ = std::nan(""), brought_before_ = 0;
  double largest_ = 0, largest_sum_ = 0;  // largest error and |T| + |U|  [J]
  double whole_ = 0;                      // scale of the energy balance  [J]
  EnergyBalance balance_;                 // in joules for systems that are not chains
  Motion last_;
  TableRow last_row_;  // here and in the table, energy errors are in joules
  std::vector<TableRow> table_;
};

}  // namespace pendula
