#include "io/trajectory.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <string_view>

#include "io/input_error.hpp"
#include "io/number.hpp"

namespace pendula::io {
namespace {

constexpr std::size_t block_size = std::size_t{1} << 16;

void append_name(std::string& text, std::string_view name, int link) {
  text += ',';
  text += name;
  text += '_';
  text += std::to_string(link + 1);
}

void append_value(std::string& text, double value) {
  text += ',';
  append_number(text, value);
}

}  // namespace

template <class Space>
void append_header(std::string& text, int links) {
  constexpr std::array<std::string_view, 2> angles = {"theta", "phi"};
  constexpr std::array<std::string_view, 2> rates = {"theta_dot", "phi_dot"};
  constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};
  text += 't';
  for (int link = 0; link < links; ++link) {
    for (std::size_t a = 0; a < Space::dof; ++a) append_name(text, angles[a], link);
    for (std::size_t a = 0; a < Space::dof; ++a) append_name(text, rates[a], link);
  }
  for (int link = 0; link < links; ++link) {
    for (std::size_t axis = 0; axis < Space::dimension; ++axis) append_name(text, axes[axis], link);
  }
  text += ",energy\n";
}

template <class Space>
void append_row(std::string& text, const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs,
                double energy) {
  const int links = state.links();
  append_number(text, state.time);
  for (int link = 0; link < links; ++link) {
    for (int a = 0; a < Space::dof; ++a) append_value(text, state.q[a * links + link]);
    for (int a = 0; a < Space::dof; ++a) append_value(text, state.v[a * links + link]);
  }
  for (const double coordinate : bobs.reshaped()) append_value(text, coordinate);
  append_value(text, energy);
  text += '\n';
}

template <class Space>
TrajectoryFile<Space>::TrajectoryFile(const std::filesystem::path& file, int links)
    : file_(file), stream_(std::fopen(file.c_str(), "wb")) {
  if (!stream_) {
    throw InputError(file.string() + ": expected a file that can be written, got: " + std::strerror(errno));
  }
  std::setvbuf(stream_.get(), nullptr, _IONBF, 0);  // blocks are collected here
  append_header<Space>(block_, links);
}

template <class Space>
TrajectoryFile<Space>::~TrajectoryFile() {
  if (stream_) std::fwrite(block_.data(), 1, block_.size(), stream_.get());
}

template <class Space>
void TrajectoryFile<Space>::write(const State<Space>& state, const Points<Space, Eigen::Dynamic>& bobs, double energy) {
  append_row(block_, state, bobs, energy);
  ++rows_;
  if (block_.size() >= block_size) flush();
}

template <class Space>
void TrajectoryFile<Space>::flush() {
  const std::size_t written = std::fwrite(block_.data(), 1, block_.size(), stream_.get());
  const int error = errno;
  const bool complete = written == block_.size();
  block_.clear();
  if (!complete) throw OutputError(file_.string() + ": rows could not be written: " + std::strerror(error));
}

template <class Space>
void TrajectoryFile<Space>::close() {
  flush();
  if (std::fclose(stream_.release()) != 0) {
    throw OutputError(file_.string() + ": rows could not be written: " + std::strerror(errno));
  }
}

template void append_header<Planar>(std::string&, int);
template void append_header<Spatial>(std::string&, int);
template void append_row<Planar>(std::string&, const State<Planar>&, const Points<Planar, Eigen::Dynamic>&, double);
template void append_row<Spatial>(std::string&, const State<Spatial>&, const Points<Spatial, Eigen::Dynamic>&, double);
template class TrajectoryFile<Planar>;
template class TrajectoryFile<Spatial>;

}  // namespace pendula::io
