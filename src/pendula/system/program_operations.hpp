#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/shared_operations.hpp>
#include <string_view>

namespace pendula {

/// Calls row(name, function) for each operation on numbers that a kernel's program may have, in the order of their
/// codes. operation_names has what follows them.
template <class Row>
constexpr void program_operations(Row row) {
  using detail::sum_of_product, std::cbrt;
  shared_operations([&](std::string_view name, std::string_view, auto function) { row(name, function); });
  row("multiply_add", []<class L>(const L& x, const L& y, const L& z) { return sum_of_product<L>(x, y, z); });
  row("multiply_subtract", []<class L>(const L& x, const L& y, const L& z) { return sum_of_product<L>(x, y, -z); });
  row("subtract_product", []<class L>(const L& x, const L& y, const L& z) { return sum_of_product<L>(-x, y, z); });
  row("inverse", []<class L>(const L& x) { return L(1.0) / x; });
  row("cbrt", [](const auto& x) { return cbrt(x); });
}

/// The name of an operation in a program, and its registers.
struct OperationName {
  std::string_view name;
  int registers = 0;  ///< number of results and operands; 0 for linear systems, where it varies
};

/// All operations, by their codes. Consecutive operations of one kind are a run: its code, the number of registers of
/// all of them together, then the result and the operands of each.
inline constexpr std::array operation_names = [] {
  std::array<OperationName, 24> names;
  auto* next = names.data();
  program_operations([&]<class Function>(std::string_view name, Function) {
    *next++ = {name, 1 + detail::operands_of<Function>};
  });
  *next++ = {"sincos", 3};
  // A linear system; the operation is followed by its size.
  *next++ = {"factor"};  // operands: first register of the result, then the lower triangle row by row; result: L and
                         // 1/D of L D Lᵀ
  *next++ = {"solve"};   // operands: first register of the solution, first of L and 1/D, then the right-hand side
  *next++ = {"end"};
  return names;
}();
inline constexpr std::uint16_t end_of_code = operation_names.size() - 1;

}  // namespace pendula
