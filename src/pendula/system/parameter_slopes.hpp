#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// Exact derivatives of a system's momenta and forces with respect to its parameters, then its inputs, in the order of
/// SystemInfo: by its kernel in dual numbers, several variations at once.
class ParameterSlopes {
 public:
  explicit ParameterSlopes(const SystemModel& model)
      : p(static_cast<Eigen::Index>(model.coordinates()), count_of(model)),
        f(p),
        at_(model),
        varied_(static_cast<std::size_t>(count_of(model)) + 1),
        numbers_(4 * model.coordinates()) {}

  static Eigen::Index count_of(const SystemModel& model) {
    return static_cast<Eigen::Index>(model.parameters().size() + model.inputs());
  }

  Eigen::MatrixXd p, f;  ///< ∂p/∂θ, ∂f/∂θ at given q and v, a column a parameter or input

  /// Computes p and f. q, v: (coordinates) numbers, each `apart` numbers after the one before.
  void evaluate(double time, const double* q, const double* v, std::size_t apart = 1) {
    const auto count = static_cast<std::size_t>(p.rows()), variations = static_cast<std::size_t>(p.cols());
    at_.set_time(time);
    for (std::size_t k = 0; k < count; ++k) {
      std::fill_n(numbers_[k], width, q[k * apart]);
      std::fill_n(numbers_[count + k], width, v[k * apart]);
    }
    for (std::size_t first = 0; first < variations; first += width) {
      const std::size_t here = std::min(width, variations - first);
      std::fill_n(varied_[0], varied_.rows() * width, 0.0);
      for (std::size_t lane = 0; lane < here; ++lane) varied_[first + lane][lane] = 1;
      at_(&SystemFunctions::momentum_form_along, varied_[0], varied_[at_.model().parameters().size()], numbers_[0],
          numbers_[count], numbers_[2 * count], numbers_[3 * count]);
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t lane = 0; lane < here; ++lane) {
          const auto row = static_cast<Eigen::Index>(k), column = static_cast<Eigen::Index>(first + lane);
          p(row, column) = numbers_[2 * count + k][lane];
          f(row, column) = numbers_[3 * count + k][lane];
        }
      }
    }
  }

 private:
  static constexpr std::size_t width = 8;

  SystemAt<8> at_;
  PackRows<width> varied_, numbers_;
};

}  // namespace pendula
