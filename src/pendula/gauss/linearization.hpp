#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <pendula/numeric/directions.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace pendula {

/// A solver of stage equations that gives the derivative of a step, before the step is accepted.
template <class S>
concept LinearizingSolver = requires(S solver, const S& fixed, typename S::Tangent& tangent) {
  { fixed.make_tangent() } -> std::same_as<typename S::Tangent>;
  solver.linearize(tangent);
};

/// The derivative of one discrete step; for a step that was taken in parts, the product of theirs. Its coordinates and
/// parameters are those of the solver's tangent (chain_tangent.hpp, lagrangian_tangent.hpp).
///
/// For a run, push tangents through its steps first to last, or pull gradients last to first: gradients need a copy of
/// each step's linearization.
template <class Tangent>
class Linearization {
 public:
  using Real = typename Tangent::Real;

  explicit Linearization(const Tangent& tangent) : parts_{tangent} {}

  int size() const { return parts_.front().size(); }              ///< rows of a tangent
  int parameters() const { return parts_.front().parameters(); }  ///< rows of a variation of the parameters

  /// Replaces tangents at the start of the step, (size x any), by those at its end. Throws std::invalid_argument on
  /// another number of rows.
  void push(Directions<Real>& tangents) {
    require_rows("tangents", tangents.rows(), size());
    push(tangents.data(), columns(tangents), nullptr);
  }

  /// The same where parameters vary, too, (parameters x as many).
  void push(Directions<Real>& tangents, const Directions<Real>& parameters) {
    require_rows("tangents", tangents.rows(), size());
    require_alike(parameters, tangents.cols());
    push(tangents.data(), columns(tangents), parameters.data());
  }

  /// The same with plain numbers, row by row, of `count` columns. `parameters` is null where they do not vary.
  void push(Real* tangents, int count, const Real* parameters) {
    for (std::size_t k = 0; k < used_; ++k) {
      parameters == nullptr ? parts_[k].push(tangents, count) : parts_[k].push(tangents, count, parameters);
    }
  }

  /// The transpose: replaces gradients with respect to the end of the step, (size x any), by those with respect to its
  /// start.
  void pull(Directions<Real>& gradients) {
    require_rows("gradients", gradients.rows(), size());
    pull(gradients.data(), columns(gradients), nullptr);
  }

  /// Adds the gradients with respect to the parameters to `parameters`, (parameters x as many).
  void pull(Directions<Real>& gradients, Directions<Real>& parameters) {
    require_rows("gradients", gradients.rows(), size());
    require_alike(parameters, gradients.cols());
    pull(gradients.data(), columns(gradients), parameters.data());
  }

  /// The same with plain numbers. `parameters` is null where no gradients with respect to them are asked for.
  void pull(Real* gradients, int count, Real* parameters) {
    for (std::size_t k = used_; k-- > 0;) {
      parameters == nullptr ? parts_[k].pull(gradients, count) : parts_[k].pull(gradients, count, parameters);
    }
  }

  /// The whole matrix, (size x size).
  Directions<Real> matrix() {
    Directions<Real> matrix = Directions<Real>::Identity(size(), size());
    push(matrix);
    return matrix;
  }

  /// Begins a step that has no parts yet: the identity.
  void clear() { used_ = 0; }
  /// Adds a part, which the caller fills.
  Tangent& next() {
    if (used_ == parts_.size()) parts_.push_back(parts_.front());
    return parts_[used_++];
  }

 private:
  static int columns(const Directions<Real>& directions) { return static_cast<int>(directions.cols()); }
  static void require_rows(const char* what, Eigen::Index got, int expected) {
    if (got == expected) return;
    throw std::invalid_argument(std::string("linearization: ") + what + ": expected " + std::to_string(expected) +
                                " rows, got " + std::to_string(got));
  }
  void require_alike(const Directions<Real>& varied, Eigen::Index columns) const {
    require_rows("parameters", varied.rows(), parameters());
    if (varied.cols() == columns) return;
    throw std::invalid_argument("linearization: parameters: expected " + std::to_string(columns) + " columns, got " +
                                std::to_string(varied.cols()));
  }

  std::vector<Tangent> parts_;
  std::size_t used_ = 0;
};

namespace detail {

template <class Solver>
struct LinearizationOf {
  using type = char;  // a placeholder, for solvers without a tangent
};
template <LinearizingSolver Solver>
struct LinearizationOf<Solver> {
  using type = Linearization<typename Solver::Tangent>;
};

}  // namespace detail

}  // namespace pendula
