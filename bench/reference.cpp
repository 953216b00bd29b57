// Writes references.hpp, the end states that all errors are measured against:  pendula_reference > references.hpp
//
// None of this is Gauss-Legendre: Gragg's extrapolated midpoint rule, order 24, in 128-bit arithmetic, on the O(n)
// equations in (theta, p); half as many steps must agree with it, and so must odeint's Fehlberg 7(8) on the dense
// equations in (theta, theta_dot) in 80-bit arithmetic. Systems that are no chains go by their kernels, in (q, p) and
// in (q, q_dot); heyoka_races.py compares their ends with those of equations that are not ours.
#include <Eigen/Core>
#include <boost/multiprecision/float128.hpp>
#include <boost/numeric/odeint.hpp>
#include <cstdio>
#include <equations.hpp>
#include <kernel_equations.hpp>
#include <memory>
#include <random>
#include <string>

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
double distance(const std::vector<Long>& a, const std::vector<Long>& b, std::string_view units = {}) {
  const std::vector<Long> sizes = sizes_of(b, units);
  Long distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance = std::max(distance, std::abs(a[i] - b[i]) / sizes[i]);
  return static_cast<double>(distance);
}

/// A number that is off by up to half a unit in the last place of a double.
Long rounded(double value, std::mt19937_64& random) {
  const double unit = std::nextafter(std::abs(value), std::numeric_limits<double>::infinity()) - std::abs(value);
  return value + Long(unit) * std::uniform_real_distribution<Long>(-0.5L, 0.5L)(random);
}

/// The end of a run whose every datum (start angles, masses, lengths, gravity) is rounded.
template <int N>
std::vector<Long> disturbed(const Problem& problem, std::mt19937_64& random) {
  typename RecursiveEquations<Long, N>::State y{};
  typename RecursiveEquations<Long, N>::Links masses, lengths;
  for (std::size_t i = 0; i < N; ++i) {
    y[i] = rounded(problem.angle, random);
    masses[i] = rounded(problem.mass, random);
    lengths[i] = rounded(problem.length, random);
  }
  RecursiveEquations<Long, N> equations(masses, lengths, rounded(problem.gravity, random));
  return fehlberg(equations, y, problem.duration, 1e-17L);
}

/// Median over 15 draws of what such data change at the end: no program that holds them in doubles can expect less. Nor
/// can it be less than half a unit of the end itself.
template <class Draw>
double floor_of(const std::vector<Long>& exact, std::string_view units, Draw draw) {
  std::mt19937_64 random(1);
  std::array<double, 15> changes{};
  for (double& change : changes) change = distance(draw(random), exact, units);
  std::nth_element(changes.begin(), changes.begin() + 7, changes.end());
  return std::max(changes[7], 0x1p-53);
}

/// Ends by two sets of equations of one problem, the first in 128 bits and with half as many steps too.
struct Ends {
  std::vector<Long> values, coarser, other;
};

template <class Accurate, class Other>
Ends ends_of(const Problem& problem, Accurate& accurate, const typename Accurate::State& y, Other& other,
             const typename Other::State& other_y) {
  const int steps = static_cast<int>(problem.duration * (60 + 6 * problem.links));
  return {extrapolate(accurate, y, problem.duration, 2 * steps), extrapolate(accurate, y, problem.duration, steps),
          fehlberg(other, other_y, problem.duration, 1e-18L)};
}

/// What identifiers are made of.
std::string identifier(std::string_view name) {
  std::string result(name);
  std::replace(result.begin(), result.end(), ' ', '_');
  return result;
}

/// Writes the end of one problem as an array of literals.
void write(const Problem& problem, const Ends& ends, std::string_view units, const char* other) {
  std::printf("\n// %s: half as many steps change this by %.1e; %s in 80 bits give it but for %.1e.\n",
              problem.name.data(), distance(ends.coarser, ends.values, units), other,
              distance(ends.other, ends.values, units));
  std::printf("inline constexpr std::array<long double, %zu> end_%s = {\n", ends.values.size(),
              identifier(problem.name).c_str());
  for (const Long value : ends.values) std::printf("    %.21LgL,\n", value);
  std::printf("};\n");
  std::fflush(stdout);
}

