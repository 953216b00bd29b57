#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/chain_variation.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/numeric/directions.hpp>

#include "support/random_chain.hpp"

namespace pendula::test {

/// f'(0) by central differences of order 6.
template <class F>
auto difference_quotient(const F& f, double h) {
  using Real = typename decltype(f(0.0))::Scalar;
  const auto pair = [&](int k) { return (f(k * h) - f(-k * h)).eval(); };
  return ((45 * pair(1) - 9 * pair(2) + pair(3)) / (60 * Real(h))).eval();
}

template <class A, class B>
double distance(const A& a, const B& b) {
  return static_cast<double>((a - b).cwiseAbs().maxCoeff()) /
         std::max(1.0, static_cast<double>(b.cwiseAbs().maxCoeff()));
}

/// Σ δû·δμ' − δμ·δû' of all pairs of columns.
template <class Real>
Directions<Real> symplectic_form(const Directions<Real>& tangents) {
  const Eigen::Index half = tangents.rows() / 2;
  const Directions<Real> product = tangents.topRows(half).transpose() * tangents.bottomRows(half);
  return product - product.transpose();
}

template <class Real = double>
Directions<Real> identity(Eigen::Index size) {
  return Directions<Real>::Identity(size, size);
}

/// The chain with parameter k, as chain_tangent.hpp numbers them, changed by `change`.
template <class Space>
Chain<Space> varied(const Chain<Space>& chain, int k, double change) {
  ChainParameters<Space> parameters{chain.masses(),  chain.lengths(),         chain.gravity(),
                                    chain.damping(), chain.constant_torque(), chain.drives()};
  const int n = chain.links();
  if (k < n) {
    parameters.masses[k] += change;
  } else if (k < 2 * n) {
    parameters.lengths[k - n] += change;
  } else if (k < 3 * n) {
    parameters.damping[k - 2 * n] += change;
  } else if (k == 3 * n) {
    parameters.gravity += change;
  } else {
    parameters.torque.data()[k - 3 * n - 1] += change;
  }
  return Chain<Space>(parameters);
}

/// A chain moved by steppers of S stages, with the derivative of all of its steps in angles and rates.
template <class Space, int S, class Number = double>
class ChainRun {
 public:
  using Real = Number;
  using ChainState = State<Space, Eigen::Dynamic, Real>;
  using Numbers = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  ChainRun(const Chain<Space>& chain, const ChainState& start, double step, int steps = 1,
           Iteration iteration = Iteration::newton)
      : chain_(chain), start_(start), step_(step), steps_(steps), iteration_(iteration) {}

  Eigen::Index size() const { return 2 * start_.q.size(); }

  Numbers end(const Chain<Space>& chain, const Numbers& start) const {
    GaussStepper<ChainSolver<Space, S, Eigen::Dynamic, Real>> stepper(chain, S, {}, iteration_);
    const Eigen::Index half = size() / 2;
    EXPECT_TRUE(stepper.start({start_.time, start.head(half), start.tail(half)}));
    for (int k = 0; k < steps_; ++k) EXPECT_TRUE(stepper.step(step_));
    Numbers end(size());
    end << stepper.state().q, stepper.state().v;
    return end;
  }

  Numbers start() const {
    Numbers start(size());
    start << start_.q, start_.v;
    return start;
  }

  /// By differences, of start and of parameters.
  Directions<Real> differences() const {
    Directions<Real> columns(size(), size());
    for (Eigen::Index k = 0; k < size(); ++k) {
      const auto at = [&](double change) { return end(chain_, start() + Real(change) * Numbers::Unit(size(), k)); };
      columns.col(k) = difference_quotient(at, reach);
    }
    return columns;
  }
  Directions<Real> parameter_differences(int count) const {
    Directions<Real> columns(size(), count);
    for (int k = 0; k < count; ++k) {
      const auto at = [&](double change) { return end(varied(chain_, k, change), start()); };
      columns.col(k) = difference_quotient(at, reach);
    }
    return columns;
  }

  /// By tangents.
  struct Found {
    Directions<Real> of_start, of_parameters;
    std::int64_t rejected = 0;
  };
  Found tangents() const {
    GaussStepper<ChainSolver<Space, S, Eigen::Dynamic, Real>> stepper(chain_, S, {}, iteration_);
    stepper.linearize();
    EXPECT_TRUE(stepper.start(start_));
    auto& step = stepper.linearization();
    const auto parameters = identity<Real>(step.parameters());
    ChainVariation<Space, Real> at_start(chain_, start_);
    Directions<Real> tangents, sensitivities;
    at_start.tangents(identity<Real>(size()), tangents);
    at_start.tangents(Directions<Real>::Zero(size(), step.parameters()), sensitivities, parameters);
    for (int k = 0; k < steps_; ++k) {
      EXPECT_TRUE(stepper.step(step_));
      step.push(tangents);
      step.push(sensitivities, parameters);
    }
    Found found;
    ChainVariation<Space, Real> at_end(chain_, stepper.state());
    at_end.rates(tangents, found.of_start);
    at_end.rates(sensitivities, found.of_parameters, parameters);
    found.rejected = stepper.statistics().rejected_steps;
    return found;
  }

 private:
  // Truncation is near reach⁶, a power of two leaves parameters exact.
  static constexpr double reach = 1.0 / 512;

  Chain<Space> chain_;
  ChainState start_;
  double step_;
  int steps_;
  Iteration iteration_;
};

}  // namespace pendula::test
