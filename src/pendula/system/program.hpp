#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <pendula/system/system_table.hpp>
#include <span>

namespace pendula {

/// Copies a row of an array to a register before a function begins, or back when it ends.
struct ProgramMove {
  std::uint16_t place;  ///< the register
  std::uint16_t array;  ///< parameters, times, inputs, then the arguments of the function
  std::uint32_t row;
};

struct ProgramNumber {
  std::uint16_t place;
  double value;
};

/// A function of a table as operations on registers.
struct ProgramFunction {
  std::size_t registers = 0;
  std::span<const ProgramMove> reads, writes;
  std::span<const ProgramNumber> numbers;
  std::span<const std::uint16_t> code;  ///< operations, then end_of_code: see operation_names
};

/// A whole kernel: the context of its SystemTable. Whoever makes one must ensure that operations stay within the
/// registers, and moves within the arrays.
struct Program {
  /// Numbers of functions: those of SystemFunctions except iterate, then those of PlainFunctions, and
  /// series_start and series_next.
  static constexpr std::size_t many = 20, plain = 4, series = 2;
  static constexpr std::size_t series_start_along = many - 2, series_next_along = many - 1;
  static constexpr std::size_t series_start = many + plain, series_next = series_start + 1;

  std::size_t coordinates = 0, inputs = 0;
  SeriesInfo series_info;
  std::span<const SeriesSum> sums;
  std::array<ProgramFunction, many + plain + series> functions;
};

/// The functions of every table whose context is a Program.
struct ProgramInterpreter {
  SystemFunctions of_1, of_2, of_4, of_8;
  PlainFunctions plain;
};

}  // namespace pendula
