#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <pendula/numeric/dual.hpp>
#include <pendula/numeric/functions.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numbers_of_states.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/stage_product.hpp>
#include <pendula/system/increments.hpp>
#include <pendula/system/program.hpp>
#include <pendula/system/program_operations.hpp>
#include <pendula/system/series_sums.hpp>
#include <string_view>
#include <utility>

namespace pendula {

namespace detail {

/// Executes programs for W states at once: a register is a row of W numbers.
template <int W>
class Interpreter : NumbersOfStates<W> {
  using typename NumbersOfStates<W>::L;
  using NumbersOfStates<W>::load, NumbersOfStates<W>::store;
  using Lanes = Pack<W, RegisterFor<W>>;
  static constexpr auto width = static_cast<std::size_t>(W);

 public:
  static constexpr SystemFunctions functions() {
    return []<std::size_t... which>(std::index_sequence<which...>) {
      return SystemFunctions{&call<which>..., &iterate, &series_start, &series_next};
    }
    (std::make_index_sequence<Program::many>());
  }
  static constexpr PlainFunctions plain_functions() {
    constexpr std::size_t first = Program::many;
    return {&call<first>, &call<first + 1>, &call<first + 2>, &call<first + 3>};
  }

 private:
  template <std::size_t which, class... Arrays>
  static void call(const Conditions& at, Arrays... arrays) {
    const auto& program = *static_cast<const Program*>(at.context);
    // The casts are safe: only the moves in `writes` write to arrays, and these are outputs.
    run(program.functions[which],
        std::array<double*, 3 + sizeof...(Arrays)>{const_cast<double*>(at.parameters), const_cast<double*>(at.times),
                                                   const_cast<double*>(at.inputs), const_cast<double*>(arrays)...}
            .data());
  }

  static void run(const ProgramFunction& function, double* const* arrays) {
    static thread_local PackRows<width> registers;
    if (registers.rows() < function.registers) registers = PackRows<width>(function.registers);
    double* const to = registers[0];
    for (const ProgramNumber& number : function.numbers) store(L(number.value), to + number.place * width);
    for (const ProgramMove& move : function.reads) {
      store(load(arrays[move.array] + move.row * width), to + move.place * width);
    }
    carry_out(function.code.data(), to);
    for (const ProgramMove& move : function.writes) {
      store(load(to + move.place * width), arrays[move.array] + move.row * width);
    }
  }

  // --- Operations ---

  /// Executes a run of operations of one kind; returns where the next run begins, or none at the end.
  using Run = const std::uint16_t* (*)(const std::uint16_t* code, double* registers);

  static void carry_out(const std::uint16_t* code, double* registers) {
    static constexpr std::array runs = all_runs();
    while (code) code = runs[*code](code, registers);
  }

  /// In the order of operation_names.
  static constexpr std::array<Run, operation_names.size()> all_runs() {
    std::array<Run, operation_names.size()> runs{};
    Run* next = runs.data();
    program_operations([&]<class Function>(std::string_view, Function) {
      *next++ = [](const std::uint16_t* code, double* registers) {
        return run_of<Function>(code, registers, std::make_index_sequence<detail::operands_of<Function>>());
      };
    });
    const Run end = [](const std::uint16_t*, double*) -> const std::uint16_t* { return nullptr; };
    for (const Run run : {Run(&sincos_of), Run(&factor), Run(&solve), end}) *next++ = run;
    return runs;
  }

  template <class Function, std::size_t... k>
  static const std::uint16_t* run_of(const std::uint16_t* code, double* registers, std::index_sequence<k...>) {
    const std::uint16_t* const next = code + 2 + code[1];
    code += 2;
    do {
      store(Function()(load(registers + code[1 + k] * width)...), registers + code[0] * width);
    } while ((code += 1 + sizeof...(k)) != next);
    return next;
  }

  static const std::uint16_t* sincos_of(const std::uint16_t* code, double* registers) {
    const std::uint16_t* const next = code + 2 + code[1];
    for (code += 2; code != next; code += 3) {
      L sine, cosine;
      sincos(load(registers + code[2] * width), sine, cosine);
      store(sine, registers + code[0] * width);
      store(cosine, registers + code[1] * width);
    }
    return next;
  }

  // --- Linear systems ---

  /// A lower triangle stored row by row.
  struct Triangle {
    double* first;
    double* operator()(std::size_t i, std::size_t j) const { return first + (i * (i + 1) / 2 + j) * width; }
  };

  static const std::uint16_t* factor(const std::uint16_t* code, double* registers) {
    const std::size_t size = code[1];
    const Triangle a{registers + code[2] * width};
    code += 3;
    for (std::size_t k = 0; k < size * (size + 1) / 2; ++k) {
      store(load(registers + *code++ * width), a.first + k * width);
    }
    for (std::size_t k = 0; k < size; ++k) {
      const L inverse = L(1.0) / load(a(k, k));
      store(inverse, a(k, k));
      // From the last row up, so that the entries above in the column are still unscaled.
      for (std::size_t i = size - 1; i > k; --i) {
        const L l = load(a(i, k)) * inverse;
        for (std::size_t j = k + 1; j <= i; ++j) {
          store(sum_of_product<L>(-l, load(a(j, k)), load(a(i, j))), a(i, j));
        }
        store(l, a(i, k));
      }
    }
    return code;
  }

