#pragma once

#include <Eigen/Core>
#include <pendula/kernels/planar_link.hpp>
#include <pendula/kernels/spatial_link.hpp>
#include <string_view>

namespace pendula {

/// The plane: q = θ, bobs at (x, y) with y up (paper eq. 1, 2).
struct Planar {
  using Link = kernels::PlanarLink;  ///< û(q) and its derivatives, generated
  static constexpr std::string_view name = "planar";
  static constexpr int dof = Link::dof;                              ///< coordinates of a link
  static constexpr int dimension = Link::dimension;                  ///< Cartesian components of a bob
  static constexpr int torque_components = Link::torque_components;  ///< numbers in the torque on one link
};

/// Space: q = (θ, φ), bobs at (x, y, z) with z up (paper eq. 24–26).
struct Spatial {
  using Link = kernels::SpatialLink;
  static constexpr std::string_view name = "spatial";
  static constexpr int dof = Link::dof;
  static constexpr int dimension = Link::dimension;
  static constexpr int torque_components = Link::torque_components;
};

/// Number of coordinates of N links; Eigen::Dynamic if N is.
template <class Space, int N>
inline constexpr int coordinates_of = N == Eigen::Dynamic ? Eigen::Dynamic : Space::dof* N;

/// One number a link, (n).
template <int N, class Real = double>
using LinkVector = Eigen::Matrix<Real, N, 1>;

/// Coordinates or rates of a chain, (dof·n): θ_1..θ_n, then in space φ_1..φ_n.
template <class Space, int N, class Real = double>
using Coordinates = Eigen::Matrix<Real, coordinates_of<Space, N>, 1>;

/// One Cartesian point or velocity a bob, (dimension x n).
template <class Space, int N, class Real = double>
using Points = Eigen::Matrix<Real, Space::dimension, N>;

/// Torque on each link, (torque_components x n): in the plane a number, in space a vector  [N m].
template <class Space, int N>
using Torque = Eigen::Matrix<double, Space::torque_components, N>;

}  // namespace pendula
