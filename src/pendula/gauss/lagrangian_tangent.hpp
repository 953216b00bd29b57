#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <pendula/gauss/lagrangian_direction.hpp>
#include <pendula/gauss/lagrangian_jacobians.hpp>
#include <pendula/gauss/lagrangian_stages.hpp>
#include <pendula/gauss/stage_system.hpp>
#include <pendula/system/constraint_tangents.hpp>
#include <pendula/system/parameter_slopes.hpp>
#include <pendula/system/system_model.hpp>
#include <vector>

namespace pendula {

/// The derivative of one Gauss step of any system in momentum form, exactly that of the discrete step: the stage
/// equations of lagrangian_newton.hpp, linearised where they are solved (implicit function theorem).
///
/// Coordinates of the tangent space are (δq, δp), canonical. Parameters are those of the kernel, then its inputs, which
/// are varied by what is constant through the step; both in the order of their names.
///
/// With C the derivative of the end of the step by V, and A Newton's matrix, E = −C A⁻¹ is its derivative by the
/// residuals of the stages; all else follows by products. A few tangents take less time each for itself, by a fixed
/// point on its stages, which are all in the lanes of SIMD registers (lagrangian_direction.hpp).
template <int Width>
class LagrangianTangent {
 public:
  using Real = double;
  using Stages = LagrangianStages<Width, MomentumForm>;

  explicit LagrangianTangent(const Stages& stages)
      : columns_(stages.columns()),
        jacobians_(stages.count()),
        direction_(stages.count()),
        system_(stages.count() + stages.info().constraints.size(), stages.stages()),
        of_residuals_(system_.matrix.rows(), 2 * eigen_count()),
        residuals_(of_residuals_.rows(), 0),
        state_(2 * eigen_count(), 2 * eigen_count()),
        slopes_(stages.model()),
        of_parameters_(2 * eigen_count(), slopes_.p.cols()),
        from_(static_cast<std::size_t>(size()) * together),
        to_(from_) {
    if (!stages.is_constrained()) return;
    begin_.emplace(stages.model());
    end_.emplace(stages.model());
    const Eigen::Index of = std::ssize(stages.info().constraints), s = stages.stages();
    nodes_.emplace();
    nodes_->impulses.resize(of, s);
    nodes_->places.resize(eigen_count(), s + 1);
    nodes_->push.resize(s, s);
    nodes_->reach.resize(s, s);
    nodes_->times.resize(system_.stages() + 1);
    for (Eigen::Index i = 0; i < of; ++i) {
      if (stages.info().constraint_is_of_rates[static_cast<std::size_t>(i)]) nodes_->of_rates.push_back(i);
    }
  }

  int size() const { return 2 * static_cast<int>(count()); }
  int parameters() const { return static_cast<int>(slopes_.p.cols()); }

  /// The derivative of the step whose stages are found and that was not accepted yet.
  void linearize(const Stages& stages) {
    columns_.prepare(stages.columns().h());
    jacobians_.evaluate(stages);
    direction_.linearize(stages);
    for (int i = 0; i < columns_.stages(); ++i) times_[static_cast<std::size_t>(i)] = stages.time_of(i);
    has_state_ = has_parameters_ = false;
    if (nodes_) find_constrained(stages);
  }

