#pragma once

#include <algorithm>
#include <cstdint>
#include <pendula/chain/space.hpp>
#include <pendula/chain/state.hpp>
#include <string>

#include "io/line_file.hpp"

namespace pendula::io {

/// Appends the header row of a trajectory: `t`, per link `theta_i` (`phi_i`) `theta_dot_i` (`phi_dot_i`), bobs `x_i`
/// `y_i` (`z_i`), `energy`.
template <class Space>
void append_header(std::string& text, int links);

/// Appends one row, in the order of the header, each number with 17 significant digits.
/// bobs  positions, (dimension x n)  m
template <class Space>
void append_row(std::string& text, const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, double energy);

/// A trajectory as a CSV file of whole rows.
template <class Space>
class TrajectoryFile {
 public:
  /// Opens the file, as LineFile does, and begins it with the header. Throws InputError where it cannot be opened.
  TrajectoryFile(const std::string& file, int links) : file_(file) { append_header<Space>(file_.pending(), links); }

  /// Throws OutputError where rows cannot be written.
  void write(const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, double energy) {
    append_row(file_.pending(), state, bobs, energy);
    file_.flush_if_due();
  }

  /// Writes what is left and closes the file. Throws OutputError.
  void close() { file_.close(); }

  /// Rows that are in the file.
  std::int64_t rows() const { return std::max<std::int64_t>(file_.lines() - 1, 0); }

 private:
  LineFile file_;
};

}  // namespace pendula::io
