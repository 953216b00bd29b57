#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <pendula/gauss/lagrangian_direction.hpp>
#include <pendula/gauss/lagrangian_jacobians.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/linear_system.hpp>
#include <pendula/system/system_model.hpp>

namespace pendula {

/// What a system's momenta and forces change by where its parameters and inputs vary, exactly: its kernel in dual
/// numbers. Variations are numbered as parameter_names and then input_names are.
template <System S>
class ParameterSlopes {
 public:
  using Vector = typename S::template Vector<double>;
  static constexpr int count = parameter_count<S>() + static_cast<int>(S::template Inputs<double>::SizeAtCompileTime);
  /// One column a parameter or input.
  using Matrix = Eigen::Matrix<double, S::coordinates, count>;

  Matrix p, f;  ///< ∂p/∂θ, ∂f/∂θ at given q and v

  void evaluate(const SystemModel<S>& model, double time, const Vector& q, const Vector& v) {
    typename S::template Parameters<Number> varied;
    S::cast_parameters(model.parameters(time), varied);
    std::array<Number*, static_cast<std::size_t>(count)> places{};
    S::parameter_places(varied, places.data());
    for (std::size_t k = 0; k < given; ++k) places[k]->slopes[k] = 1;
    const auto inputs = model.inputs(time);
    typename S::template Inputs<Number> driven;
    for (Eigen::Index k = 0; k < inputs.size(); ++k) {
      driven.data()[k] = Number(inputs.data()[k]);
      driven.data()[k].slopes[given + static_cast<std::size_t>(k)] = 1;
    }
    typename S::template Vector<Number> at, rate, momentum, force;
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      at[k] = Number(q[k]);
      rate[k] = Number(v[k]);
    }
    S::momentum_form(varied, at, rate, driven, momentum, force);
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      for (Eigen::Index j = 0; j < count; ++j) {
        p(k, j) = momentum[k].slopes[static_cast<std::size_t>(j)];
        f(k, j) = force[k].slopes[static_cast<std::size_t>(j)];
      }
    }
  }

 private:
  using Number = Dual<count>;
  static constexpr auto given = static_cast<std::size_t>(parameter_count<S>());
};

/// The derivative of one Gauss step of any system in momentum form, exactly that of the discrete step: the stage
/// equations of lagrangian_newton.hpp, linearised where they are solved (implicit function theorem).
///
/// Coordinates of the tangent space are (δq, δp), canonical. Parameters are those of the kernel, then its inputs, which
/// are varied by what is constant through the step; both in the order of their names.
///
/// With C what the end of the step changes by with V, and A Newton's matrix, E = −C A⁻¹ is what it changes by with the
/// residuals of the stages: everything else follows by products. A few tangents take less by themselves, each by a
/// fixed point on what the stages of it are, all of them in the lanes of SIMD registers (lagrangian_direction.hpp).
template <System S, int Width>
class LagrangianTangent {
 public:
  using Real = double;
  using Stages = LagrangianStages<S, Width>;

  explicit LagrangianTangent(const Stages& stages)
      : model_(stages.model()),
        columns_(stages.columns()),
        jacobians_(stages.stages()),
        system_(K * stages.stages()),
        of_residuals_(K * stages.stages(), 2 * K) {}

  static constexpr int size() { return 2 * K; }
  static constexpr int parameters() { return ParameterSlopes<S>::count; }

  /// The derivative of the step whose stages are found and that was not accepted yet.
  void linearize(const Stages& stages) {
    columns_.prepare(stages.columns().h(), 0);
    direction_.linearize(stages);
    for (int i = 0; i < columns_.stages(); ++i) times_[index(i)] = stages.time_of(i);
    has_state_ = has_parameters_ = false;
  }

  /// Replaces tangents at the start of the step, (size x count) row by row, by those at its end.
  void push(double* tangents, int count) {
    if (!has_state_ && count <= K && direction_.push(columns_, tangents, count)) return;
    find_state();
    replace(tangents, count, state_);
  }

  /// The same where parameters are varied, too, by (parameters x count).
  void push(double* tangents, int count, const double* parameters) {
    find_parameters();
    replace(tangents, count, state_);
    add(tangents, count, of_parameters_, parameters);
  }

  /// The transpose: replaces gradients with respect to the end of the step, (size x count), by those with respect to
  /// its start.
  void pull(double* gradients, int count) {
    find_state();
    replace(gradients, count, state_.transpose());
  }

  /// Adds those with respect to the parameters, too, to (parameters x count).
  void pull(double* gradients, int count, double* parameters) {
    find_parameters();
    add(parameters, count, of_parameters_.transpose(), gradients);
    replace(gradients, count, state_.transpose());
  }

