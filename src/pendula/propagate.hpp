#pragma once

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <cstddef>
#include <pendula/c_error.hpp>
#include <pendula/model.hpp>
#include <pendula/simulation.hpp>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <vector>

namespace pendula {

/// How long to move the members of an ensemble, and with which options.
struct PropagateOptions {
  double duration = 10;        ///< s
  SimulationOptions run = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  double time = 0;             ///< start of all members  [s]
  int threads = 0;             ///< 0: one per processor
  std::stop_token stop = {};   ///< stops all members, whose status tells
};

/// Final states of the members of an ensemble.
struct Ends {
  using Array = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Array q, v;  ///< (members x coordinates)
  /// PENDULA_OK, PENDULA_FAILED or PENDULA_STOPPED; in the last two cases q and v are the last state reached.
  std::vector<pendula_status> how;
  Eigen::VectorXd energy_errors;  ///< the largest of each member, relative
};

/// Moves an ensemble. Each row of `starts` has the coordinates of a member, then its rates, which may be left out: at
/// rest. `models` has one for all members, or one for each. The end of a member depends on its row and its model alone,
/// to the last bit; a member that fails does not stop the others. Throws std::invalid_argument for sizes and options
/// that make no sense.
inline Ends propagate(std::span<const Model> models, const Eigen::Ref<const Eigen::MatrixXd>& starts,
                      const PropagateOptions& options = {}) {
  if (models.empty()) throw std::invalid_argument("models: expected one, or one for each member, got none");
  const auto n = static_cast<Eigen::Index>(models.front().coordinates());
  if (starts.cols() != n && starts.cols() != 2 * n) {
    throw std::invalid_argument("starts: expected " + std::to_string(n) + " columns, or " + std::to_string(2 * n) +
                                " with rates, got " + std::to_string(starts.cols()));
  }
  Ends::Array begins = Ends::Array::Zero(starts.rows(), 2 * n), ends = begins;
  begins.leftCols(starts.cols()) = starts;
  std::vector<const pendula_model*> all;
  all.reserve(models.size());
  for (const Model& model : models) all.push_back(model.get());
  const pendula_options plain = detail::plain(options.run);
  std::stop_token stop = options.stop;
  pendula_ensemble ensemble{};
  ensemble.models = all.data();
  ensemble.model_count = all.size();
  ensemble.starts = begins.data();
  ensemble.members = static_cast<std::size_t>(starts.rows());
  ensemble.time = options.time;
  ensemble.duration = options.duration;
  ensemble.options = &plain;
  ensemble.threads = options.threads;
  ensemble.stop = detail::stop_function(stop);
  ensemble.context = &stop;
  Ends found;
  found.how.resize(ensemble.members);
  found.energy_errors.resize(starts.rows());
  detail::require(pendula_propagate(&ensemble, ends.data(), found.how.data(), found.energy_errors.data()));
  found.q = ends.leftCols(n);
  found.v = ends.rightCols(n);
  return found;
}

/// The same with one model.
inline Ends propagate(const Model& model, const Eigen::Ref<const Eigen::MatrixXd>& starts,
                      const PropagateOptions& options = {}) {
  return propagate(std::span(&model, 1), starts, options);
}

}  // namespace pendula
