#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>
#include <vector>

namespace pendula::test {

inline RunOptions gauss(int stages, Form form = Form::momentum) {
  RunOptions options;
  options.stages = stages;
  options.form = form;
  options.solver = Solver::dense;
  return options;
}

/// Runs to `duration` and gives the last state; a failing step fails the test.
template <class Space>
State<Space> final_state(const Chain<Space>& chain, const State<Space>& start, const RunOptions& options, double step,
                         double duration) {
  const auto integrator = make_integrator(chain, options);
  const auto every = std::numeric_limits<std::int64_t>::max();
  const RunResult result = simulate(*integrator, start, {step, duration, every}, [](const State<Space>&) {});
  EXPECT_TRUE(result.outcome) << result.outcome;
  return integrator->state();
}

/// Largest difference of any angle or rate.
template <class A, class B>
double distance(const A& a, const B& b) {
  return std::max((a.q - b.q).cwiseAbs().maxCoeff(), (a.v - b.v).cwiseAbs().maxCoeff());
}

/// Errors of a method at step sizes that halve from one to the next.
struct ErrorLadder {
  std::vector<double> steps, errors;

  /// Order from the slope of log error over log step by least squares, over the rungs above the round-off plateau;
  /// NaN if fewer than three are left.
  double slope(double plateau) const {
    std::vector<double> x, y;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      if (errors[i] <= plateau) break;
      x.push_back(std::log(steps[i]));
      y.push_back(std::log(errors[i]));
    }
    if (x.size() < 3) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::Map<Eigen::ArrayXd> X(x.data(), static_cast<Eigen::Index>(x.size()));
    const Eigen::Map<Eigen::ArrayXd> Y(y.data(), static_cast<Eigen::Index>(y.size()));
    return ((X - X.mean()) * (Y - Y.mean())).sum() / (X - X.mean()).square().sum();
  }
};

}  // namespace pendula::test
