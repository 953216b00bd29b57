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

/// How long members of an ensemble are moved, and how.
struct PropagateOptions {
  double duration = 10;        ///< s
  SimulationOptions run = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  double time = 0;             ///< s; where all begin
  int threads = 0;             ///< 0: as many as there are processors
  std::stop_token stop = {};   ///< ends all, who then say so
};

/// Where members of an ensemble ended.
struct Ends {
  using Array = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Array q, v;  ///< (members x coordinates)
  /// PENDULA_OK, PENDULA_FAILED or PENDULA_STOPPED: then q and v are what it came to.
  std::vector<pendula_status> how;
  Eigen::VectorXd energy_errors;  ///< the largest of each, relative
};

/// Moves many, each from a row of `starts`: its coordinates, then its rates, which may be left out: at rest. `models`
/// is one for all, or one for each. Where one ends depends on its row and its model alone, to the last bit; who fails
/// says so and stops nobody else. Throws std::invalid_argument on sizes and options that make no sense.
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

/// The same of one model.
inline Ends propagate(const Model& model, const Eigen::Ref<const Eigen::MatrixXd>& starts,
                      const PropagateOptions& options = {}) {
  return propagate(std::span(&model, 1), starts, options);
}

}  // namespace pendula
