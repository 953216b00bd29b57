#include "io/trajectory.hpp"

#include <array>
#include <cstddef>
#include <string_view>

#include "io/number.hpp"

namespace pendula::io {
namespace {

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

template void append_header<Planar>(std::string&, int);
template void append_header<Spatial>(std::string&, int);
template void append_row<Planar>(std::string&, const State<Planar>&, const Points<Planar, Eigen::Dynamic>&, double);
template void append_row<Spatial>(std::string&, const State<Spatial>&, const Points<Spatial, Eigen::Dynamic>&, double);

}  // namespace pendula::io
