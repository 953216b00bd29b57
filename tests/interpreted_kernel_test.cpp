// Kernels that are interpreted: what they compute, and what is said of programs that are damaged.

#include <gtest/gtest.h>
#include <pendula/pendula.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/system/interpreter.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <support/spring_program.hpp>
#include <vector>

namespace pendula::test {
namespace {

std::string with_tabs(std::string_view text) {
  std::string tabs(text);
  std::ranges::replace(tabs, '|', '\t');
  return tabs;
}

std::shared_ptr<const SystemTable> read(const std::string& text) {
  return table_of(text, program_interpreter);
}

/// The program with a text in place of another.
std::string changed(std::string_view from, std::string_view to) {
  std::string text(spring);
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the program has no " + std::string(from));
  return with_tabs(text.replace(at, from.size(), to));
}

/// Numbers of W springs side by side.
template <int W>
class Springs {
  static constexpr std::size_t width = W;
  static constexpr std::size_t rows_of_series = 5;

 public:
  explicit Springs(const SystemTable& table) : table_(table), functions_(functions_of<W>(table)) {
    std::mt19937 draw(W);
    std::uniform_real_distribution<double> some(0.5, 2.0);
    for (PackRows<width>* rows : {&parameters_, &inputs_, &given_}) {
      for (std::size_t k = 0; k < rows->rows(); ++k) std::generate_n((*rows)[k], width, [&] { return some(draw); });
    }
  }

  Conditions at() const { return {table_.context, parameters_[0], times_[0], inputs_[0]}; }

  void check() {
    functions_.hamiltonian_form(at(), given_[0], given_[1], found_[0], found_[1]);
    functions_.acceleration_along(at(), given_[0], given_[1], given_[2], given_[3], found_[2], found_[3]);
    functions_.energies(at(), given_[0], given_[1], found_[4], found_[5]);
    for (std::size_t lane = 0; lane < width; ++lane) {
      const double m = parameters_[0][lane], k = parameters_[1][lane], u = inputs_[0][lane];
      const double x = given_[0][lane], v = given_[1][lane];
      EXPECT_DOUBLE_EQ(found_[0][lane], v / m);
      EXPECT_DOUBLE_EQ(found_[1][lane], u - k * x);
      EXPECT_DOUBLE_EQ(found_[2][lane], (u - k * x) / m);
      EXPECT_DOUBLE_EQ(found_[3][lane], -k * given_[2][lane] / m);
      EXPECT_DOUBLE_EQ(found_[4][lane], m * v * v / 2);
      EXPECT_DOUBLE_EQ(found_[5][lane], m * v * v / 2 + k * x * x / 2);
    }
  }

  /// Its motion begins with x, v, (u - k x) / 2m, …
  void check_series() {
    PackRows<width> unit(1), inputs(3), state(4 * series_state_row(1, width) / width), kept(2), operands(1);
    const std::size_t row = series_state_row(1, width);
    for (std::size_t lane = 0; lane < width; ++lane) {
      unit[0][lane] = 0.5;
      inputs[0][lane] = inputs_[0][lane];
      inputs[1][lane] = 0.25;
      state[0][lane] = given_[0][lane];
      state[0][width + lane] = given_[1][lane];
    }
    const Conditions there{table_.context, parameters_[0], times_[0], inputs[0]};
    const SeriesRows rows{unit[0], state[0], kept[0], operands[0]};
    functions_.series_start(there, rows);
    functions_.series_next(there, rows, 1, 2);
    for (std::size_t lane = 0; lane < width; ++lane) {
      const double m = parameters_[0][lane], k = parameters_[1][lane], u = inputs_[0][lane];
      const double x = given_[0][lane], v = given_[1][lane], a = (u - k * x) / m, jerk = (0.25 - k * v / 2) / m;
      const auto at = [&](std::size_t order, std::size_t which) {
        return state[0][order * row + which * width + lane];
      };
      EXPECT_DOUBLE_EQ(at(1, 0), v / 2);
      EXPECT_DOUBLE_EQ(at(1, 1), a / 2);
      EXPECT_DOUBLE_EQ(at(2, 0), a / 8);
      EXPECT_DOUBLE_EQ(at(2, 1), jerk / 4);
      EXPECT_DOUBLE_EQ(at(3, 0), jerk / 24);
    }
  }

