#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/run/chain_subject.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula {
namespace {

template <class Space, int S>
using Stepper = GaussStepper<ChainSolver<Space, S>>;

template <class Space>
State<Space> drawn_state(test::Random& random, int links) {
  State<Space> state;
  state.q = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, -3, 3);
  state.v = random.matrix<Eigen::VectorXd>(Space::dof * links, 1, -2, 2);
  return state;
}

template <class Stepper>
Motion run_to(Stepper& stepper, double end) {
  while (end - stepper.time() > 1e-14 * end) {
    const Outcome outcome = stepper.step(end - stepper.time());
    EXPECT_TRUE(outcome) << outcome;
    if (!outcome) break;
  }
  return stepper.state();
}

// Of random chains after two seconds, reached error over tolerance, sorted; the reference is a tolerance of 1e-16. What
// chaos makes of errors by then is part of it: of the planar ones, a factor up to 10⁵.
template <class Space, int S>
std::vector<double> reached_over_asked(double tolerance, int count) {
  test::Random random(1);
  std::vector<double> ratios;
  for (int k = 0; k < count; ++k) {
    const int links = 1 + static_cast<int>(random.uniform(0, 6.999));
    const auto chain = test::random_chain<Space>(random, links);
    const auto start = drawn_state<Space>(random, links);
    Stepper<Space, 8> exact(chain, 8, {.tolerance = 1e-16});
    Stepper<Space, S> stepper(chain, S, {.tolerance = tolerance});
    exact.start(start);
    stepper.start(start);
    ratios.push_back(ChainSubject<Space>(chain).distance(run_to(exact, 2), run_to(stepper, 2)) / tolerance);
  }
  std::ranges::sort(ratios);
  return ratios;
}

struct Spread {
  double within;  // share from 0.01 to 10
  double middle, worst_in_twenty;
};
Spread spread_of(const std::vector<double>& ratios) {
  const auto within = std::ranges::count_if(ratios, [](double ratio) { return ratio > 0.01 && ratio < 10; });
  const auto at = [&](double part) {
    return ratios[static_cast<std::size_t>(part * static_cast<double>(ratios.size()))];
  };
  return {static_cast<double>(within) / static_cast<double>(ratios.size()), at(0.5), at(0.95)};
}

template <class Space, int S>
void expect_control(const std::vector<double>& tolerances, double within, double worst) {
  for (const double tolerance : tolerances) {
    const Spread spread = spread_of(reached_over_asked<Space, S>(tolerance, 100));
    EXPECT_GT(spread.within, within) << tolerance;
    EXPECT_LT(spread.worst_in_twenty, worst) << tolerance;
    EXPECT_LT(spread.middle, 2) << tolerance;  // measured 0.17 to 1.2
    EXPECT_GT(spread.middle, 0.05) << tolerance;
  }
}

TEST(StepControl, ReachesWhatIsAskedFor) {
  expect_control<Planar, 8>({1e-4, 1e-7, 1e-10}, 0.7, 80);   // measured 0.77 at least, 37 at most
  expect_control<Planar, 4>({1e-4, 1e-7}, 0.7, 80);          // measured 0.79, 54
  expect_control<Planar, 2>({1e-4, 1e-6}, 0.8, 60);          // measured 0.83, 40
  expect_control<Spatial, 6>({1e-4, 1e-7, 1e-10}, 0.85, 8);  // measured 0.89, 4.5
}

// A drive that is weak and turns many times in a step that nothing else would shorten: 15 rad, say.
TEST(StepControl, FollowsAWeakDriveThatTurnsOften) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  parameters.drives = {{.link = 0, .amplitude = Torque<Planar, 1>::Constant(0.1), .frequency = 300, .phase = 0}};
  const ChainSubject<Planar> subject{Chain<Planar>(parameters)};
  const auto end = [&](Solver solver, int stages, double tolerance) {
    RunOptions options{.stages = stages, .solver = solver, .step = 0, .tolerance = tolerance};
    const auto integrator = subject.make_integrator(options);
    EXPECT_TRUE(integrator->start(Motion(0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1))));
    while (integrator->time() < 5) {
      if (!integrator->step(5 - integrator->time())) break;
    }
    return integrator->state();
  };
  const Motion exact = end(Solver::chain, 8, 1e-13);
  for (const int stages : {4, 6, 8}) {
    for (const Solver solver : {Solver::chain, Solver::dense}) {
      EXPECT_LT(subject.distance(end(solver, stages, 1e-6), exact), 1e-6) << stages << solver;  // measured 4.9e-8
    }
  }
}

