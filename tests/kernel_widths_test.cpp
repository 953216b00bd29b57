// Functions of several states at once: a check of a kernel finds whichever of them is wrong.

#include <gtest/gtest.h>

#include <cstddef>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/spatial_1.hpp>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/series_info.hpp>
#include <utility>

namespace pendula::test {
namespace {

constexpr SystemTable planar = system_table<kernels::Planar2>, spatial = system_table<kernels::Spatial1>;

double widths_of(const SystemTable& table) {
  return width_error(table, random_points(table.info, 1));
}
double series_of(const SystemTable& table) {
  return series_error(table, random_points(table.info, 1));
}

constexpr double off = 1e-9, limit = 1e-13;  // what `pendula check` allows

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
  EXPECT_LE(widths_of(planar), 1e-14);   // measured 5.5e-16
  EXPECT_LE(widths_of(spatial), 1e-14);  // measured 3.0e-16
}

template <int W>
void expect_found() {
  using Of = SystemFunctions;
  EXPECT_GT(widths_of(Broken<W, &Of::hamiltonian_form>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::momentum_form>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::momentum_form_with_jacobians>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::residual_with_jacobians>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::momentum_from_velocity>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::velocity_from_momentum>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::acceleration>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::mass_matrix>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::energies>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::power>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::acceleration_along>::table()), limit);
  EXPECT_GT(widths_of(Broken<W, &Of::momentum_form_along>::table()), limit);
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
  EXPECT_GT(widths_of(broken), limit);
}

TEST(KernelWidths, AnIterationThatIsWrongIsFound) {
  SystemTable broken = planar;
  broken.of_4.iterate = [](const Conditions& at, const StageIteration& on) {
    const IterationChange change = planar.of_4.iterate(at, on);
    on.increments[3] *= 1 + 100 * off;  // the smallest of them
    return change;
  };
  EXPECT_GT(widths_of(broken), limit);
  broken.of_4.iterate = [](const Conditions& at, const StageIteration& on) {
    const IterationChange change = planar.of_4.iterate(at, on);
    return IterationChange{change.change * (1 + off), change.size};
  };
  EXPECT_GT(widths_of(broken), limit);
}

/// The series, but for its coefficient of order 2.
void wrong_series(const Conditions& at, const SeriesRows& rows, int first, int last) {
  planar.of_1.series_next(at, rows, first, last);
  rows.state[2 * series_state_row(2, 1)] *= 1.001;
}

TEST(KernelSeriesCheck, FindsACoefficientThatIsWrong) {
  EXPECT_LE(series_of(planar), 1e-13);  // measured 2.5e-15
  SystemTable broken = planar;
  broken.of_1.series_next = wrong_series;
  EXPECT_GT(series_of(broken), 1e-6);
}

}  // namespace
}  // namespace pendula::test