  /// How the same changes along a direction: v/2, a/2, and then a/8.
  void check_series_along() {
    PackRows<width> unit(1), order(4), state(2), d_parameters(2), d_inputs(1), d_state(2), next(2), kept(2), d_next(2),
        d_kept(2), third(2), d_third(2), none(1);
    std::mt19937 draw(7);
    std::uniform_real_distribution<double> some(0.5, 2.0);
    for (PackRows<width>* rows : {&state, &d_parameters, &d_inputs, &d_state}) {
      for (std::size_t k = 0; k < rows->rows(); ++k) std::generate_n((*rows)[k], width, [&] { return some(draw); });
    }
    for (std::size_t lane = 0; lane < width; ++lane) {
      unit[0][lane] = 0.5;
      order[2][lane] = 0.25;
    }
    functions_.series_start_along(at(), unit[0], state[0], d_parameters[0], d_inputs[0], d_state[0], next[0], kept[0],
                                  d_next[0], d_kept[0]);
    functions_.series_next_along(at(), order[0], next[0], kept[0], none[0], d_next[0], d_kept[0], none[0], third[0],
                                 none[0], d_third[0], none[0]);
    for (std::size_t lane = 0; lane < width; ++lane) {
      const double m = parameters_[0][lane], k = parameters_[1][lane], u = inputs_[0][lane];
      const double dm = d_parameters[0][lane], dk = d_parameters[1][lane];
      const double x = state[0][lane], a = (u - k * x) / m, jerk = (u - k * next[0][lane]) / m;
      const double da = (d_inputs[0][lane] - dk * x - k * d_state[0][lane] - a * dm) / m;
      EXPECT_NEAR(next[1][lane], a / 2, 1e-14);  // measured 1e-17, where the compiler fuses k x with u
      EXPECT_DOUBLE_EQ(d_next[0][lane], d_state[1][lane] / 2);
      EXPECT_NEAR(d_next[1][lane], da / 2, 1e-14);   // measured 1.8e-15
      EXPECT_NEAR(d_third[0][lane], da / 8, 1e-14);  // measured 4.4e-16
      // Inputs of higher orders do not vary.
      const double d_jerk = (-dk * next[0][lane] - k * d_next[0][lane] - jerk * dm) / m;
      EXPECT_NEAR(d_third[1][lane], d_jerk / 4, 1e-14);  // measured 8.9e-16
    }
  }

