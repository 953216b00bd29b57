#pragma once

#include <Eigen/Core>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula::io {

/// Exact derivatives of expressions in the columns of a row, at a motion: one row for each expression.
struct RowSlopes {
  Eigen::VectorXd by_time;
  Eigen::MatrixXd by_state, by_inputs;  ///< coordinates, then rates, in the order of state_columns; inputs
};

/// Throws ExpressionError; and std::invalid_argument for an expression that may jump, or that contains the energy or an
/// input to which feedback adds.
RowSlopes row_slopes(const Subject& subject, const Motion& motion, std::span<const std::string> expressions);

/// Names of the default measurements: the components of points, and own columns that have derivatives.
std::vector<std::string> point_columns(const Subject& subject);

}  // namespace pendula::io
