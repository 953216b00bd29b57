#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/state.hpp>
#include <vector>

namespace pendula::io {

/// Energy errors |H − H₀|, relative to Σ M_i |g| l_i, or to |H₀| where there is no gravity.
struct EnergyError {
  double initial = std::nan("");  ///< H₀, NaN before the first row
  double scale = 0;               ///< what errors are divided by
  double largest = 0;  ///< over the rows so far; NaN, and so to stay, where the scale is zero and an error is not

  /// The relative error of one energy.
  double of(double energy) const {
    const double error = std::abs(energy - initial);
    return error == 0 ? 0 : error / (scale > 0 ? scale : std::nan(""));
  }
};

/// How far the energy is from what the start had and loads brought, over the rows; relative to all that the chain had.
struct EnergyBalance {
  double scale = 0;            ///< Σ M_i |g| l_i and the kinetic energy at the start  [J]
  double most = 0, least = 0;  ///< relative, above and below

  void add(const Energies<double>& energies, double work) {
    if (rows_++ == 0) initial_ = energies.total() - work;
    const double whole = scale + std::abs(work);
    const double off = energies.total() - initial_ - work;
    if (off == 0 || !(whole > 0)) return;
    most = std::max(most, off / whole);
    least = std::min(least, off / whole);
  }

 private:
  double initial_ = 0;
  std::int64_t rows_ = 0;
};

/// A row of the table that summaries show.
struct TableRow {
  double time = 0;
  Eigen::VectorXd bob;      ///< the last one
  double energy_error = 0;  ///< relative
};

/// What is kept of the rows of a run besides the file: energy errors, a thinned table, the last state.
template <class Space>
class RunRecord {
 public:
  /// The table has about `table_rows` rows, evenly over `duration`.
  RunRecord(const Chain<Space>& chain, double duration, int table_rows = 11)
      : scale_(energy_scale(chain)), interval_(duration / (table_rows - 1)) {}

  /// bobs  positions, (dimension x n); work: what loads have brought since the first row  [J]
  void add(const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, const Energies<double>& energies,
           double work) {
    const double energy = energies.total();
    if (rows_ == 0) balance_.scale = scale_ + energies.kinetic;
    if (rows_++ == 0) error_ = {energy, scale_ > 0 ? scale_ : std::abs(energy), 0};
    balance_.add(energies, work);
    const double error = error_.of(energy);
    if (!std::isnan(error_.largest) && !(error <= error_.largest)) error_.largest = error;
    energy_ = energy;
    last_ = state;
    last_row_ = {state.time, bobs.col(bobs.cols() - 1), error};
    // The slack lets a row in that comes at its time but for rounding.
    const double place = interval_ > 0 ? std::floor(state.time / interval_ + 1e-6) : 0;
    if (place <= place_) return;
    place_ = place;
    table_.push_back(last_row_);
  }

  std::int64_t rows() const { return rows_; }
  const EnergyError& energy_error() const { return error_; }
  double energy() const { return energy_; }  ///< of the last row
  const EnergyBalance& balance() const { return balance_; }
  const State<Space>& last() const { return last_; }  ///< state of the last row

  /// The thinned table; it ends in the last row.
  std::vector<TableRow> table() const {
    std::vector<TableRow> table = table_;
    if (!table.empty() && table.back().time != last_row_.time) table.push_back(last_row_);
    return table;
  }

 private:
  double scale_;
  double interval_;
  double place_ = -1;
  std::int64_t rows_ = 0;
  EnergyError error_;
  EnergyBalance balance_;
  double energy_ = std::nan("");
  State<Space> last_;
  TableRow last_row_;
  std::vector<TableRow> table_;
};

}  // namespace pendula::io
