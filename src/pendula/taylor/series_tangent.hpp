#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/numeric/directions.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/lagrangian_variation.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/series_info.hpp>
#include <pendula/system/series_sums.hpp>
#include <pendula/system/system_model.hpp>
#include <pendula/system/system_table.hpp>
#include <pendula/taylor/series_limits.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// The derivative of a discrete step by the Taylor series of a kernel. Its coefficients are computed in dual numbers,
/// for eight directions at once, one in each lane (SystemFunctions::series_next_along).
///
/// Tangents are (δq, δp), canonical. Parameters are those of the kernel, then its inputs, which vary by a constant
/// through the step; both in the order of their names.
class SeriesTangent {
 public:
  /// Whether a kernel has the functions for this.
  static bool is_had_of(const SystemTable& table) { return table.of_8.series_next_along != nullptr; }

  /// `model` has such a kernel; `order` is that of the steps.
  SeriesTangent(const SystemModel& model, int order)
      : model_(model),
        order_(static_cast<std::size_t>(order)),
        rows_(2 * model.coordinates()),
        start_(rows_),
        inputs_(order_ * model.inputs() + 1),
        parameters_(static_cast<std::size_t>(ParameterSlopes::count_of(model)) + 1),
        varied_(parameters_.rows()),
        numbers_(5),
        state_((order_ + 1) * rows_),
        d_state_((rows_ + width - 1) / width, state_),
        d_others_(state_),
        kept_(static_cast<std::size_t>(info().kept) + 1),
        d_kept_(kept_),
        operands_(order_ * static_cast<std::size_t>(info().operands) + 1),
        d_operands_(operands_),
        sums_(static_cast<std::size_t>(info().sums) + 1),
        d_sums_(sums_),
        by_state_(size(), size()) {
    for (std::size_t k = 0; k < model.parameters().size(); ++k) {
      std::fill_n(parameters_[k], width, model.parameters()[k]);
    }
  }

  Eigen::Index size() const { return static_cast<Eigen::Index>(rows_); }  ///< rows of a tangent
  /// Rows of a variation of the parameters.
  Eigen::Index parameters() const { return static_cast<Eigen::Index>(parameters_.rows()) - 1; }

  /// Differentiates the series about a state, q, then p, or v where the series has no momenta. `inputs` are the
  /// coefficients of the inputs, order by order, in the unit of time.
  void expand(double time, double unit, const double* state, const double* inputs) {
    time_ = time;
    unit_ = unit;
    std::copy_n(state, rows_, start_.begin());
    for (std::size_t k = 0; k + 1 < inputs_.rows(); ++k) std::fill_n(inputs_[k], width, inputs[k]);
    std::fill_n(varied_[0], varied_.rows() * width, 0.0);
    for (std::size_t first = 0; first < rows_; first += width) {
      PackRows<width>& changes = d_state_[first / width];
      std::fill_n(changes[0], rows_ * width, 0.0);
      for (std::size_t lane = 0; lane < std::min(width, rows_ - first); ++lane) changes[first + lane][lane] = 1;
      differentiate(changes);
    }
  }

  /// The log₂ of the radius of convergence in units of time, by the last `terms` terms of the derivatives. It limits
  /// steps like that of the motion, since tangents may change where the motion does not.
  double log_radius(std::size_t terms) const {
    const std::size_t last = order_ - (info().has_momenta ? 1 : 0);
    double log_radius = detail::largest_log_radius;
    for (std::size_t k = last - terms + 1; k <= last; ++k) {
      const double term = size_of_term(k);
      if (!std::isfinite(term)) return -std::numeric_limits<double>::infinity();
      log_radius = std::min(log_radius, -std::log2(std::max(term, detail::almost_zero)) / static_cast<double>(k));
    }
    return log_radius;
  }

  /// Keeps the derivative of a step of h that was taken by this series, from `begin` to `end`.
  void keep(double h, Motion begin, Motion end) {
    h_ = h;
    begin_ = std::move(begin);
    end_ = std::move(end);
    by_parameters_.resize(0, 0);
    for (Eigen::Index column = 0; column < size(); ++column) {
      const auto lane = static_cast<std::size_t>(column);
      by_state_.col(column) = end_of(d_state_[lane / width], lane % width);
    }
    if (info().has_momenta) return;
    const LagrangianVariation from(model_, begin_), to(model_, end_);
    Directions<> rates;
    from.rates(Directions<>::Identity(size(), size()), rates);
    to.tangents(by_state_ * rates, by_state_);
  }
  /// Sets the derivative to the identity: no step was taken yet.
  void forget() {
    by_state_.setIdentity();
    by_parameters_.setZero(size(), parameters());
  }

  /// Replaces tangents at the start of the step, (size x count) row by row, by those at its end. `varied`, (parameters
  /// x count), are variations of the parameters, or null.
  void push(double* tangents, int count, const double* varied) {
    Eigen::Map<Directions<>> given(tangents, size(), count);
    given = (by_state_ * given).eval();
    if (varied != nullptr) given += by_parameters() * Eigen::Map<const Directions<>>(varied, parameters(), count);
  }

  /// The transpose: replaces gradients with respect to the end of the step, (size x count), by those with respect to
  /// its start, and adds those with respect to the parameters to (parameters x count), unless that is null.
  void pull(double* gradients, int count, double* varied) {
    Eigen::Map<Directions<>> given(gradients, size(), count);
    if (varied != nullptr) {
      Eigen::Map<Directions<>>(varied, parameters(), count) += by_parameters().transpose() * given;
    }
    given = (by_state_.transpose() * given).eval();
  }

