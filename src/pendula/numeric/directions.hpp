#pragma once

#include <Eigen/Core>

namespace pendula {

/// Vectors side by side, a column each, stored row by row: tangents, gradients, variations of parameters.
template <class Real = double>
using Directions = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace pendula
