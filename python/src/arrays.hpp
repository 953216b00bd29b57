#pragma once

#include <Python.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <Eigen/Core>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <pendula/system/motion.hpp>
#include <utility>
#include <vector>

/// Arrays of numbers that cross between C++ and Python.
namespace pendula::python {

namespace nb = nanobind;

using Array = nb::ndarray<nb::numpy, double, nb::ndim<2>>;
using Vector = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

/// An array of numbers, which Python owns from now on.
template <class ArrayType, class Number>
ArrayType owned(std::vector<Number> numbers, std::initializer_list<std::size_t> shape) {
  auto kept = std::make_unique<std::vector<Number>>(std::move(numbers));
  Number* const data = kept->data();
  nb::capsule owner(kept.release(), [](void* made) noexcept { delete static_cast<std::vector<Number>*>(made); });
  return ArrayType(data, shape, owner);
}
inline Vector vector_of(std::vector<double> numbers) {
  const std::size_t size = numbers.size();
  return owned<Vector>(std::move(numbers), {size});
}
inline Vector vector_of(const Eigen::VectorXd& numbers) {
  return vector_of(std::vector<double>(numbers.data(), numbers.data() + numbers.size()));
}
/// (rows x columns)
inline Array array_of(std::vector<double> numbers, std::size_t columns) {
  const std::size_t rows = columns == 0 ? 0 : numbers.size() / columns;
  return owned<Array>(std::move(numbers), {rows, columns});
}
inline Array array_of(const Eigen::MatrixXd& matrix) {
  const auto rows = static_cast<std::size_t>(matrix.rows()), columns = static_cast<std::size_t>(matrix.cols());
  std::vector<double> numbers(rows * columns);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(numbers.data(), matrix.rows(), matrix.cols()) = matrix;
  return owned<Array>(std::move(numbers), {rows, columns});
}

/// Coordinates, then their rates.
inline std::vector<double> state_of(const Motion& motion) {
  std::vector<double> state(motion.q.data(), motion.q.data() + motion.q.size());
  state.insert(state.end(), motion.v.data(), motion.v.data() + motion.v.size());
  return state;
}

}  // namespace pendula::python
