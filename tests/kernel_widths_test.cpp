// Functions of several states at once: a check of a kernel finds whichever of them is wrong.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/spatial_1.hpp>
#include <pendula/system/kernel_check.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/kernel_widths.hpp>
#include <pendula/system/series_check.hpp>
#include <pendula/system/series_info.hpp>
#include <string_view>
#include <utility>

namespace pendula::test {
namespace {

constexpr SystemTable planar = system_table<kernels::Planar2>, spatial = system_table<kernels::Spatial1>;

KernelCheck::Line line_of(std::string_view what, const SystemTable& table) {
  const KernelCheck check = check_chain_kernel(table, 1);
  return *std::ranges::find(check.lines, what, &KernelCheck::Line::what);
}
KernelCheck::Line widths_of(const SystemTable& table) {
  return line_of(width_line, table);
}

bool is_ok(const KernelCheck::Line& line) {
  return line.error <= line.limit;
}

constexpr double off = 1e-9;

/// The planar table, whose function of W states is off in its last state: by so much of a number of its last output.
template <int W, auto function>
struct Broken;
template <int W, class... Places, void (*SystemFunctions::*function)(const Conditions&, Places...)>
struct Broken<W, function> {
  static void call(const Conditions& at, Places... places) {
    (functions_of<W>(planar).*function)(at, places...);
    double* last = nullptr;
    ((last = const_cast<double*>(places)), ...);
    last[W - 1] *= 1 + off;
  }
  static SystemTable table() {
    SystemTable broken = planar;
    SystemFunctions& of = W == 2 ? broken.of_2 : W == 4 ? broken.of_4 : broken.of_8;
    of.*function = &call;
    return broken;
  }
};

TEST(KernelWidths, FunctionsOfSeveralStatesAreThoseOfOne) {
  EXPECT_LE(widths_of(planar).error, 1e-14);   // measured 5.5e-16
  EXPECT_LE(widths_of(spatial).error, 1e-14);  // measured 3.0e-16
}

template <int W>
void expect_found() {
  using Of = SystemFunctions;
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::hamiltonian_form>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::momentum_form>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::momentum_form_with_jacobians>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::residual_with_jacobians>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::momentum_from_velocity>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::velocity_from_momentum>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::acceleration>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::mass_matrix>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::energies>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::power>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::acceleration_along>::table())));
  EXPECT_FALSE(is_ok(widths_of(Broken<W, &Of::momentum_form_along>::table())));
}

TEST(KernelWidths, OneThatIsWrongOfTwoStatesIsFound) {
  expect_found<2>();
}
TEST(KernelWidths, OneThatIsWrongOfFourStatesIsFound) {
  expect_found<4>();
}
TEST(KernelWidths, OneThatIsWrongOfEightStatesIsFound) {
  expect_found<8>();
}

TEST(KernelWidths, StatesThatChangeLanesAreFound) {
  SystemTable broken = planar;
  broken.of_4.power = [](const Conditions& at, const double* q, const double* v, double* power) {
    planar.of_4.power(at, q, v, power);
    std::swap(power[1], power[2]);
  };
  EXPECT_FALSE(is_ok(widths_of(broken)));
}

TEST(KernelWidths, AnIterationThatIsWrongIsFound) {
  SystemTable broken = planar;
  broken.of_4.iterate = [](const Conditions& at, const StageIteration& on) {
    const IterationChange change = planar.of_4.iterate(at, on);
    on.increments[3] *= 1 + 100 * off;  // the smallest of them
    return change;
  };
  EXPECT_FALSE(is_ok(widths_of(broken)));
  broken.of_4.iterate = [](const Conditions& at, const StageIteration& on) {
    const IterationChange change = planar.of_4.iterate(at, on);
    return IterationChange{change.change * (1 + off), change.size};
  };
  EXPECT_FALSE(is_ok(widths_of(broken)));
}

/// The series, but for its coefficient of order 2.
void wrong_series(const Conditions& at, const SeriesRows& rows, int first, int last) {
  planar.of_1.series_next(at, rows, first, last);
  rows.state[2 * series_state_row(2, 1)] *= 1.001;
}

TEST(KernelSeriesCheck, FindsACoefficientThatIsWrong) {
  EXPECT_TRUE(is_ok(line_of(series_line, planar)));
  SystemTable broken = planar;
  broken.of_1.series_next = wrong_series;
  EXPECT_FALSE(is_ok(line_of(series_line, broken)));
}

}  // namespace
}  // namespace pendula::test