// Drives that turn often in a step that few stages would take otherwise, and such as balance gravity at times.
TEST(StepControl, FewStagesFollowDrives) {
  struct Drive {
    double amplitude, frequency;
  };
  for (const Drive& drive : {Drive{1, 30}, Drive{5, 3}, Drive{30, 30}, Drive{0.1, 300}}) {
    ChainParameters<Planar> parameters;
    parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
    const auto amplitude = Torque<Planar, 1>::Constant(drive.amplitude);
    parameters.drives = {{.link = 0, .amplitude = amplitude, .frequency = drive.frequency, .phase = 0}};
    const ChainSubject<Planar> subject{Chain<Planar>(parameters)};
    const auto end = [&](RunOptions options) {
      options.step = 0;
      const auto integrator = subject.make_integrator(options);
      EXPECT_TRUE(integrator->start(Motion(0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1))));
      while (integrator->time() < 10) {
        if (!integrator->step(10 - integrator->time())) break;
      }
      return integrator->state();
    };
    const Motion exact = end({.stages = 8, .tolerance = 1e-14});
    const auto expect_close = [&](RunOptions options, double most) {
      for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
        options.tolerance = tolerance;
        EXPECT_LT(subject.distance(end(options), exact), most * tolerance)  // measured 1.9 tolerances
            << drive.amplitude << " sin(" << drive.frequency << " t), " << options.method << ' ' << options.solver
            << ' ' << options.stages << ", " << tolerance;
      }
    };
    for (const Solver solver : {Solver::chain, Solver::dense}) {
      expect_close({.stages = 2, .solver = solver}, 3);
      expect_close({.stages = 3, .solver = solver}, 3);
    }
    expect_close({.method = Method::radau, .stages = 3}, 3);
    expect_close({.stages = 2, .form = Form::velocity, .solver = Solver::dense}, 3);
  }
}

// Where a swing turns, nothing but its acceleration is left of it.
TEST(StepControl, TakesNoTinyStepsWhereASwingTurns) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  const Chain<Planar> chain(parameters);
  const auto start = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 1.6));
  Stepper<Planar, 8> exact(chain, 8, {.tolerance = 1e-15});
  exact.start(start);
  const Motion end = run_to(exact, 10);
  const auto expect_few = [&]<int S>(std::integral_constant<int, S>, std::int64_t most) {
    Stepper<Planar, S> stepper(chain, S, {.tolerance = 1e-8});
    stepper.start(start);
    EXPECT_LT(ChainSubject<Planar>(chain).distance(run_to(stepper, 10), end), 1e-7) << S;  // measured 1.2e-9
    EXPECT_LT(stepper.statistics().steps, most) << S;
  };
  expect_few(std::integral_constant<int, 2>(), 30000);  // measured 13619
  expect_few(std::integral_constant<int, 3>(), 6000);   // measured 2688
  expect_few(std::integral_constant<int, 4>(), 1000);   // measured 376
}

// Two links, let go high: chaos. Largest energy error, relative, over each tenth of a run.
std::vector<double> energy_by_tenths(const StepperOptions& options, int steps) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d::Ones();
  const Chain<Planar> chain(parameters);
  Stepper<Planar, 4> stepper(chain, 4, options);
  stepper.start(State<Planar>::from_angles(Eigen::Vector2d::Constant(2.5)));
  const double start = energies(chain, stepper.state()).total();
  std::vector<double> tenths(10);
  for (int k = 0; k < steps; ++k) {
    EXPECT_TRUE(stepper.step(1e9));
    double& tenth = tenths[static_cast<std::size_t>(10.0 * k / steps)];
    tenth = std::max(tenth, std::abs(energies(chain, stepper.state()).total() - start) / energy_scale(chain));
  }
  return tenths;
}