  static const std::uint16_t* solve(const std::uint16_t* code, double* registers) {
    const std::size_t size = code[1];
    double* const x = registers + code[2] * width;
    const Triangle a{registers + code[3] * width};
    code += 4;
    for (std::size_t i = 0; i < size; ++i) {
      L sum = load(registers + *code++ * width);
      for (std::size_t k = 0; k < i; ++k) sum = sum_of_product<L>(-load(a(i, k)), load(x + k * width), sum);
      store(sum, x + i * width);
    }
    for (std::size_t k = size; k-- > 0;) {
      L sum = load(x + k * width) * load(a(k, k));
      for (std::size_t i = k + 1; i < size; ++i) sum = sum_of_product<L>(-load(a(i, k)), load(x + i * width), sum);
      store(sum, x + k * width);
    }
    return code;
  }

  // --- Iterations on the stages of a step ---

  static IterationChange iterate(const Conditions& at, const StageIteration& on) {
    const std::size_t rows = 2 * static_cast<const Program*>(at.context)->coordinates;
    static thread_local PackRows<width> numbers;
    if (numbers.rows() < 2 * rows) numbers = PackRows<width>(2 * rows);
    double *const reached = numbers[0], *const found = numbers[rows];
    for (std::size_t k = 0; k < rows; ++k) {
      const Compensated<double>& start = on.start[k];
      const Lanes there = Lanes(start.value) + stage_product<Lanes, width, width>(on.m, on.increments + k * width,
                                                                                  Lanes(start.compensation));
      there.store(reached + k * width);
    }
    functions().hamiltonian_form(at, reached, reached + rows / 2 * width, found, found + rows / 2 * width);
    return replace_increments<W>(on.hb, found, on.weights, rows, on.increments);
  }

  // --- Taylor series ---

  static void series_start(const Conditions& at, const SeriesRows& rows) {
    const auto& program = *static_cast<const Program*>(at.context);
    double* const next = rows.state + series_state_row(program.coordinates, width);
    run_at(program.functions[Program::series_start], at, at.inputs, {rows.unit, rows.state, next, rows.kept});
  }

  static void series_next(const Conditions& at, const SeriesRows& rows, int first, int last) {
    const auto& program = *static_cast<const Program*>(at.context);
    const SeriesInfo& info = program.series_info;
    const std::size_t state_row = series_state_row(program.coordinates, width);
    const std::size_t operand_row = series_operand_row(info, width);
    static thread_local PackRows<width> sums, found;
    const auto operands = static_cast<std::size_t>(info.operands);
    if (sums.rows() < series_lanes(info)) sums = PackRows<width>(series_lanes(info));
    if (found.rows() < operands) found = PackRows<width>(operands);
    alignas(pack_alignment) double order[4 * width];
    const L unit = load(rows.unit);
    for (auto k = static_cast<std::size_t>(first); k <= static_cast<std::size_t>(last); ++k) {
      const double share = 1.0 / static_cast<double>(k);
      store(L(static_cast<double>(k)), order);
      store(L(share), order + width);
      store(unit * L(1.0 / static_cast<double>(k + 1)), order + 2 * width);
      store(k == 1 ? unit : L(0.0), order + 3 * width);
      double *const state = rows.state + k * state_row, *const row = rows.operands + k * operand_row;
      if constexpr (W == 1) {
        sums_in_lanes(rows.operands, series_lanes(info), k, sums[0]);
      } else {
        sums_of_many<W>(rows.operands, program.sums, operand_row, k, sums[0]);
      }
      run_at(program.functions[Program::series_next], at, at.inputs + k * program.inputs * width,
             {order, state, rows.kept, sums[0], state + state_row, W == 1 ? found[0] : row});
      if constexpr (W == 1) {
        for (std::size_t m = 0; m < program.sums.size(); ++m) {
          row[m] = found[program.sums[m].first][0];
          row[series_lanes(info) + m] = found[program.sums[m].second][0];
        }
      }
    }
  }

  /// Runs a function that takes the conditions, with other inputs, and these arrays.
  template <std::size_t count>
  static void run_at(const ProgramFunction& function, const Conditions& at, const double* inputs,
                     const double* const (&arrays)[count]) {
    std::array<double*, 3 + count> all{const_cast<double*>(at.parameters), const_cast<double*>(at.times),
                                       const_cast<double*>(inputs)};
    for (std::size_t k = 0; k < count; ++k) all[3 + k] = const_cast<double*>(arrays[k]);
    run(function, all.data());
  }
};

}  // namespace detail

inline constexpr ProgramInterpreter program_interpreter = {
    detail::Interpreter<1>::functions(), detail::Interpreter<2>::functions(), detail::Interpreter<4>::functions(),
    detail::Interpreter<8>::functions(), detail::Interpreter<1>::plain_functions()};

}  // namespace pendula
