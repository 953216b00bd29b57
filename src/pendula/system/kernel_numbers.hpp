#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/numbers_of_states.hpp>
#include <pendula/system/system.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula::detail {

/// Numbers of W states of the generated kernel S, as they cross between rows in memory and its functions.
template <System S, int W>
class KernelNumbers : protected NumbersOfStates<W> {
 protected:
  using typename NumbersOfStates<W>::L;
  using NumbersOfStates<W>::load, NumbersOfStates<W>::store;
  static constexpr auto width = static_cast<std::size_t>(W);
  template <class Number>
  using Vector = typename S::template Vector<Number>;
  template <class Number>
  using Parameters = typename S::template Parameters<Number>;
  template <class Number>
  using Inputs = typename S::template Inputs<Number>;

  // Rows of W numbers, without and with their derivatives.
  struct Rows {
    const double* from;
    L operator[](std::size_t k) const { return load(from + k * W); }
  };
  struct VariedRows {
    const double *from, *slopes;
    Dual<L> operator[](std::size_t k) const { return {load(from + k * W), load(slopes + k * W)}; }
  };

  // Inlined, so that compilers see which numbers a function uses, and read no others.
  template <class Number, class From>
  [[gnu::always_inline]] static Parameters<Number> read_parameters(const From& from, const Conditions& at) {
    Parameters<Number> parameters;
    S::template read_parameters<Number>(from, parameters);
    if constexpr (holds_time<S>) parameters.time = Number(load(at.times));
    return parameters;
  }
  [[gnu::always_inline]] static Parameters<L> parameters(const Conditions& at) {
    return read_parameters<L>(Rows{at.parameters}, at);
  }
  template <class Matrix, class From>
  [[gnu::always_inline]] static Matrix read(const From& from) {
    Matrix numbers;
    for (std::size_t k = 0; k < static_cast<std::size_t>(Matrix::SizeAtCompileTime); ++k) numbers.data()[k] = from[k];
    return numbers;
  }
  [[gnu::always_inline]] static Inputs<L> inputs(const Conditions& at) { return read<Inputs<L>>(Rows{at.inputs}); }
  [[gnu::always_inline]] static Vector<L> vector(const double* from) { return read<Vector<L>>(Rows{from}); }

  template <class Matrix>
  [[gnu::always_inline]] static void write(const Matrix& numbers, double* to) {
    for (Eigen::Index i = 0; i < numbers.rows(); ++i) {
      for (Eigen::Index j = 0; j < numbers.cols(); ++j, to += W) store(numbers(i, j), to);
    }
  }
  template <class Matrix>
  [[gnu::always_inline]] static void write_columns(const Matrix& numbers, double* to) {
    for (Eigen::Index k = 0; k < numbers.size(); ++k) store(numbers.data()[k], to + k * W);
  }
};

}  // namespace pendula::detail
