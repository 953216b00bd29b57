#pragma once

#include <array>
#include <boost/numeric/odeint.hpp>
#include <chain_equations.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <implicit_extrapolation.hpp>
#include <iostream>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

namespace reference {

static_assert(std::numeric_limits<Real>::digits >= 64, "references need the 80-bit long double of x86");

/// The next number of standard input; hexadecimal ones too, as Python writes them.
inline Real next() {
  std::string word;
  std::cin >> word;
  char* end = nullptr;
  const Real value = std::strtold(word.c_str(), &end);
  if (!std::cin || word.empty() || *end != '\0') {
    std::cerr << "expected a number, got '" << word << "'\n";
    std::exit(2);
  }
  return value;
}

inline std::size_t count() {
  return static_cast<std::size_t>(next());
}

/// Goes through time. What moves is a Mover: `longest(y)`, the longest step that is allowed from there; `project(y)`,
/// back to what its constraints allow; `pass(before, now)`, called at the end of each step; `row(now, from)`, the
/// numbers that a look at `now` gives, a part of a step after `from`, the last state that was passed.
template <class Mover>
class Journey {
 public:
  Journey(Mover mover, State start, std::vector<Real> times, Real limit)
      : mover_(std::move(mover)), y_(std::move(start)), times_(std::move(times)), limit_(limit) {}

  Mover& mover() { return mover_; }
  void count_evaluation() { evaluations_ += 1; }

  /// From time to time by `try_step(y, step)`, which moves y or shortens the step; `tell(y)` at each of them, and
  /// `seen(before, now)` after each step. Returns the exit status of the program.
  template <class TryStep, class Tell, class Seen>
  int travel(TryStep try_step, Tell tell, Seen seen) {
    Real step = 1e-6L;
    for (const Real until : times_) {
      while (y_.back() < until) {
        step = std::min(step, mover_.longest(y_));
        const Real wanted = step;
        const bool last = y_.back() + step >= until;
        if (last) step = until - y_.back();
        before_ = y_;
        const bool moved = try_step(y_, step);
        if (evaluations_ > limit_ || (!moved && step < 1e-15L)) return 3;
        if (!moved) continue;
        if (last) y_.back() = until;
        mover_.project(y_);
        seen(before_, y_);
        mover_.pass(before_, y_);
        if (last) step = std::max(step, wanted);
      }
      tell(y_);
    }
    return 0;
  }

  /// The numbers at places of each step, as many as `nodes`, both its ends among them, where Chebyshev polynomials have
  /// their extrema; by steps of `try_step` from one to the next.
  template <class TryStep>
  bool look_along(TryStep try_step, const State& before, const State& now, std::size_t nodes) {
    State y = before;
    tell(y, before);
    const Real from = before.back(), whole = now.back() - from;
    for (std::size_t k = 1; k + 1 < nodes; ++k) {
      const Real part = (1 - std::cos(std::numbers::pi_v<Real> * Real(k) / Real(nodes - 1))) / 2;
      const Real until = from + part * whole;
      Real step = until - y.back();
      while (y.back() < until) {
        const bool last = y.back() + step >= until;
        if (last) step = until - y.back();
        const bool moved = try_step(y, step);
        if (evaluations_ > limit_ || (!moved && step < 1e-17L)) return false;
        if (moved && last) y.back() = until;
      }
      mover_.project(y);
      tell(y, before);
    }
    tell(now, before);
    return true;
  }

  void tell(const State& y, const State& from) const {
    const std::vector<Real> row = mover_.row(y, from);
    std::fwrite(row.data(), sizeof(Real), row.size(), stdout);
  }

 private:
  Mover mover_;
  State y_, before_;
  std::vector<Real> times_;
  Real limit_, evaluations_ = 0;
};

/// How a journey is told.
enum class Telling {
  lines,   ///< a line a time, by the mover's `print`
  states,  ///< rows of long doubles, as they lie in memory, a row a time
  dense    ///< such rows at 20 places of each step
};

/// By one of odeint's steppers: they take time beside the state, and hand back a longer step for the next time.
/// `equations` and `differentiate(y, matrix)` are counted.
template <class Mover, class Equations, class Differentiate>
int travel(Journey<Mover>& journey, const std::string& method, Real tolerance, Telling telling, Equations equations,
           Differentiate differentiate) {
  namespace odeint = boost::numeric::odeint;
  constexpr std::size_t nodes = 20;
  const auto counted = [&](const State& y, State& dy) {
    journey.count_evaluation();
    equations(y, dy);
  };
  const auto go = [&](auto steps, auto looks) {  // the same method twice: it remembers what steps it took
    bool seen_all = true;
    const int status = journey.travel(
        steps,
        [&](const State& y) {
          if (telling == Telling::lines) journey.mover().print(y);
          if (telling == Telling::states) journey.tell(y, y);
        },
        [&](const State& before, const State& now) {
          if (telling == Telling::dense) seen_all = seen_all && journey.look_along(looks, before, now, nodes);
        });
    return seen_all ? status : 3;
  };
  const auto by_odeint = [&](auto stepper) {
    const auto steps = [&counted](auto& own) {
      return [&counted, &own](State& y, Real& step) {
        const auto system = [&](const State& x, State& dx, Real) { counted(x, dx); };
        Real time = y.back();
        return own.try_step(system, y, time, step) == odeint::success;
      };
    };
    auto other = stepper;
    return go(steps(stepper), steps(other));
  };
  if (method == "extrapolation") {
    return by_odeint(odeint::bulirsch_stoer<State, Real>(tolerance, tolerance, 1, 0));
  }
  if (method == "fehlberg") {
    using Fehlberg = odeint::runge_kutta_fehlberg78<State, Real>;
    return by_odeint(odeint::make_controlled(tolerance, tolerance, Fehlberg()));
  }
  if (method == "implicit") {
    ImplicitExtrapolation implicit(counted, differentiate, tolerance);
    const auto step = [&](State& y, Real& size) { return implicit.try_step(y, size); };
    return go(step, step);
  }
  std::cerr << "expected extrapolation, fehlberg or implicit, got '" << method << "'\n";
  return 2;
}

}  // namespace reference