/// What stands in the table of references.
struct Entry {
  std::string name;
  double floor;
  std::string units;
};

/// A chain: in (θ, p) along the chain, and dense.
template <int N>
Entry write_chain(const Problem& problem) {
  RecursiveEquations<Quad, N> recursive(problem);
  const auto dense = std::make_unique<DenseEquations<Long, N>>(problem);
  write(problem, ends_of(problem, recursive, recursive.start(problem), *dense, dense->start(problem)), {},
        "the dense equations");
  RecursiveEquations<Long, N> equations(problem);
  const std::vector<Long> exact = fehlberg(equations, equations.start(problem), problem.duration, 1e-17L);
  return {std::string(problem.name),
          floor_of(exact, {}, [&](std::mt19937_64& random) { return disturbed<N>(problem, random); }),
          {}};
}

/// A system: by its kernel in (q, p), and by accelerations in (q, q̇).
template <class Kernel>
Entry write_system(const Problem& problem) {
  using Hamilton = KernelEquations<Quad, Kernel, Coordinates::momenta>;
  using Newton = KernelEquations<Long, Kernel, Coordinates::rates>;
  const SystemStart& begin = system_start(problem);
  const pendula::SystemNumbers numbers = numbers_of(begin, pendula::info_of<Kernel>());
  const pendula::PlainSystem plain = numbers.plain();
  std::string units;
  for (const bool is_angle : Kernel::coordinate_is_angle) units += is_angle ? 'r' : 'm';
  Hamilton hamilton(plain);
  Newton newton(plain);
  const auto start = newton.start(begin);
  write(problem, ends_of(problem, hamilton, hamilton.start(begin), newton, start), units, "accelerations");
  const std::vector<Long> exact = fehlberg(newton, start, problem.duration, 1e-17L);
  const auto draw = [&](std::mt19937_64& random) {
    Newton equations(plain, [&](double value) { return rounded(value, random); });
    auto y = start;
    for (Long& number : y) number = rounded(static_cast<double>(number), random);
    y.back() = 0;
    return fehlberg(equations, y, problem.duration, 1e-17L);
  };
  return {std::string(problem.name), floor_of(exact, units, draw), units};
}

Entry write(const Problem& problem) {
  if (problem.kernel.empty()) {
    return with_links(problem.links, [&]<int N>() { return write_chain<N>(problem); });
  }
  return with_kernel(problem, [&]<class Kernel>() { return write_system<Kernel>(problem); });
}

}  // namespace
}  // namespace bench

int main() {
  std::puts(
      "#pragma once\n\n// Written by pendula_reference (bench/reference.cpp); not edited by hand.\n// clang-format "
      "off\n");
  std::puts("#include <array>\n#include <problems.hpp>\n\nnamespace bench {");
  std::vector<bench::Problem> problems(bench::problems.begin(), bench::problems.end());
  for (const bench::Problem& problem : bench::kernel_problems) {
    const auto is_same = [&](const bench::Problem& other) { return other.name == problem.name; };
    if (std::none_of(problems.begin(), problems.end(), is_same)) problems.push_back(problem);
  }
  std::vector<bench::Entry> entries;
  for (const bench::Problem& problem : problems) entries.push_back(bench::write(problem));
  std::puts("\ninline constexpr std::array references{");
  for (const bench::Entry& entry : entries) {
    std::printf("    Reference{\"%s\", %.1e, end_%s", entry.name.c_str(), entry.floor,
                bench::identifier(entry.name).c_str());
    std::puts(entry.units.empty() ? "}," : (", \"" + entry.units + "\"},").c_str());
  }
  std::puts("};\n\n}  // namespace bench");
}