TEST(StepControl, SymmetricStepsDoNotDriftWhereGreedyOnesDo) {
  const auto greedy = energy_by_tenths({.tolerance = 1e-6, .steering = Steering::greedy}, 60000);
  const auto symmetric = energy_by_tenths({.tolerance = 1e-6}, 60000);
  EXPECT_GT(greedy[9] / greedy[0], 7);        // measured 13.4: it goes on as it began
  EXPECT_LT(symmetric[9] / symmetric[0], 7);  // measured 3.6, of chaos
  EXPECT_LT(symmetric[9] / greedy[9], 0.05);  // measured 0.008
}

// Forward and back: how far from its start, relative, a run of three links ends.
double left_behind(const StepperOptions& options) {
  test::Random random(3);
  const auto chain = test::random_chain<Spatial>(random, 3);
  Stepper<Spatial, 6> stepper(chain, 6, options);
  stepper.start(drawn_state<Spatial>(random, 3));
  for (int k = 0; k < 140; ++k) stepper.step(1e9);
  const Motion there = stepper.state();
  for (int k = 0; k < 50; ++k) stepper.step(1e9);
  stepper.turn_back();
  for (int k = 0; k < 50; ++k) stepper.step(1e9);
  Motion back = stepper.state();
  back.v = -back.v;
  back.time = there.time;
  return ChainSubject<Spatial>(chain).distance(there, back);
}

TEST(StepControl, ASymmetricRunReturns) {
  EXPECT_LT(left_behind({.tolerance = 1e-6}), 1e-12);                               // measured 2.2e-15
  EXPECT_GT(left_behind({.tolerance = 1e-6, .steering = Steering::greedy}), 1e-3);  // measured 0.07
}

// A step that is looked into, from 0 to 1 of it: distance of what is found from a step that ends there.
template <class Space, int S, class Find>
double farthest_in_step(double h, Find find) {
  test::Random random(5);
  const auto chain = test::random_chain<Space>(random, 3);
  const auto start = drawn_state<Space>(random, 3);
  double farthest = 0;
  for (const double part : {0.0, 0.1, 0.37, 0.5, 0.81, 1.0}) {
    Stepper<Space, S> stepper(chain, S);
    Stepper<Space, 8> exact(chain, 8);
    stepper.start(start);
    exact.start(start);
    stepper.remember_steps(true);
    stepper.step(h);
    for (int k = 0; k < 8 && part > 0; ++k) exact.step(part * h / 8);
    farthest = std::max(farthest, ChainSubject<Space>(chain).distance(exact.state(), find(stepper, part * h)));
  }
  return farthest;
}
template <class Space, int S>
double farthest_at(double h) {
  return farthest_in_step<Space, S>(h, [](auto& stepper, double time) { return stepper.at(time); });
}
template <class Space, int S>
double farthest_at_full_order(double h) {
  return farthest_in_step<Space, S>(h, [](auto& stepper, double time) {
    State<Space> there;
    EXPECT_TRUE(stepper.at_full_order(time, there));
    return there;
  });
}

// Halving the step: rates are of order s within a step, looks of order 2 s + 1 as one step is.
TEST(DenseOutput, HasItsOrders) {
  EXPECT_NEAR(std::log2(farthest_at<Planar, 3>(0.02) / farthest_at<Planar, 3>(0.01)), 3, 0.3);
  EXPECT_NEAR(std::log2(farthest_at<Spatial, 4>(0.04) / farthest_at<Spatial, 4>(0.02)), 4, 0.5);
  EXPECT_NEAR(std::log2(farthest_at_full_order<Planar, 2>(0.02) / farthest_at_full_order<Planar, 2>(0.01)), 5, 0.5);
  EXPECT_NEAR(std::log2(farthest_at_full_order<Spatial, 3>(0.04) / farthest_at_full_order<Spatial, 3>(0.02)), 7, 1);
  EXPECT_LT((farthest_at_full_order<Planar, 8>(0.02)), 1e-13);
  EXPECT_LT((farthest_at_full_order<Spatial, 8>(0.02)), 1e-13);
}

