#pragma once

#include <Eigen/Core>

namespace pendula {

/// Vectors as the columns of a matrix stored row by row: tangents, gradients, or variations of parameters.
template <class Real = double>
using Directions = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace pendula
