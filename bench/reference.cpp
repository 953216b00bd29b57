// Writes references.hpp, the end states that all errors are measured against:  pendula_reference > references.hpp
//
// None of this is Gauss-Legendre: Gragg's extrapolated midpoint rule, order 24, in 128-bit arithmetic, on the O(n)
// equations in (theta, p); half as many steps must agree with it, and so must odeint's Fehlberg 7(8) on the dense
// equations in (theta, theta_dot) in 80-bit arithmetic.
#include <Eigen/Core>
#include <boost/multiprecision/float128.hpp>
#include <boost/numeric/odeint.hpp>
#include <cstdio>
#include <equations.hpp>
#include <memory>
#include <random>

namespace bench {
namespace {

using Quad = boost::multiprecision::number<boost::multiprecision::float128_backend, boost::multiprecision::et_off>;
using Long = long double;
static_assert(std::numeric_limits<Long>::digits >= 64, "references need the 80-bit long double of x86");

/// θ and θ̇ of a state: in either form of the equations θ̇ is the first half of the derivative.
template <class Equations>
std::vector<Long> values_of(Equations& equations, const typename Equations::State& y) {
  typename Equations::State dy;
  equations.derivative(y.data(), dy.data());
  std::vector<Long> values;
  for (std::size_t i = 0; i < Equations::links; ++i) values.push_back(static_cast<Long>(y[i]));
  for (std::size_t i = 0; i < Equations::links; ++i) values.push_back(static_cast<Long>(dy[i]));
  return values;
}

/// `count` midpoint steps over `step` from y, with Gragg's smoothing; the error has even powers of step/count only.
template <class Equations, class Real = typename Equations::State::value_type>
typename Equations::State midpoint(Equations& equations, const typename Equations::State& y, Real step, int count) {
  typename Equations::State before = y, now = y, dy;
  const Real h = step / count;
  equations.derivative(y.data(), dy.data());
  for (std::size_t i = 0; i < y.size(); ++i) now[i] += h * dy[i];
  for (int k = 1; k <= count; ++k) {
    equations.derivative(now.data(), dy.data());
    const bool last = k == count;
    for (std::size_t i = 0; i < y.size(); ++i) {
      const Real after = before[i] + (last ? 1 : 2) * h * dy[i];
      before[i] = last ? (now[i] + after) / 2 : now[i];
      now[i] = after;
    }
  }
  return before;
}

/// The end of `steps` extrapolated steps (Gragg, Bulirsch, Stoer; harmonic sequence 2, 4, … 24, so order 24).
template <class Equations>
std::vector<Long> extrapolate(Equations& equations, typename Equations::State y, double duration, int steps) {
  using Real = typename Equations::State::value_type;
  constexpr int columns = 12;
  const Real step = Real(duration) / steps;
  std::array<typename Equations::State, columns> table;
  for (int k = 0; k < steps; ++k) {
    for (int row = 0; row < columns; ++row) {
      table[static_cast<std::size_t>(row)] = midpoint(equations, y, step, 2 * (row + 1));
      for (int column = row; column-- > 0;) {  // Neville's scheme; the best value of the row ends up in table[0]
        const Real ratio = Real((row + 1) * (row + 1)) / Real((column + 1) * (column + 1));
        auto& coarse = table[static_cast<std::size_t>(column)];
        const auto& fine = table[static_cast<std::size_t>(column) + 1];
        for (std::size_t i = 0; i < y.size(); ++i) coarse[i] = fine[i] + (fine[i] - coarse[i]) / (ratio - 1);
      }
    }
    y = table[0];
  }
  return values_of(equations, y);
}

/// The end of a run by odeint's Fehlberg 7(8).
template <class Equations>
std::vector<Long> fehlberg(Equations& equations, typename Equations::State y, double duration, Long tolerance) {
  namespace odeint = boost::numeric::odeint;
  using State = typename Equations::State;
  using Stepper = odeint::runge_kutta_fehlberg78<State, Long, State, Long, odeint::array_algebra>;
  const auto derivative = [&](const State& x, State& dx, Long) { equations.derivative(x.data(), dx.data()); };
  odeint::integrate_adaptive(odeint::make_controlled(tolerance, tolerance, Stepper()), derivative, y, Long(0),
                             Long(duration), Long(1e-4));
  return values_of(equations, y);
}

/// The error measure of the races, between two results.
double distance(const std::vector<Long>& a, const std::vector<Long>& b) {
  const std::size_t links = a.size() / 2;
  Long fastest = 0, distance = 0;
  for (std::size_t i = 0; i < links; ++i) fastest = std::max(fastest, std::abs(b[links + i]));
  for (std::size_t i = 0; i < 2 * links; ++i) {
    distance = std::max(distance, std::abs(a[i] - b[i]) / (i < links ? Long(1) : fastest));
  }
  return static_cast<double>(distance);
}

/// The end of a run whose every datum (start angles, masses, lengths, gravity) is off by up to half a unit in the last
/// place of a double.
template <int N>
std::vector<Long> disturbed(const Problem& problem, std::mt19937_64& random) {
  const auto rounded = [&](double value) {
    const double unit = std::nextafter(value, std::numeric_limits<double>::infinity()) - value;
    return value + Long(unit) * std::uniform_real_distribution<Long>(-0.5L, 0.5L)(random);
  };
  typename RecursiveEquations<Long, N>::State y{};
  typename RecursiveEquations<Long, N>::Links masses, lengths;
  for (std::size_t i = 0; i < N; ++i) {
    y[i] = rounded(problem.angle);
    masses[i] = rounded(problem.mass);
    lengths[i] = rounded(problem.length);
  }
  RecursiveEquations<Long, N> equations(masses, lengths, rounded(problem.gravity));
  return fehlberg(equations, y, problem.duration, 1e-17L);
}

/// Median over 15 draws of what such data change at the end: no program that holds them in doubles can expect less. Nor
/// can it be less than half a unit of the end itself.
template <int N>
double floor_of(const Problem& problem) {
  RecursiveEquations<Long, N> equations(problem);
  const std::vector<Long> exact = fehlberg(equations, equations.start(problem), problem.duration, 1e-17L);
  std::mt19937_64 random(1);
  std::array<double, 15> changes{};
  for (double& change : changes) change = distance(disturbed<N>(problem, random), exact);
  std::nth_element(changes.begin(), changes.begin() + 7, changes.end());
  return std::max(changes[7], 0x1p-53);
}

/// Writes the end of one problem as an array of literals; returns its floor.
template <int N>
double write(const Problem& problem) {
  RecursiveEquations<Quad, N> recursive(problem);
  const auto dense = std::make_unique<DenseEquations<Long, N>>(problem);
  const int steps = static_cast<int>(problem.duration * (60 + 6 * problem.links));
  const auto y = recursive.start(problem);
  const std::vector<Long> values = extrapolate(recursive, y, problem.duration, 2 * steps);
  const double coarser = distance(extrapolate(recursive, y, problem.duration, steps), values);
  const double other = distance(fehlberg(*dense, dense->start(problem), problem.duration, 1e-18L), values);
  std::printf("\n// %s: half as many steps change this by %.1e; the dense equations in 80 bits give it but for %.1e.\n",
              problem.name.data(), coarser, other);
  std::printf("inline constexpr std::array<long double, %d> end_%s = {\n", 2 * N, problem.name.data());
  for (const Long value : values) std::printf("    %.21LgL,\n", value);
  std::printf("};\n");
  std::fflush(stdout);
  return floor_of<N>(problem);
}

}  // namespace
}  // namespace bench

int main() {
  std::puts(
      "#pragma once\n\n// Written by pendula_reference (bench/reference.cpp); not edited by hand.\n// clang-format "
      "off\n");
  std::puts("#include <array>\n#include <problems.hpp>\n\nnamespace bench {");
  std::vector<double> floors;
  for (const bench::Problem& problem : bench::problems) {
    floors.push_back(bench::with_links(problem.links, [&]<int N>() { return bench::write<N>(problem); }));
  }
  std::puts("\ninline constexpr std::array references{");
  for (std::size_t i = 0; i < floors.size(); ++i) {
    const char* name = bench::problems[i].name.data();
    std::printf("    Reference{\"%s\", %.1e, end_%s},\n", name, floors[i], name);
  }
  std::puts("};\n\n}  // namespace bench");
}
