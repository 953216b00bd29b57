#include "io/row_slopes.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <pendula/chain/invariants.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/run/state_columns.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/system/system_table.hpp>
#include <stdexcept>
#include <utility>

#include "io/expression.hpp"

namespace pendula::io {
namespace {

/// Velocities of the components of all points  [m/s].
Eigen::VectorXd point_velocities(const SystemSubject& subject, const Motion& motion) {
  const SystemTable& table = subject.table();
  const std::vector<int> sizes(table.info.point_sizes.begin(), table.info.point_sizes.end());
  Eigen::VectorXd velocities(std::accumulate(sizes.begin(), sizes.end(), 0));
  const SystemNumbers numbers = subject.numbers_at(motion);
  const Conditions at{table.context, numbers.parameters.data(), &motion.time, numbers.inputs.data()};
  if (velocities.size() > 0) table.plain.velocities(at, motion.q.data(), motion.v.data(), velocities.data());
  return velocities;
}
template <class Space>
Eigen::VectorXd point_velocities(const ChainSubject<Space>& subject, const Motion& motion) {
  return bob_velocities(subject.chain(), motion).reshaped();
}

/// Derivatives of points with respect to time, then coordinates, (components x (1 + coordinates)). Velocities of points
/// are linear in rates, so that one at unit rate is the derivative.
Eigen::MatrixXd point_slopes(const Subject& subject, Motion motion) {
  const Eigen::Index count = motion.q.size();
  const auto velocities = [&] {
    return as_its_kind(subject, [&](const auto& kind) { return point_velocities(kind, motion); });
  };
  motion.v.setZero();
  const Eigen::VectorXd by_time = velocities();
  Eigen::MatrixXd slopes(by_time.size(), 1 + count);
  slopes.col(0) = by_time;
  for (Eigen::Index k = 0; k < count; ++k) {
    motion.v.setZero();
    motion.v[k] = 1;
    slopes.col(1 + k) = velocities() - by_time;
  }
  return slopes;
}

/// Derivatives of each column of a row, (columns x (1 + state + inputs)); energies are left out.
Eigen::MatrixXd column_slopes(const Subject& subject, const Motion& motion, std::size_t inputs) {
  const std::vector<std::size_t> state = state_columns(subject);
  const Eigen::Index size = static_cast<Eigen::Index>(state.size());
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(subject.columns().size()),
                                                 1 + size + static_cast<Eigen::Index>(inputs));
  slopes(0, 0) = 1;
  for (Eigen::Index k = 0; k < size; ++k)
    slopes(static_cast<Eigen::Index>(state[static_cast<std::size_t>(k)]), 1 + k) = 1;
  const Eigen::MatrixXd of_points = point_slopes(subject, motion);
  const std::vector<std::string> names = input_names(subject);
  Eigen::Index point = 0;
  std::vector<std::size_t> point_places;
  for (const Quantity& quantity : subject.quantities()) {
    for (std::size_t k = 0; k < quantity.size(); ++k) {
      if (quantity.role == Role::point) point_places.push_back(quantity.column(k));
    }
    if (quantity.role != Role::input) continue;
    const auto input = std::ranges::find(names, quantity.name) - names.begin();
    slopes(static_cast<Eigen::Index>(quantity.first), 1 + size + input) = 1;
  }
  std::ranges::sort(point_places);  // as points are observed
  for (const std::size_t place : point_places) {
    slopes.row(static_cast<Eigen::Index>(place)).head(of_points.cols()) = of_points.row(point++);
  }
  return slopes;
}

/// Why an expression has no derivatives; empty if it has some.
std::string against_slopes(const Subject& subject, const Expression& expression, const std::string& text) {
  if (expression.may_jump()) return "expected an expression that does not jump, got " + text;
  const std::vector<std::size_t> fed = subject.fed_columns();
  const std::vector<std::string> names = subject.columns();
  for (const Quantity& quantity : subject.quantities()) {
    for (const std::size_t column : expression.columns()) {
      const bool is_fed = std::ranges::find(fed, column) != fed.end();
      const bool has_none = is_fed || quantity.role == Role::energy || quantity.role == Role::force;
      if (!quantity.holds(column) || !has_none) continue;
      return "expected an expression in t, coordinates, rates, points and inputs without feedback, got " +
             names[column];
    }
  }
  return "";
}

}  // namespace

RowSlopes row_slopes(const Subject& subject, const Motion& motion, std::span<const std::string> expressions) {
  const std::size_t inputs = input_names(subject).size();
  Eigen::MatrixXd of_columns = column_slopes(subject, motion, inputs);
  const std::vector<std::string> names = subject.columns();
  std::vector<double> row;
  subject.append_row(motion, subject.observe(motion), row);
  const auto change = [&](const std::string& text) {
    Expression expression(text, names);
    if (const std::string problem = against_slopes(subject, expression, text); !problem.empty()) {
      throw std::invalid_argument(problem);
    }
    Eigen::RowVectorXd slopes = Eigen::RowVectorXd::Zero(of_columns.cols());
    std::vector<Dual<double>> numbers;
    for (const std::size_t column : expression.columns()) numbers.emplace_back(row[column]);
    for (std::size_t j = 0; j < numbers.size(); ++j) {
      numbers[j].slope = 1;
      const double slope = expression(std::span<const Dual<double>>(numbers)).slope;
      numbers[j].slope = 0;
      slopes += slope * of_columns.row(static_cast<Eigen::Index>(expression.columns()[j]));
    }
    return slopes;
  };
  for (const Quantity& quantity : subject.quantities()) {
    const bool is_asked_for = std::ranges::any_of(expressions, [&](const std::string& text) {
      const Expression expression(text, names);
      return std::ranges::any_of(expression.columns(), [&](std::size_t column) { return quantity.holds(column); });
    });
    if (quantity.role != Role::own || !is_asked_for) continue;
    of_columns.row(static_cast<Eigen::Index>(quantity.first)) = change(quantity.meaning);
  }
  Eigen::MatrixXd slopes(static_cast<Eigen::Index>(expressions.size()), of_columns.cols());
  for (std::size_t k = 0; k < expressions.size(); ++k) {
    slopes.row(static_cast<Eigen::Index>(k)) = change(expressions[k]);
  }
  const Eigen::Index size = 2 * motion.q.size();
  return {slopes.col(0), slopes.middleCols(1, size), slopes.rightCols(static_cast<Eigen::Index>(inputs))};
}

std::vector<std::string> point_columns(const Subject& subject) {
  const std::vector<std::string> names = subject.columns();
  std::vector<std::size_t> places;
  for (const Quantity& quantity : subject.quantities()) {
    const bool has_slopes = quantity.role == Role::own &&
                            against_slopes(subject, Expression(quantity.meaning, names), quantity.meaning).empty();
    const bool is_output = quantity.role == Role::point || has_slopes;
    for (std::size_t k = 0; is_output && k < quantity.size(); ++k) places.push_back(quantity.column(k));
  }
  std::ranges::sort(places);
  std::vector<std::string> found;
  found.reserve(places.size());
  for (const std::size_t place : places) found.push_back(names[place]);
  return found;
}

}  // namespace pendula::io
