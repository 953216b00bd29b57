// Where a chain is at given times, by methods, equations and variables that pendula does not use: rod directions in
// Cartesian coordinates, 80-bit numbers, and
//   extrapolation  Gragg, Bulirsch, Stoer (odeint), bobs and tensions
//   fehlberg       Fehlberg 7(8) (odeint), dense equations with multipliers
//   implicit       extrapolated linearly implicit Euler, bobs and tensions, for heavy damping
//
// usage: chain_reference METHOD TOLERANCE LIMIT DISTURBANCE < numbers > numbers
//
// LIMIT bounds the evaluations of the equations (exit status 3 beyond), DISTURBANCE moves the start. Numbers in, as
// reference.py writes them: dimension, links, gravity; per link mass, length, damping, torque (3); number of drives,
// for each link, amplitude (3), frequency, phase; per link u (3) as theta, phi and their rates; number of times, times.
// Numbers out, a line a time: the fastest bob so far, bobs, velocities.
#include <array>
#include <boost/numeric/odeint.hpp>
#include <chain_equations.hpp>
#include <cstdlib>
#include <implicit_extrapolation.hpp>
#include <iostream>
#include <limits>
#include <string>

namespace reference {
namespace {

static_assert(std::numeric_limits<Real>::digits >= 64, "references need the 80-bit long double of x86");

struct Run {
  Problem problem;
  State start;
  std::vector<Real> times;
};

Real next() {
  std::string word;  // strtold reads what Python writes, hexadecimal floats too
  std::cin >> word;
  char* end = nullptr;
  const Real value = std::strtold(word.c_str(), &end);
  if (!std::cin || word.empty() || *end != '\0') {
    std::cerr << "chain_reference: expected a number, got '" << word << "'\n";
    std::exit(2);
  }
  return value;
}

std::size_t count() {
  return static_cast<std::size_t>(next());
}

Vector next_vector() {
  Vector vector;
  for (Real& component : vector) component = next();
  return vector;
}

void read_start(bool spatial, std::size_t link, Run& run) {
  const Real theta = next(), phi = next(), theta_dot = next(), phi_dot = next();
  const Real s = std::sin(theta), c = std::cos(theta);
  Vector u = {s, -c, 0}, rate = {c * theta_dot, s * theta_dot, 0};
  if (spatial) {
    const Real sp = std::sin(phi), cp = std::cos(phi);
    u = {s * cp, s * sp, -c};
    rate = {c * cp * theta_dot - s * sp * phi_dot, c * sp * theta_dot + s * cp * phi_dot, s * theta_dot};
  }
  std::copy(u.begin(), u.end(), run.start.begin() + static_cast<std::ptrdiff_t>(3 * link));
  std::copy(rate.begin(), rate.end(), run.start.begin() + static_cast<std::ptrdiff_t>(3 * (run.problem.links + link)));
}

Run read_run() {
  Run run;
  Problem& problem = run.problem;
  const bool spatial = next() == 3;
  problem.up = spatial ? Vector{0, 0, 1} : Vector{0, 1, 0};
  problem.links = count();
  problem.gravity = next();
  for (std::size_t i = 0; i < problem.links; ++i) {
    problem.mass.push_back(next());
    problem.length.push_back(next());
    problem.damping.push_back(next());
    problem.torque.push_back(next_vector());
  }
  for (std::size_t left = count(); left-- > 0;) {
    Drive drive;
    drive.link = count();
    drive.amplitude = next_vector();
    drive.frequency = next();
    drive.phase = next();
    problem.drives.push_back(drive);
  }
  run.start.resize(6 * problem.links + 1);
  for (std::size_t i = 0; i < problem.links; ++i) read_start(spatial, i, run);
  for (std::size_t left = count(); left-- > 0;) run.times.push_back(next());
  return run;
}

/// Moves the start by about `size` of a turn and of the rates, always in the same arbitrary direction.
void disturb(Run& run, Real size) {
  const std::size_t n = run.problem.links;
  Real fastest = 1;
  for (std::size_t i = 0; i < n; ++i)
    fastest = std::max(fastest, std::sqrt(dot(rod(run.start, n + i), rod(run.start, n + i))));
  for (std::size_t k = 0; k < 6 * n; ++k) {
    if (run.problem.up[2] == 0 && k % 3 == 2) continue;  // stay in the plane
    run.start[k] += size * std::cos(Real(1.7) * Real(k) + Real(0.3)) * (k < 3 * n ? 1 : fastest);
  }
  project(run.problem, run.start);
}

/// Bobs, or their velocities: running sums of l_i times what stands in the state from `first` on.
std::vector<Vector> sums(const Problem& problem, const State& y, std::size_t first) {
  std::vector<Vector> points(problem.links);
  Vector sum{};
  for (std::size_t i = 0; i < problem.links; ++i) {
    const Vector step = rod(y, first + i);
    for (std::size_t c = 0; c < 3; ++c) points[i][c] = sum[c] += problem.length[i] * step[c];
  }
  return points;
}

class Journey {
 public:
  Journey(Run run, Real limit) : run_(std::move(run)), limit_(limit) { look(); }

