#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// Exact derivatives of a system's momenta and forces, and of its constraints, with respect to its parameters, then its
/// inputs, in the order of SystemInfo: by its kernel in dual numbers, several variations at once.
class ParameterSlopes {
 public:
  explicit ParameterSlopes(const SystemModel& model)
      : p(static_cast<Eigen::Index>(model.coordinates()), count_of(model)),
        f(p),
        g(std::ssize(model.info().constraints), p.cols()),
        g_D_q(g.rows() * p.rows(), p.cols()),
        g_dot(g),
        at_(model),
        varied_(static_cast<std::size_t>(count_of(model)) + 1),
        numbers_(4 * model.coordinates()),
        found_(static_cast<std::size_t>(2 * g.rows() + g_D_q.rows())) {}

  static Eigen::Index count_of(const SystemModel& model) {
    return static_cast<Eigen::Index>(model.parameters().size() + model.inputs());
  }

  Eigen::MatrixXd p, f;             ///< ∂p/∂θ, ∂f/∂θ at given q and v, a column a parameter or input
  Eigen::MatrixXd g, g_D_q, g_dot;  ///< the same of constraints, of ∂g/∂q row by row, and of dg/dt

  /// Computes p and f. Here and below q, v: (coordinates) numbers, each `apart` numbers after the one before.
  void evaluate(double time, const double* q, const double* v, std::size_t apart = 1) {
    const auto count = static_cast<std::size_t>(p.rows());
    vary(time, q, v, apart, [&](auto take) {
      at_(&SystemFunctions::momentum_form_along, varied_[0], varied_[at_.model().parameters().size()], numbers_[0],
          numbers_[count], numbers_[2 * count], numbers_[3 * count]);
      take(p, numbers_, 2 * count);
      take(f, numbers_, 3 * count);
    });
  }

  /// Computes g, g_D_q and g_dot.
  void evaluate_constraints(double time, const double* q, const double* v, std::size_t apart = 1) {
    const auto count = static_cast<std::size_t>(p.rows()), constraints = static_cast<std::size_t>(g.rows());
    vary(time, q, v, apart, [&](auto take) {
      at_(&SystemFunctions::constraints_along, varied_[0], numbers_[0], found_[0], found_[2 * constraints]);
      take(g, found_, 0);
      take(g_D_q, found_, 2 * constraints);
      std::fill_n(numbers_[2 * count], 2 * count * width, 0.0);
      at_(&SystemFunctions::constraint_rates_along, varied_[0], numbers_[2 * count], numbers_[3 * count], numbers_[0],
          numbers_[count], found_[0], found_[constraints]);
      take(g_dot, found_, 0);
    });
  }

  /// Σ_i J_i ∂g_i/∂q for impulses J, by g_D_q.
  Eigen::MatrixXd turned(const Eigen::Ref<const Eigen::VectorXd>& impulses) const {
    Eigen::MatrixXd found = Eigen::MatrixXd::Zero(p.rows(), p.cols());
    for (Eigen::Index i = 0; i < impulses.size(); ++i) {
      found += impulses[i] * g_D_q.middleRows(i * p.rows(), p.rows());
    }
    return found;
  }

 private:
  static constexpr std::size_t width = 8;
  using Rows = PackRows<width>;

  // For several variations at once calls find(take), where take(slopes, rows, first) reads these rows.
  template <class Find>
  void vary(double time, const double* q, const double* v, std::size_t apart, Find find) {
    const auto count = static_cast<std::size_t>(p.rows()), variations = static_cast<std::size_t>(p.cols());
    at_.set_time(time);
    for (std::size_t k = 0; k < count; ++k) {
      std::fill_n(numbers_[k], width, q[k * apart]);
      std::fill_n(numbers_[count + k], width, v[k * apart]);
    }
    for (std::size_t begin = 0; begin < variations; begin += width) {
      const std::size_t here = std::min(width, variations - begin);
      std::fill_n(varied_[0], varied_.rows() * width, 0.0);
      for (std::size_t lane = 0; lane < here; ++lane) varied_[begin + lane][lane] = 1;
      find([&](Eigen::MatrixXd& slopes, const Rows& rows, std::size_t first) {
        for (Eigen::Index row = 0; row < slopes.rows(); ++row) {
          for (std::size_t lane = 0; lane < here; ++lane) {
            slopes(row, static_cast<Eigen::Index>(begin + lane)) = rows[first + static_cast<std::size_t>(row)][lane];
          }
        }
      });
    }
  }

  SystemAt<8> at_;
  Rows varied_, numbers_, found_;
};

}  // namespace pendula