TEST(DenseOutput, LeavesTheRunAsItIs) {
  test::Random random(6);
  const auto chain = test::random_chain<Spatial>(random, 4);
  const auto start = drawn_state<Spatial>(random, 4);
  Stepper<Spatial, 6> plain(chain, 6, {.tolerance = 1e-9}), looked(chain, 6, {.tolerance = 1e-9});
  plain.start(start);
  looked.start(start);
  looked.remember_steps(true);
  for (int k = 0; k < 200; ++k) {
    const double before = looked.time();
    plain.step(1e9);
    looked.step(1e9);
    State<Spatial> there;
    for (const double part : {0.9, 0.2}) {
      EXPECT_TRUE(looked.at_full_order(before + part * (looked.time() - before), there));
      looked.at(before + part * (looked.time() - before));
    }
    ASSERT_EQ(member_of(plain), member_of(looked)) << k;
  }
}

// A step that is taken in parts has no polynomial of its own.
// A look a moment after the step's start knows the stages of that moment only, which are no prediction of later ones.
TEST(DenseOutput, DependsOnNoLookBefore) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Constant(1, 0.5);
  const ChainSubject<Planar> subject{Chain<Planar>(parameters)};
  const Motion start(0, Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, -2.0));
  const auto looks = [&](const RunOptions& options, const std::vector<double>& shares) {
    const auto integrator = subject.make_integrator(options);
    EXPECT_TRUE(integrator->start(start));
    integrator->remember_steps(true);
    for (int step = 0; step < 3; ++step) EXPECT_TRUE(integrator->step(0.2));
    Motion motion;
    for (const double share : shares) EXPECT_TRUE(integrator->at_full_order(0.4 + 0.2 * share, motion));
    return motion;
  };
  for (const Iteration iteration : {Iteration::automatic, Iteration::fixed_point, Iteration::newton}) {
    for (const RunOptions& options : {RunOptions{.stages = 8, .solver = Solver::chain, .iteration = iteration},
                                      RunOptions{.stages = 8, .solver = Solver::dense, .iteration = iteration},
                                      RunOptions{.stages = 4, .solver = Solver::dense, .iteration = iteration},
                                      RunOptions{.stages = 8, .form = Form::velocity, .solver = Solver::dense}}) {
      for (const double share : {0.07, 0.5, 0.9}) {
        const Motion alone = looks(options, {share});
        for (const double before : {1e-12, 1e-9, 1e-6, 1e-3}) {
          EXPECT_LT(subject.distance(looks(options, {before, share}), alone), 1e-13)  // measured 0
              << options.solver << ' ' << options.form << ' ' << options.iteration << ' ' << options.stages << ", "
              << before << " and " << share;
        }
      }
    }
  }
}

TEST(DenseOutput, KnowsStepsThatWereTakenInParts) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d::Ones();
  const Chain<Planar> chain(parameters);
  const auto start = State<Planar>::from_angles(Eigen::Vector2d(1, 2), Eigen::Vector2d(3, -2));
  Stepper<Planar, 8> stepper(chain, 8), exact(chain, 8);
  stepper.remember_steps(true);
  stepper.start(start);
  ASSERT_TRUE(stepper.step(1));
  ASSERT_GT(stepper.statistics().rejected_steps, 0);
  exact.start(start);
  exact.step(0.6);
  State<Planar> there;
  ASSERT_TRUE(stepper.at_full_order(0.6, there));
  const ChainSubject<Planar> subject(chain);
  EXPECT_LT(subject.distance(exact.state(), there), 1e-13);            // measured 0
  EXPECT_LT(subject.distance(exact.state(), stepper.at(0.6)), 1e-13);  // measured 0
}

// What hardly moves has no step that is too long: upright, rounding alone makes it fall.
TEST(StepControl, DoesNotStallWhereNothingMoves) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::Vector2d::Ones();
  const Chain<Planar> chain(parameters);
  for (const double angle : {0.0, 3.141592653589793}) {
    Stepper<Planar, 8> stepper(chain, 8, {.tolerance = 1e-9});
    stepper.start(State<Planar>::from_angles(Eigen::Vector2d::Constant(angle)));
    run_to(stepper, 20);
    EXPECT_LT(stepper.statistics().steps, 1000) << angle;  // measured 8, 398
  }
}

}  // namespace
}  // namespace pendula