  /// Goes from time to time by `try_step(y, step)`, which moves y or shortens the step.
  template <class TryStep>
  int travel(TryStep try_step) {
    State& y = run_.start;
    Real step = 1e-6L;
    for (const Real until : run_.times) {
      while (y.back() < until) {
        const Real wanted = step;
        const bool last = y.back() + step >= until;
        if (last) step = until - y.back();
        const bool moved = try_step(y, step);
        if (evaluations > limit_ || (!moved && step < 1e-15L)) return 3;
        if (!moved) continue;
        project(run_.problem, y);
        look();
        if (last) {
          y.back() = until;
          step = std::max(step, wanted);
        }
      }
      tell(y);
    }
    return 0;
  }

  const Problem& problem() const { return run_.problem; }

  Real evaluations = 0;

 private:
  void look() {
    for (const Vector& velocity : sums(run_.problem, run_.start, run_.problem.links)) {
      fastest_ = std::max(fastest_, std::sqrt(dot(velocity, velocity)));
    }
  }

  void tell(const State& y) const {
    std::printf("%.21Lg", fastest_);
    for (const std::size_t first : {std::size_t{0}, run_.problem.links}) {
      for (const Vector& point : sums(run_.problem, y, first)) {
        for (const Real component : point) std::printf(" %.21Lg", component);
      }
    }
    std::printf("\n");
  }

  Run run_;
  Real limit_, fastest_ = 0;
};

/// odeint's steppers take time beside the state, and hand back a longer step for the next time.
template <class Stepper, class Equations>
int by_odeint(Journey& journey, Stepper stepper, Equations equations) {
  return journey.travel([&](State& y, Real& step) {
    const auto system = [&](const State& x, State& dx, Real) { equations(x, dx); };
    Real time = y.back();
    return stepper.try_step(system, y, time, step) == boost::numeric::odeint::success;
  });
}

int travel(Journey& journey, const std::string& method, Real tolerance) {
  namespace odeint = boost::numeric::odeint;
  const auto tensions = [&](const State& y, State& dy) {
    journey.evaluations += 1;
    tension_form(journey.problem(), y, dy);
  };
  const auto dense = [&](const State& y, State& dy) {
    journey.evaluations += 1;
    dense_form(journey.problem(), y, dy);
  };
  if (method == "extrapolation") {
    return by_odeint(journey, odeint::bulirsch_stoer<State, Real>(tolerance, tolerance, 1, 0), tensions);
  }
  if (method == "fehlberg") {
    using Fehlberg = odeint::runge_kutta_fehlberg78<State, Real>;
    return by_odeint(journey, odeint::make_controlled(tolerance, tolerance, Fehlberg()), dense);
  }
  if (method == "implicit") {
    ImplicitExtrapolation implicit(tensions, tolerance);
    return journey.travel([&](State& y, Real& step) { return implicit.try_step(y, step); });
  }
  std::cerr << "chain_reference: expected extrapolation, fehlberg or implicit, got '" << method << "'\n";
  return 2;
}

}  // namespace
}  // namespace reference

int main(int count, char** words) {
  if (count != 5) {
    std::cerr << "usage: chain_reference METHOD TOLERANCE LIMIT DISTURBANCE < numbers > numbers\n";
    return 2;
  }
  reference::Run run = reference::read_run();
  reference::disturb(run, std::strtold(words[4], nullptr));
  reference::Journey journey(std::move(run), std::strtold(words[3], nullptr));
  return reference::travel(journey, words[1], std::strtold(words[2], nullptr));
}