 private:
  static constexpr std::size_t width = 8;

  const SeriesInfo& info() const { return model_.info().series; }

  /// Derivatives with respect to parameters, computed when first asked for.
  const Directions<>& by_parameters() {
    if (by_parameters_.rows() == size()) return by_parameters_;  // there may be no parameters
    const Directions<> alone = Directions<>::Identity(parameters(), parameters());
    Directions<> moved = Directions<>::Zero(size(), parameters());
    if (!info().has_momenta) LagrangianVariation(model_, begin_).rates(Directions<>(moved), moved, alone);
    by_parameters_.resize(size(), parameters());
    for (Eigen::Index first = 0; first < parameters(); first += static_cast<Eigen::Index>(width)) {
      const Eigen::Index lanes = std::min(static_cast<Eigen::Index>(width), parameters() - first);
      std::fill_n(d_others_[0], rows_ * width, 0.0);
      std::fill_n(varied_[0], varied_.rows() * width, 0.0);
      for (Eigen::Index lane = 0; lane < lanes; ++lane) {
        for (Eigen::Index row = 0; row < size(); ++row) d_others_[row][lane] = moved(row, first + lane);
        varied_[first + lane][lane] = 1;
      }
      differentiate(d_others_);
      for (Eigen::Index lane = 0; lane < lanes; ++lane) {
        by_parameters_.col(first + lane) = end_of(d_others_, static_cast<std::size_t>(lane));
      }
    }
    if (!info().has_momenta) {
      LagrangianVariation(model_, end_).tangents(Directions<>(by_parameters_), by_parameters_, alone);
    }
    return by_parameters_;
  }

  /// The value of a direction at the end of the step.
  Eigen::VectorXd end_of(const PackRows<width>& changes, std::size_t lane) const {
    Eigen::VectorXd end(size());
    const double tau = h_ / unit_;
    for (std::size_t row = 0; row < rows_; ++row) {
      double sum = 0;
      for (std::size_t k = order_ + 1; k-- > 0;) sum = sum * tau + changes[k * rows_ + row][lane];
      end[static_cast<Eigen::Index>(row)] = sum;
    }
    return end;
  }

  /// Computes all rows of the series and of `changes`, from the first row of `changes`.
  void differentiate(PackRows<width>& changes) {
    const SystemFunctions& functions = model_.table().of_8;
    for (std::size_t row = 0; row < rows_; ++row) std::fill_n(state_[row], width, start_[row]);
    std::fill_n(numbers_[0], width, time_);
    const auto at = [&](std::size_t order) {
      return Conditions{model_.table().context, parameters_[0], numbers_[0], inputs_[order * model_.inputs()]};
    };
    std::fill_n(numbers_[1], width, unit_);
    functions.series_start_along(at(0), numbers_[1], state_[0], varied_[0], varied_[model_.parameters().size()],
                                 changes[0], state_[rows_], kept_[0], changes[rows_], d_kept_[0]);
    const auto held = static_cast<std::size_t>(info().operands);
    for (std::size_t k = 1; k < order_; ++k) {
      const auto order = static_cast<double>(k);
      const double of_order[] = {order, 1 / order, unit_ / (order + 1), k == 1 ? unit_ : 0};
      for (std::size_t i = 0; i < 4; ++i) std::fill_n(numbers_[1 + i], width, of_order[i]);
      detail::sums_along(operands_[0], d_operands_[0], model_.info().series_sums, held * width, k, sums_[0],
                         d_sums_[0]);
      functions.series_next_along(at(k), numbers_[1], state_[k * rows_], kept_[0], sums_[0], changes[k * rows_],
                                  d_kept_[0], d_sums_[0], state_[(k + 1) * rows_], operands_[k * held],
                                  changes[(k + 1) * rows_], d_operands_[k * held]);
    }
  }

  /// The largest entry of order k in all directions. Rates, or momenta, are scaled by what they move within a unit of
  /// time. Not finite if one entry is not.
  double size_of_term(std::size_t k) const {
    const std::size_t n = rows_ / 2;
    const auto entry = [&](std::size_t order, std::size_t row, std::size_t column) {
      return d_state_[column / width][order * rows_ + row][column % width];
    };
    const auto scale = [&](std::size_t row) { return row < n ? 1 : std::abs(entry(1, row - n, row)); };
    double largest = 0;
    for (std::size_t column = 0; column < rows_; ++column) {
      for (std::size_t row = 0; row < rows_; ++row) {
        const double term = entry(k, row, column) * scale(row) / scale(column);
        if (!std::isfinite(term)) return term;
        largest = std::max(largest, std::abs(term));
      }
    }
    return largest;
  }

  SystemModel model_;
  std::size_t order_, rows_;
  double time_ = 0, h_ = 0, unit_ = 1;
  std::vector<double> start_;
  Motion begin_, end_;
  PackRows<width> inputs_, parameters_, varied_, numbers_, state_;
  std::vector<PackRows<width>> d_state_;  // with respect to each number of the state, eight in the lanes of each
  PackRows<width> d_others_, kept_, d_kept_, operands_, d_operands_, sums_, d_sums_;
  Directions<> by_state_, by_parameters_;  // of the step
};

}  // namespace pendula
