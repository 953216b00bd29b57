#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <pendula/space.hpp>
#include <pendula/state.hpp>
#include <stdexcept>
#include <string>

namespace pendula::io {

/// Rows could not be written, although the file could be opened: the disk is full, say.
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Appends the header row of a trajectory: `t`, per link `theta_i` (`phi_i`) `theta_dot_i` (`phi_dot_i`), bobs `x_i`
/// `y_i` (`z_i`), `energy`.
template <class Space>
void append_header(std::string& text, int links);

/// Appends one row, in the order of the header, each number with 17 significant digits.
/// bobs  positions, (dimension x n)  m
template <class Space>
void append_row(std::string& text, const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, double energy);

/// A trajectory as a CSV file. Rows are collected and written in large blocks; `close` writes the rest and tells
/// whether all went well, the destructor does so silently, so that rows survive whatever ends the run.
template <class Space>
class TrajectoryFile {
 public:
  /// Opens the file, replacing one that is there, and writes the header. Throws InputError where it cannot be opened.
  TrajectoryFile(const std::filesystem::path& file, int links);
  ~TrajectoryFile();
  TrajectoryFile(const TrajectoryFile&) = delete;
  TrajectoryFile& operator=(const TrajectoryFile&) = delete;

  /// Throws OutputError where a block cannot be written.
  void write(const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, double energy);

  /// Writes what is left and closes the file. Throws OutputError.
  void close();

  std::int64_t rows() const { return rows_; }

 private:
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };

  void flush();

  std::filesystem::path file_;
  std::unique_ptr<std::FILE, Close> stream_;
  std::string block_;
  std::int64_t rows_ = 0;
};

}  // namespace pendula::io
