#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <pendula/system/system_table.hpp>
#include <span>

namespace pendula {

/// What steps of a program do. Behind the kind stands how many of them come one after the other, then of each its
/// result and its operands x, y, z, all of them registers.
enum class Operation : std::uint16_t {
  end,
  add,
  subtract,
  multiply,
  multiply_add,       ///< x y + z
  multiply_subtract,  ///< x y - z
  subtract_product,   ///< z - x y
  negative,
  inverse,
  sincos,  ///< of two results
  tan,
  asin,
  acos,
  atan,
  sinh,
  cosh,
  tanh,
  exp,
  log,
  sqrt,
  cbrt,
  pow,
  // One system; behind the kind stands its size.
  factor,  ///< first result, lower triangle row by row: L and 1/D of L D Lᵀ, as many in a row
  solve    ///< first result, first of L and 1/D, right-hand side: the solution, as many in a row
};

/// A register, and the number of an array that goes there before a function begins, or comes from there when it ends.
struct ProgramMove {
  std::uint16_t place;  ///< of the register
  std::uint16_t array;  ///< parameters, times, inputs, then the arguments of the function
  std::uint32_t row;
};

struct ProgramNumber {
  std::uint16_t place;
  double value;
};

/// A function of a table as steps on registers.
struct ProgramFunction {
  std::size_t registers = 0;
  std::span<const ProgramMove> reads, writes;
  std::span<const ProgramNumber> numbers;
  std::span<const std::uint16_t> code;  ///< ends with Operation::end
};

/// All of a kernel: a SystemTable's context. Whoever makes one sees to it that no step leaves the registers, and no
/// move an array.
struct Program {
  /// Of SystemFunctions, but for iterate, then of PlainFunctions.
  static constexpr std::size_t many = 13, plain = 3;

  std::size_t coordinates = 0;
  std::array<ProgramFunction, many + plain> functions;
};

/// Functions of a table whose context is a Program: those of any.
struct ProgramInterpreter {
  SystemFunctions of_1, of_2, of_4, of_8;
  PlainFunctions plain;
};

}  // namespace pendula