  /// Replaces tangents at the start of the step, (size x count) row by row, by those at its end.
  void push(double* tangents, int count) {
    const bool few = !has_state_ && count <= static_cast<int>(this->count());
    if (few && direction_.push(jacobians_, columns_, tangents, count)) return;
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
  using L = typename Stages::L;

  std::size_t count() const { return jacobians_.count(); }
  static Eigen::Index index(std::size_t k) { return static_cast<Eigen::Index>(k); }
  Eigen::Index eigen_count() const { return index(count()); }

  // Writes the lanes of the stages into a column of numbers, in which the stages of coordinate `row` are adjacent.
  template <class Matrix>
  void write(const L& lanes, Matrix& to, std::size_t row, Eigen::Index column) const {
    alignas(pack_alignment) typename Stages::Stored numbers;
    lanes.store(numbers);
    for (std::size_t i = 0; i < system_.stages(); ++i) to(system_.at(row, i), column) = numbers[i];
  }
  double total(const L& lanes) const {
    alignas(pack_alignment) typename Stages::Stored numbers;
    lanes.store(numbers);
    double total = 0;
    for (std::size_t i = 0; i < system_.stages(); ++i) total += numbers[i];
    return total;
  }

  // With constraints, the derivative of the step on them: its start and its end bring tangents there. What constraints
  // know of the step is gone when it is accepted.
  void find_constrained(const Stages& stages) {
    constraints_ = &stages.constraints();
    const auto [begin, end] = stages.ends();
    nodes_->see(*constraints_, begin.q);
    begin_->begin(begin.time, begin.q.data(), begin.v.data());
    end_->end(end.time, end.q.data(), end.v.data(), constraints_->impulses_at_end().data());
    curvature_at_start_ = begin_->curvature(nodes_->impulses.col(0).data());
    find_state();
    between_ = state_;
    state_ = end_->whole() * between_ * begin_->whole();
    constraints_ = nullptr;
  }

  // Done only if more is asked for than a few tangents.
  void find_state() {
    if (has_state_) return;
    has_state_ = true;
    find_response();
    const Eigen::Index K = eigen_count();
    residuals_.resize(of_residuals_.rows(), K);
    state_.setIdentity();
    for (std::size_t row = 0; row < count(); ++row) {
      for (std::size_t column = 0; column < count(); ++column) {
        const L forced = columns_.hb() * jacobians_.f_D_q(row, column);
        L lacks = jacobians_.p_D_q(row, column) - columns_.integral(forced);
        state_(K + index(row), index(column)) += total(forced);
        if (constraints_ != nullptr) {
          const auto more = constraints_->pushed_by_start(row, column, curvature_at_start_(index(row), index(column)));
          state_(K + index(row), index(column)) += more.together;
          lacks = lacks - more.pushed;
        }
        write(lacks, residuals_, row, index(column));
      }
      for (std::size_t i = 0; i < system_.stages(); ++i) {
        state_.col(K + index(row)) -= of_residuals_.row(system_.at(row, i)).transpose();
      }
    }
    for (std::size_t i = 0; constraints_ != nullptr && i < constraints_->count(); ++i) {
      for (std::size_t column = 0; column < count(); ++column) {
        write(constraints_->lacking_by_start(columns_, i, column), residuals_, count() + i, index(column));
      }
    }
    state_.leftCols(K) += of_residuals_.transpose().lazyProduct(residuals_);
  }

  // Eᵀ, from Aᵀ Eᵀ = −Cᵀ: the rows of a stage are the derivatives of (q, p) at the end by the residual of that stage.
  void find_response() {
    const Eigen::Index K = eigen_count();
    of_residuals_.setZero();
    for (std::size_t column = 0; column < count(); ++column) {
      for (std::size_t k = 0; k < system_.stages(); ++k) {
        const Eigen::Index unknown = system_.at(column, k);
        of_residuals_(unknown, index(column)) = -columns_.hb(k);
        for (std::size_t row = 0; row < count(); ++row) {
          alignas(pack_alignment) typename Stages::Stored forced;
          jacobians_.f_D_v(row, column).store(forced);
          const L through_q = (columns_.hb() * columns_.ha(k)) * jacobians_.f_D_q(row, column);
          of_residuals_(unknown, K + index(row)) = -(columns_.hb(k) * forced[k] + total(through_q));
          L derivative = jacobians_.derivative(columns_, row, column, k);
          if (constraints_ != nullptr) {
            const L hb(columns_.hb(k));
            derivative = derivative - hb * constraints_->pushed_by_increment(row, column, k);
            of_residuals_(unknown, K + index(row)) -=
                columns_.hb(k) * constraints_->pushed_by_increment_together(row, column, k);
          }
          set_derivatives(row, unknown, derivative);
        }
      }
    }
    if (constraints_ != nullptr) find_response_of_constraints();
    system_.solve(of_residuals_.data(), 2 * K);
  }

  // As in lagrangian_newton.hpp.
  void find_response_of_constraints() {
    for (std::size_t i = 0; i < constraints_->count(); ++i) {
      for (std::size_t k = 0; k < system_.stages(); ++k) {
        const Eigen::Index impulse = system_.at(count() + i, k);
        for (std::size_t row = 0; row < count(); ++row) {
          set_derivatives(count() + i, system_.at(row, k),
                          L(columns_.hb(k)) * constraints_->lacking_by(columns_, i, row, k));
          set_derivatives(row, impulse, L(0.0) - constraints_->pushed_by(row, i, k));
          of_residuals_(impulse, eigen_count() + index(row)) = -constraints_->slope(k, i, row);
        }
        for (std::size_t j = 0; j < constraints_->count(); ++j) {
          const L soft = L(i == j ? constraints_->softness(i) : 0.0) * columns_.unit(k);
          set_derivatives(count() + j, impulse, soft);
        }
      }
    }
  }

  // The derivatives of the residuals `row` at all stages by an unknown; the matrix is transposed.
  void set_derivatives(std::size_t row, Eigen::Index unknown, const L& lanes) {
    alignas(pack_alignment) typename Stages::Stored numbers;
    lanes.store(numbers);
    for (std::size_t i = 0; i < system_.stages(); ++i) system_.matrix(unknown, system_.at(row, i)) = numbers[i];
  }

  // Done only if derivatives by parameters are asked for.
  void find_parameters() {
    if (has_parameters_) return;
    find_state();
    has_parameters_ = true;
    const Eigen::Index K = eigen_count(), stages = index(system_.stages());
    std::vector<Eigen::MatrixXd> momenta, forces;
    for (std::size_t i = 0; i < system_.stages(); ++i) {
      slopes_.evaluate(times_[i], jacobians_.q() + i, jacobians_.v() + i, static_cast<std::size_t>(Width));
      momenta.push_back(slopes_.p);
      forces.push_back(slopes_.f);
    }
    of_parameters_.setZero();
    residuals_.resize(of_residuals_.rows(), of_parameters_.cols());
    for (Eigen::Index i = 0; i < stages; ++i) {
      const auto at = static_cast<std::size_t>(i);
      of_parameters_.bottomRows(K) += columns_.hb(at) * forces[at];
      for (std::size_t j = 0; j < system_.stages(); ++j) momenta[at] -= columns_.ha(at, j) * forces[j];
      for (std::size_t row = 0; row < count(); ++row) {
        residuals_.row(system_.at(row, at)) = momenta[at].row(index(row));
      }
    }
    if (nodes_) add_constraints_by_parameters();
    of_parameters_ += of_residuals_.transpose().lazyProduct(residuals_);
    if (!nodes_) return;
    of_parameters_ += between_ * begin_->by_parameters();
    of_parameters_ = (end_->whole() * of_parameters_).eval();
    of_parameters_ += end_->by_parameters();
  }

  // What constraints lack at the nodes 1 … s, and push at the nodes 0 … s − 1.
  void add_constraints_by_parameters() {
    const Eigen::Index K = eigen_count(), stages = index(system_.stages());
    for (Eigen::Index node = 0; node <= stages; ++node) {
      const double* const place = nodes_->places.col(node).data();
      slopes_.evaluate_constraints(nodes_->times[static_cast<std::size_t>(node)], place, place);
      for (Eigen::Index i = 0; node > 0 && i < slopes_.g.rows(); ++i) lacking_at(i, node - 1) = slopes_.g.row(i);
      if (node == stages) break;
      const Eigen::MatrixXd turned = slopes_.turned(nodes_->impulses.col(node));
      of_parameters_.bottomRows(K) += turned;
      for (Eigen::Index i = 0; i < stages; ++i) {
        for (std::size_t row = 0; row < count(); ++row) {
          residuals_.row(system_.at(row, static_cast<std::size_t>(i))) -=
              nodes_->push(i, node) * turned.row(index(row));
        }
      }
    }
    add_constraints_of_rates_by_parameters();
  }
  void add_constraints_of_rates_by_parameters() {
    if (nodes_->of_rates.empty()) return;
    for (std::size_t j = 0; j < system_.stages(); ++j) {
      slopes_.evaluate_constraints(times_[j], jacobians_.q() + j, jacobians_.v() + j, static_cast<std::size_t>(Width));
      for (const Eigen::Index i : nodes_->of_rates) {
        for (Eigen::Index node = 0; node < index(system_.stages()); ++node) {
          lacking_at(i, node) += nodes_->reach(node, index(j)) * columns_.hb(j) * slopes_.g_dot.row(i);
        }
      }
    }
  }
  auto lacking_at(Eigen::Index constraint, Eigen::Index stage) {
    return residuals_.row(system_.at(count() + static_cast<std::size_t>(constraint), static_cast<std::size_t>(stage)));
  }

  // y += A x, row by row. A row has one number for each direction.
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
  void replace(double* x, int count, const A& a) {
    for (int begin = 0; begin < count; begin += together) {
      const int columns = std::min(together, count - begin);
      std::fill(to_.begin(), to_.end(), 0.0);
      for (int i = 0; i < size(); ++i) std::copy_n(x + i * count + begin, columns, from_.data() + i * columns);
      add(to_.data(), columns, a, from_.data());
      for (int i = 0; i < size(); ++i) std::copy_n(to_.data() + i * columns, columns, x + i * count + begin);
    }
  }

  static constexpr int together = 16;  // columns

  typename Stages::Columns columns_;
  LagrangianJacobians<Width> jacobians_;
  LagrangianDirection<Width> direction_;
  detail::StageSystem system_;
  Eigen::MatrixXd of_residuals_, residuals_;
  Eigen::MatrixXd state_;
  ParameterSlopes slopes_;
  Eigen::MatrixXd of_parameters_;
  std::vector<double> from_, to_;  // workspace
  std::array<double, static_cast<std::size_t>(Width)> times_{};
  bool has_state_ = false;
  bool has_parameters_ = false;

  /// Constraints at the nodes of the step: impulses (constraints x s) at 0 … s − 1, coordinates and times at 0 … s;
  /// what a push at each node adds to momenta at the stages (s x s); how far stages reach to the nodes 1 … s (s x s).
  struct Nodes {
    Eigen::MatrixXd impulses, places, push, reach;
    std::vector<double> times;
    std::vector<Eigen::Index> of_rates;  // which constraints are

    void see(const StageConstraints<Width>& constraints, const Eigen::VectorXd& start) {
      const Eigen::Index stages = push.cols();
      for (Eigen::Index node = 0; node <= stages; ++node) {
        const auto at = static_cast<std::size_t>(node);
        times[at] = constraints.time_of(at);
        for (Eigen::Index k = 0; k < places.rows(); ++k) {
          places(k, node) = node == 0 ? start[k] : constraints.place(static_cast<std::size_t>(k), at);
        }
        if (node == stages) break;
        for (Eigen::Index i = 0; i < impulses.rows(); ++i) {
          impulses(i, node) = constraints.impulse(static_cast<std::size_t>(i), at);
        }
        alignas(pack_alignment) typename Stages::Stored added;
        constraints.push(at).store(added);
        for (Eigen::Index i = 0; i < stages; ++i) {
          push(i, node) = added[i];
          reach(node, i) = constraints.reach(static_cast<std::size_t>(i), at + 1);
        }
      }
    }
  };
  std::optional<ConstraintTangents> begin_, end_;
  std::optional<Nodes> nodes_;
  const StageConstraints<Width>* constraints_ = nullptr;  // while linearize runs
  Directions<> curvature_at_start_;
  Eigen::MatrixXd between_;  // the derivative of the step without what its ends do
};

}  // namespace pendula