  /// A step whose stages all are where it begins.
  void check_iteration() {
    PackRows<width> m(width), hb(1), increments(2);
    std::fill_n(hb[0], width, 0.5);
    const Compensated<double> start[] = {{1.0, 0.0}, {2.0, 0.0}};
    const double weights[] = {3.0, 1.0};
    const StageIteration on{m[0], hb[0], start, weights, increments[0]};
    const IterationChange first = functions_.iterate(at(), on);
    double largest = 0;
    for (std::size_t lane = 0; lane < width; ++lane) {
      const double moved = 0.5 * 2.0 / parameters_[0][lane], pushed = 0.5 * (inputs_[0][lane] - parameters_[1][lane]);
      EXPECT_DOUBLE_EQ(increments[0][lane], moved);
      EXPECT_DOUBLE_EQ(increments[1][lane], pushed);
      largest = std::max({largest, 3 * std::abs(moved), std::abs(pushed)});
    }
    EXPECT_DOUBLE_EQ(first.change, largest);
    EXPECT_DOUBLE_EQ(first.size, largest);
    EXPECT_EQ(functions_.iterate(at(), on).change, 0);
    increments[1][width - 1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(std::isnan(functions_.iterate(at(), on).change));
  }

  /// Calls all that the table has.
  void call_all() {
    double* o = found_[0];
    const double* g = given_[0];
    functions_.hamiltonian_form(at(), g, g, o, o);
    functions_.momentum_form(at(), g, g, o, o);
    functions_.momentum_form_with_jacobians(at(), g, g, o, o, o, o, o, o);
    functions_.residual_with_jacobians(at(), g, g, g, o, o, o, o);
    functions_.momentum_from_velocity(at(), g, g, o);
    functions_.velocity_from_momentum(at(), g, g, o);
    functions_.acceleration(at(), g, g, o);
    functions_.mass_matrix(at(), g, o);
    functions_.energies(at(), g, g, o, o);
    functions_.power(at(), g, g, o);
    functions_.acceleration_along(at(), g, g, g, g, o, o);
    functions_.momentum_form_along(at(), g, g, g, g, o, o);
    if (functions_.call_arguments != nullptr) functions_.call_arguments(at(), g, g, o);
    const SeriesInfo& info = table_.info.series;
    PackRows<width> unit(1), inputs(rows_of_series), kept(static_cast<std::size_t>(info.kept) + 1);
    PackRows<width> state(rows_of_series * series_state_row(1, width) / width);
    PackRows<width> operands(rows_of_series * series_operand_row(info, width) / width + 1);
    const SeriesRows rows{unit[0], state[0], kept[0], operands[0]};
    functions_.series_start(at(), rows);
    functions_.series_next({table_.context, parameters_[0], times_[0], inputs[0]}, rows, 1, 3);
  }

 private:
  const SystemTable& table_;
  SystemFunctions functions_;
  PackRows<width> parameters_{2}, times_{1}, inputs_{1}, given_{4}, found_{6};
};

TEST(InterpretedKernel, ComputesWhatItsProgramSays) {
  const auto table = read(with_tabs(spring));
  Springs<1>(*table).check();
  Springs<2>(*table).check();
  Springs<4>(*table).check();
  Springs<8>(*table).check();
}

TEST(InterpretedKernel, IteratesOnStages) {
  const auto table = read(with_tabs(spring));
  Springs<1>(*table).check_iteration();
  Springs<2>(*table).check_iteration();
  Springs<4>(*table).check_iteration();
  Springs<8>(*table).check_iteration();
}

TEST(InterpretedKernel, HasTheSeriesOfItsProgram) {
  const auto table = read(with_tabs(spring));
  Springs<1>(*table).check_series();
  Springs<2>(*table).check_series();
  Springs<4>(*table).check_series();
  Springs<8>(*table).check_series();
}

TEST(InterpretedKernel, HasTheChangesOfItsSeries) {
  const auto table = read(with_tabs(spring));
  Springs<1>(*table).check_series_along();
  Springs<2>(*table).check_series_along();
  Springs<4>(*table).check_series_along();
  Springs<8>(*table).check_series_along();
}

TEST(InterpretedKernel, SaysWhatItsProgramSays) {
  const auto table = read(with_tabs(spring));
  const SystemInfo& info = table->info;
  EXPECT_EQ(info.name, "spring");
  EXPECT_EQ(info.coordinates.size(), 1U);
  EXPECT_EQ(info.parameter_units[1], "N/m");
  EXPECT_TRUE(info.is_positive[0] && !info.is_positive[1] && info.constant_masses && !info.depends_on_time);
  EXPECT_EQ(info.inputs[0], "u");
  EXPECT_EQ(info.point_sizes[0], 2);
  EXPECT_EQ(info.point_kinds[0], "cart");
  EXPECT_EQ(info.connection_kinds[0], "spring");
  EXPECT_EQ(std::vector(info.connection_ends.begin(), info.connection_ends.end()), (std::vector{-1, 0}));
  EXPECT_EQ(table->of_8.call_arguments, nullptr);
}

TEST(InterpretedKernel, TellsTheLineThatIsWrong) {
  const auto told = [](const std::string& text) -> std::string {
    try {
      read(text);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(told(""), "line 0: expected a program, got ");
  EXPECT_EQ(told(changed("program|19", "program|9")), "line 1: expected a whole number from 19 to 19, got 9");
  EXPECT_EQ(told(changed("links|1", "links|one")), "line 4: expected a whole number from 1 to 1000000, got one");
  EXPECT_EQ(told(changed("kg|1|1.0|1|0", "kg|1|1.0|1")), "line 8: expected another word, got the end of the line");
  EXPECT_EQ(told(changed("bob|2|cart", "bob|2|cart|3")), "line 11: expected the end of the line, got 3");
  EXPECT_EQ(told(changed("hamiltonian_form", "hamiltonian")),
            "line 14: expected a function that kernels have, got hamiltonian");
  EXPECT_EQ(told(changed("read|1|p|0", "read|1|v|0")), "line 16: expected an array of this function, got v");
  EXPECT_EQ(told(changed("read|1|p|0", "read|1|p|1")), "line 16: expected a whole number from 0 to 0, got 1");
  EXPECT_EQ(told(changed("factor|1|5|0", "factor|3|5|0")), "line 20: expected a whole number from 0 to 0, got 5");
  EXPECT_EQ(told(changed("factor|1|5|0", "invert|1|5|0")), "line 20: expected an operation, got invert");
  EXPECT_EQ(told(changed("solve|1|2|5|1", "solve|1|2|6|1")), "line 22: expected a whole number from 0 to 5, got 6");
  EXPECT_EQ(told(changed("write|2|v|0\n", "")), "line 24: expected a write to every row of every output, got function");
  EXPECT_EQ(told(changed("series|0|0|0|2", "series|0|2|1|2\nsum|0|0")), "expected 2 sums of series, got 1");
  EXPECT_EQ(told(changed("series|0|0|0|2", "series|0|1|1|2\nsum|0|1")),
            "line 14: expected a whole number from 0 to 0, got 1");
  EXPECT_EQ(told(changed("write|1|kept|0\n", "")).substr(10),
            "expected a write to every row of every output, got function");
  EXPECT_EQ(told(changed("point|bob|2|cart\nconnection|spring|-1|0\n", "")),
            "line 142: expected an array of this function, got r");
  EXPECT_EQ(told(changed("spring|-1|0", "spring|-1|1")), "line 12: expected a whole number from -1 to 0, got 1");
  EXPECT_EQ(told(changed("coordinate|x|m|0|0\n", "")),
            "expected a name, a model, links and coordinates, got a description without one of them");
}

// A program that is cut or changed anywhere is refused, or touches nothing but its own.
TEST(InterpretedKernel, ADamagedProgramDoesNoHarm) {
  const std::string whole = with_tabs(spring);
  for (std::size_t size = 0; size < whole.size() - 1; ++size) {
    EXPECT_THROW(read(whole.substr(0, size)), std::invalid_argument) << size;
  }
  std::mt19937 draw(1);
  constexpr std::string_view characters = "0123456789\t\n-.ax";
  int refused = 0;
  constexpr int trials = 5000;
  for (int trial = 0; trial < trials; ++trial) {
    std::string text = whole;
    text[draw() % text.size()] = characters[draw() % characters.size()];
    try {
      const auto table = read(text);
      if (table->info.coordinates.size() == 1 && table->info.inputs.size() == 1) Springs<2>(*table).call_all();
    } catch (const std::invalid_argument&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, trials / 2);  // others are other numbers, names and registers
}

// x = 0.3 cos 2t, of m = 2 kg and k = 8 N/m.
TEST(InterpretedKernel, MovesByTheCInterface) {
  const std::array<double, 2> numbers = {2, 8};
  const std::array<double, 1> start = {0.3}, rest = {0};
  std::array<double, 1> q{}, v{};
  std::array<double, 2> energies{};
  pendula_model* model = pendula_model_of_program(with_tabs(spring).c_str(), numbers.data(), numbers.size());
  ASSERT_NE(model, nullptr) << pendula_error();
  EXPECT_EQ(pendula_energies(model, 0, start.data(), rest.data(), energies.data()), PENDULA_OK);
  EXPECT_EQ(energies[0], 0);
  EXPECT_DOUBLE_EQ(energies[1], 0.36);
  pendula_options options{};
  options.tolerance = 1e-12;
  pendula_simulation* simulation = pendula_simulation_new(model, 0, start.data(), rest.data(), &options);
  pendula_model_free(model);  // a simulation does not need it any more
  ASSERT_NE(simulation, nullptr) << pendula_error();
  EXPECT_EQ(pendula_advance_to(simulation, 1), PENDULA_OK);
  pendula_motion(simulation, q.data(), v.data());
  EXPECT_NEAR(q[0], 0.3 * std::cos(2.0), 1e-15);   // measured 2.8e-17
  EXPECT_NEAR(v[0], -0.6 * std::sin(2.0), 1e-15);  // measured 0
  pendula_simulation_free(simulation);
  EXPECT_EQ(pendula_model_of_program("no program", nullptr, 0), nullptr);
  EXPECT_EQ(pendula_error_kind(), PENDULA_INVALID);
}

}  // namespace
}  // namespace pendula::test