 private:
  static constexpr int K = S::coordinates;
  using Matrix = typename Stages::Matrix;
  using State = Eigen::Matrix<double, 2 * K, 2 * K>;

  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  double hb(int j) const { return columns_.hb(index(j)); }
  double ha(int i, int j) const { return columns_.ha(index(i), index(j)); }

  // Only where a few tangents are not all that is asked for.
  void find_state() {
    if (has_state_) return;
    has_state_ = true;
    direction_.read(jacobians_);
    find_response();
    state_.setIdentity();
    const int stages = columns_.stages();
    for (int j = 0; j < stages; ++j) state_.template block<K, K>(K, 0) += hb(j) * jacobians_[j].f_D_q;
    for (int i = 0; i < stages; ++i) {
      Matrix of_position = jacobians_[i].p_D_q;
      for (int j = 0; j < stages; ++j) of_position -= ha(i, j) * jacobians_[j].f_D_q;
      const auto response = of_residuals_.template middleRows<K>(K * i);
      state_.template leftCols<K>() += response.transpose().lazyProduct(of_position);
      state_.template rightCols<K>() -= response.transpose();
    }
  }

  // Eᵀ, of Aᵀ Eᵀ = −Cᵀ: rows of stage i are what its residual does to (q, p) at the end.
  void find_response() {
    const int stages = columns_.stages();
    for (int k = 0; k < stages; ++k) {
      Matrix pushed = hb(k) * jacobians_[k].f_D_v;
      for (int j = 0; j < stages; ++j) pushed += (hb(j) * ha(j, k)) * jacobians_[j].f_D_q;
      auto rows = of_residuals_.template middleRows<K>(K * k);
      rows.template leftCols<K>() = -hb(k) * Matrix::Identity();
      rows.template rightCols<K>() = -pushed.transpose();
      for (int i = 0; i < stages; ++i) {
        system_.matrix.template block<K, K>(K * k, K * i) = jacobians_.block(columns_, i, k).transpose();
      }
    }
    system_.solve(of_residuals_.data(), 2 * K);
  }

  // Only where somebody asks.
  void find_parameters() {
    if (has_parameters_) return;
    find_state();
    has_parameters_ = true;
    of_parameters_.setZero();
    const int stages = columns_.stages();
    for (int i = 0; i < stages; ++i) {
      slopes_[index(i)].evaluate(model_, times_[index(i)], jacobians_[i].q, jacobians_[i].v);
      of_parameters_.template bottomRows<K>() += hb(i) * slopes_[index(i)].f;
    }
    for (int i = 0; i < stages; ++i) {
      auto residual = slopes_[index(i)].p;
      for (int j = 0; j < stages; ++j) residual -= ha(i, j) * slopes_[index(j)].f;
      of_parameters_ += of_residuals_.template middleRows<K>(K * i).transpose().lazyProduct(residual);
    }
  }

  // y += A x, row by row: what stands in a row is many directions.
  template <class A>
  static void add(double* y, int count, const A& a, const double* x) {
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      double* const sum = y + i * count;
      for (Eigen::Index j = 0; j < a.cols(); ++j) {
        const double factor = a(i, j);
        const double* const row = x + j * count;
        for (int c = 0; c < count; ++c) sum[c] += factor * row[c];
      }
    }
  }

  template <class A>
  static void replace(double* x, int count, const A& a) {
    for (int begin = 0; begin < count; begin += together) {
      const int columns = std::min(together, count - begin);
      double from[held], to[held] = {};
      for (int i = 0; i < 2 * K; ++i) std::copy_n(x + i * count + begin, columns, from + i * columns);
      add(to, columns, a, from);
      for (int i = 0; i < 2 * K; ++i) std::copy_n(to + i * columns, columns, x + i * count + begin);
    }
  }

  static constexpr int together = 16;  // columns
  static constexpr std::size_t held = static_cast<std::size_t>(2 * K) * together;

  SystemModel<S> model_;
  typename Stages::Columns columns_;
  LagrangianDirection<S, Width> direction_;
  LagrangianJacobians<S, Width> jacobians_;
  LinearSystem system_;
  Eigen::MatrixXd of_residuals_;
  State state_;
  Eigen::Matrix<double, 2 * K, ParameterSlopes<S>::count> of_parameters_;
  std::array<ParameterSlopes<S>, static_cast<std::size_t>(Width)> slopes_;
  std::array<double, static_cast<std::size_t>(Width)> times_{};
  bool has_state_ = false;
  bool has_parameters_ = false;
};

}  // namespace pendula
