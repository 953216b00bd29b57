#include <gtest/gtest.h>

#include <pendula/pendula.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <pendula/kernels/cart_chain_1.hpp>
#include <pendula/kernels/four_bar.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/own_model.hpp>
#include <pendula/pendula.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/lyapunov.hpp>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <vector>

#include "support/random_chain.hpp"

namespace pendula {
namespace {

using test::equal_chain;

Motion let_go(double angle = 2.0) {
  return {0, Eigen::Vector2d(angle, angle - 0.4), Eigen::Vector2d(0.1, -0.2)};
}

double apart(const Motion& a, const Motion& b) {
  return (a.q - b.q).norm() + (a.v - b.v).norm();
}

bool same(const Motion& a, const Motion& b) {
  return a.time == b.time && a.q == b.q && a.v == b.v;
}

/// By constant steps of 16th order, far below every bound here.
Motion reference(double time) {
  Simulation run(equal_chain<Planar>(2), let_go(), {.stages = 8, .step = 1e-3});
  run.advance_to(time);
  return run.motion();
}

TEST(Simulation, IsAsAccurateAsItsTolerance) {
  Simulation run(equal_chain<Planar>(2), let_go(), {.tolerance = 1e-9});
  EXPECT_TRUE(run.advance_to(1));
  EXPECT_EQ(run.time(), 1);
  EXPECT_LT(run.steps(), 20);                          // measured 7
  EXPECT_LT(apart(run.motion(), reference(1)), 5e-9);  // measured 4.4e-10
}

TEST(Simulation, IsThatOfTheIntegratorByConstantSteps) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  Simulation run(chain, let_go(), {.stages = 2, .step = 0.01});
  const auto integrator = make_integrator(chain, {.stages = 2, .step = 0.01});
  ASSERT_TRUE(integrator->start(let_go()));
  for (int step = 0; step < 100; ++step) ASSERT_TRUE(integrator->step(0.01));
  run.advance_to(1);
  EXPECT_LT(apart(run.motion(), integrator->state()), 1e-13);  // measured 0
}

TEST(Simulation, LooksBackAtFullOrder) {
  for (const SimulationOptions& options :
       {SimulationOptions{}, {.stages = 6, .step = 0.02}, {.method = Method::taylor}, {.method = Method::dopri5}}) {
    Simulation run(equal_chain<Planar>(2), let_go(), options);
    run.advance_to(1);
    for (const double time : {0.0, 0.31, 0.517, 0.9, 1.0}) {
      EXPECT_EQ(run.at(time).time, time);
      EXPECT_LT(apart(run.at(time), reference(time)), 2e-7)
          << options.method << ' ' << time;  // measured 1.4e-8, of dopri5
    }
    EXPECT_THROW(run.at(1.1), std::invalid_argument);
  }
}

TEST(Simulation, ForgetsStepsWhereThatIsAsked) {
  Simulation run(equal_chain<Planar>(2), let_go(), {.remember = false});
  run.advance_to(1);
  EXPECT_TRUE(same(run.at(1), run.motion()));
  EXPECT_THROW(run.at(0.5), std::invalid_argument);
}

TEST(Simulation, ACopyGoesOnToTheBit) {
  int first = 0, second = 0;
  Simulation run(equal_chain<Planar>(2), let_go());
  int* told = &first;
  run.on({.value = [](const Motion& m) { return m.q[1]; }}, [&](const Motion&) { ++*told; });
  run.advance_to(3);
  Simulation copy = run;
  EXPECT_TRUE(same(copy.motion(), run.motion()));
  run.advance_to(7);
  const int until_seven = first;
  told = &second;
  copy.advance_to(7);
  EXPECT_TRUE(same(copy.motion(), run.motion()));
  EXPECT_TRUE(same(copy.at(1.7), run.at(1.7)));
  EXPECT_GT(second, 0);
  EXPECT_LT(second, until_seven);  // the copy tells what happens from there on
}

TEST(Simulation, ResumesToTheBit) {
  Simulation run(equal_chain<Planar>(2), let_go()), other(equal_chain<Planar>(2), let_go(1));
  run.advance_to(2);
  other.resume(run.save());
  run.advance_to(5);
  other.advance_to(5);
  EXPECT_TRUE(same(other.motion(), run.motion()));
  EXPECT_THROW(other.resume({{1, 2, 3}}), std::invalid_argument);
}

TEST(Simulation, TellsEventsWhereTheyHappen) {
  std::vector<double> times;
  Simulation run(equal_chain<Planar>(1), {0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1)});
  run.on({.value = [](const Motion& m) { return m.q[0]; }, .direction = Direction::down},
         [&](const Motion& m) { times.push_back(m.time); });
  run.advance_to(5);
  ASSERT_EQ(times.size(), 3U);
  const double period = times[1] - times[0];
  EXPECT_NEAR(times[0], period / 4, 1e-12);         // measured 4.4e-14
  EXPECT_NEAR(times[2] - times[1], period, 1e-12);  // measured 4.2e-14
}

TEST(Simulation, StopsAtAnEventAndGoesOn) {
  int told = 0;
  Simulation run(equal_chain<Planar>(1), {0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1)});
  const std::size_t lowest =
      run.on({.value = [](const Motion& m) { return m.q[0]; }, .stop = true}, [&](const Motion&) { ++told; });
  for (int half = 1; half <= 4; ++half) {
    EXPECT_FALSE(run.advance_to(100));
    EXPECT_EQ(run.stopped_by(), lowest);
    EXPECT_EQ(told, half);
    EXPECT_LT(std::abs(run.motion().q[0]), 1e-14);  // measured 1.1e-16
  }
  EXPECT_TRUE(run.advance_to(run.time() + 0.1));
  EXPECT_EQ(run.stopped_by(), std::nullopt);
}

// A ball on a rod that is thrown back where it hangs, twice as fast as it loses nothing: half a swing for ever.
TEST(Simulation, GoesOnAfterAnImpact) {
  const Model model = equal_chain<Planar>(1);
  Simulation run(model, {0, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1)});
  run.on({.value = [](const Motion& m) { return m.q[0]; }, .direction = Direction::down, .stop = true});
  const double energy = run["energy"];
  for (int bounce = 0; bounce < 3; ++bounce) {
    ASSERT_FALSE(run.advance_to(100));
    Motion thrown_back = run.motion();
    EXPECT_LT(thrown_back.v[0], 0);
    thrown_back.v = -thrown_back.v;
    run.restart(thrown_back);
  }
  EXPECT_NEAR(run["energy"], energy, 1e-12);  // measured 7.1e-15
}

TEST(Simulation, ThrowsWhatCallbacksThrow) {
  struct Odd {};
  Simulation run(equal_chain<Planar>(2), let_go());
  run.on({.value = [](const Motion& m) { return m.q[1]; }}, [](const Motion&) { throw Odd(); });
  EXPECT_THROW(run.advance_to(5), Odd);
  EXPECT_LT(run.time(), 2);
  Simulation one(equal_chain<Planar>(2), let_go());
  one.on({.value = [](const Motion& m) { return m.time > 1 ? throw Odd() : 1.0; }});
  EXPECT_THROW(one.advance_to(1e3), Odd);
  EXPECT_LT(one.time(), 2);
  Simulation other(equal_chain<Planar>(2), let_go());
  other.on_rows(every(0.1), [](std::span<const double> numbers) {
    if (numbers[0] > 0.55) throw Odd();
  });
  EXPECT_THROW(other.advance_to(5), Odd);
  EXPECT_LT(other.time(), 1);
}

TEST(Simulation, WritesRowsWhateverTheStepsAre) {
  const std::string file = testing::TempDir() + "simulation_rows.csv";
  Simulation run(equal_chain<Planar>(2), let_go());
  std::vector<std::vector<double>> rows;
  run.write_csv(file, every(0.25));
  run.on_rows(every(0.5), [&](std::span<const double> numbers) { rows.emplace_back(numbers.begin(), numbers.end()); });
  run.advance_to(0.7);
  run.advance_to(2);
  run.finish();
  ASSERT_EQ(rows.size(), 5U);
  EXPECT_EQ(rows[3][0], 1.5);
  EXPECT_LT(std::abs(rows[3][1] - reference(1.5).q[0]), 1e-9);  // measured 3.2e-11
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 10U);
  EXPECT_EQ(lines[0], "t,theta_1,theta_dot_1,theta_2,theta_dot_2,x_1,y_1,x_2,y_2,energy");
  EXPECT_TRUE(lines[3].starts_with("0.5,"));
  std::remove(file.c_str());
  EXPECT_THROW(run.write_csv("/nowhere/rows.csv", every(0.1)), std::runtime_error);
}

TEST(Simulation, RowsThatAreNotAskedForRightLeaveTheFileAsItWas) {
  const std::string file = testing::TempDir() + "simulation_kept.csv";
  std::ofstream(file) << "precious\n";
  Simulation run(equal_chain<Planar>(2), let_go());
  EXPECT_THROW(run.write_csv(file, every(0)), std::invalid_argument);
  std::string line;
  std::getline(std::ifstream(file), line);
  EXPECT_EQ(line, "precious");
  std::remove(file.c_str());
}

TEST(Simulation, StopsWhereThatIsRequested) {
  std::stop_source source;
  Simulation run(equal_chain<Planar>(2), let_go());
  run.heed(source.get_token());
  run.on_rows(every(0.1), [&](std::span<const double> numbers) {
    if (numbers[0] > 0.95) source.request_stop();
  });
  EXPECT_FALSE(run.advance_to(100));
  EXPECT_LT(run.time(), 2);
}

// The derivative of the field against its differences; inputs of a chain are its torques.
TEST(Simulation, LinearizesExactly) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  Simulation run(chain, let_go());
  const auto [a, b] = run.linearize();
  EXPECT_EQ(run.independent(), (std::vector{0, 1, 2, 3}));
  ASSERT_EQ(a.rows(), 4);
  ASSERT_EQ(b.cols(), 2);
  const auto field = [&](const Eigen::Vector4d& x, double torque_2) {
    ChainParameters<Planar> parameters{.masses = chain.masses(), .lengths = chain.lengths()};
    parameters.torque = Torque<Planar, Eigen::Dynamic>::Zero(1, 2);
    parameters.torque(0, 1) = torque_2;
    // By the accelerations of a step that is next to nothing.
    Simulation beside(Chain<Planar>(parameters), {0, x.head(2), x.tail(2)}, {.stages = 1, .step = 1e-5});
    beside.advance_to(1e-5);
    Eigen::Vector4d rate;
    rate << (beside.motion().q - x.head(2)) / 1e-5, (beside.motion().v - x.tail(2)) / 1e-5;
    return rate;
  };
  Eigen::Vector4d x;
  x << let_go().q, let_go().v;
  constexpr double h = 1e-3;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector4d unit = Eigen::Vector4d::Unit(k);
    const Eigen::Vector4d column = (field(x + h * unit, 0) - field(x - h * unit, 0)) / (2 * h);
    EXPECT_LT((column - a.col(k)).norm(), 1e-3) << k;  // measured 1.2e-4, of the differences
  }
  EXPECT_LT(((field(x, 1) - field(x, 0)) - b.col(1)).norm(), 1e-4);  // measured 1e-5, of the same
}

TEST(Simulation, SaysWhatIsWrong) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const auto says = [](auto act, const std::string& what) {
    try {
      act();
      ADD_FAILURE() << "nothing was thrown: " << what;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  const Motion three(0, Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones());
  says([&] { Simulation(chain, three); }, "q: expected 2 numbers, got 3");
  says([&] { Simulation(chain, let_go(), {.stages = 99}); }, "expected 1 to 8");
  says([&] { Simulation(chain, let_go(), {.step = -1}); }, "step: expected a number, not negative");
  says([&] { Simulation(chain, let_go(), {.method = Method::rk4}); }, "rk4 has none of its own choice");
  Simulation run(chain, let_go());
  run.advance_to(1);
  says([&] { run.advance_to(0.5); }, "time: expected at least 1 s, which it is, got 0.5");
  says([&] { return run["x_3"]; }, "column: expected one of t, theta_1");
  says([&] { run.on({}); }, "value: expected a function");
  says([&] { run.hold("torque_3", 1); }, "input: expected one of torque_1, torque_2, got torque_3");
  says([&] { run.hold("torque_2", NAN); }, "torque_2: expected a finite number, got nan");
  says([&] { run.hold(Eigen::Vector3d::Zero()); }, "inputs: expected 2 numbers, got 3");
  says([&] { run.on_rows(every(0), [](std::span<const double>) {}); }, "rows: expected an interval");
  EXPECT_THROW(Simulation(equal_chain<Planar>(77), {0, Eigen::VectorXd::Ones(77), Eigen::VectorXd::Ones(77)},
                          {.solver = Solver::dense}),
               NoKernel);
  // A link at its pole; of two, whose kernel builds with sanitizers have, too.
  EXPECT_THROW(Simulation(equal_chain<Spatial>(2), {0, Eigen::Vector4d(0, 0.5, 1, 1), Eigen::Vector4d::Zero()},
                          {.solver = Solver::dense}),
               RunFailed);
}

using Cart = kernels::CartChain1;

/// A bob of 0.5 kg on a rod of 0.8 m, on a cart of 2 kg.
Model cart() {
  Cart::Parameters<double> parameters{};
  parameters.masses.setConstant(0.5);
  parameters.lengths.setConstant(0.8);
  parameters.damping.setConstant(0);
  parameters.cart_mass = 2;
  parameters.cart_friction = 0;
  parameters.gravity = 9.81;
  return model<Cart>(parameters);
}

Motion beside_hanging() {
  return {0, Eigen::Vector2d(0.1, 0.4), Eigen::Vector2d(-0.2, 0.3)};
}

constexpr double sample = 0.05;  // s
double push(int k) {
  return 4 * std::cos(2.0 * k);
}

/// Steps of RK4 for the equations of the cart, (x, theta, their rates), as they stand in textbooks.
Eigen::Vector4d pushed(Eigen::Vector4d state, double force, double duration) {
  constexpr double m = 0.5, l = 0.8, M = 2, g = 9.81;
  const auto rate = [&](const Eigen::Vector4d& y) {
    const double s = std::sin(y[1]), c = std::cos(y[1]);
    const double x = (force + m * s * (l * y[3] * y[3] + g * c)) / (M + m * s * s);
    return Eigen::Vector4d(y[2], y[3], x, -(c * x + g * s) / l);
  };
  constexpr int steps = 200;
  const double h = duration / steps;
  for (int k = 0; k < steps; ++k) {
    const Eigen::Vector4d a = rate(state), b = rate(state + h / 2 * a), c = rate(state + h / 2 * b),
                          d = rate(state + h * c);
    state += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return state;
}

/// Where it comes to by a push a sample.
Eigen::Vector4d pushed_for(double duration) {
  const Motion start = beside_hanging();
  Eigen::Vector4d state;
  state << start.q, start.v;
  for (int k = 0; duration - k * sample > 1e-9; ++k) {
    state = pushed(state, push(k), std::min(sample, duration - k * sample));
  }
  return state;
}

void control(Simulation& run, int from, int to) {
  for (int k = from; k < to; ++k) {
    run.hold("push", push(k));
    run.advance_to((k + 1) * sample);
  }
}

double apart(const Motion& a, const Eigen::Vector4d& b) {
  return (a.q - b.head(2)).norm() + (a.v - b.tail(2)).norm();
}

TEST(Simulation, HoldsAnInputUntilAnotherIsHeld) {
  for (const SimulationOptions& options :
       {SimulationOptions{.tolerance = 1e-10}, {.stages = 4, .step = 0.01}, {.method = Method::dopri5}}) {
    const double bound = options.method == Method::gauss ? 1e-12 : 5e-8;  // measured 4.9e-14, 2.0e-9
    Simulation run(cart(), beside_hanging(), options);
    control(run, 0, 40);
    EXPECT_EQ(run.held()[0], push(39));
    EXPECT_EQ(run["push"], push(39));
    EXPECT_LT(apart(run.motion(), pushed_for(2)), bound) << options.method;
    for (const double time : {0.0, 0.05, 0.22, 1.0, 1.984}) {
      EXPECT_LT(apart(run.at(time), pushed_for(time)), bound) << options.method << ' ' << time;
    }
  }
}

TEST(Simulation, HasHeldInputsInCopiesAndInWhatIsSaved) {
  for (const SimulationOptions& options : {SimulationOptions{}, {.stages = 2, .step = 0.02}}) {
    Simulation run(cart(), beside_hanging(), options);
    control(run, 0, 7);
    run.hold("push", 1.5);
    Simulation copy = run, other(cart(), beside_hanging(), options);
    other.resume(run.save());
    EXPECT_EQ(other.held()[0], 1.5);
    for (Simulation* one : {&run, &copy, &other}) {
      one->advance_to(0.6);
      control(*one, 12, 20);
    }
    EXPECT_TRUE(same(run.motion(), copy.motion()));
    EXPECT_TRUE(same(run.motion(), other.motion()));
    EXPECT_TRUE(same(run.at(0.58), copy.at(0.58)));
    EXPECT_THROW(other.at(0.2), std::invalid_argument);
  }
}

TEST(Simulation, HoldsTorquesOfAChain) {
  Eigen::Matrix<double, 3, 2> torque;
  torque << 0.1, 0.2, -0.3, 0.4, 0.5, -0.6;
  ChainParameters<Spatial> parameters{.masses = Eigen::Vector2d(1, 2), .lengths = Eigen::Vector2d(0.5, 1)};
  const Motion start(0, Eigen::Vector4d(0.5, 1, 0.2, -0.4), Eigen::Vector4d(0.1, 0, 0.3, 1));
  Simulation run(Chain<Spatial>(parameters), start);
  EXPECT_EQ(run.model().input_names()[4], "torque_y_2");
  run.hold(torque.reshaped());
  parameters.torque = torque;
  Simulation loaded(Chain<Spatial>(parameters), start);
  run.advance_to(1);
  loaded.advance_to(1);
  EXPECT_TRUE(same(run.motion(), loaded.motion()));
}

TEST(Simulation, HoldsNothingElseWithinAnAdvance) {
  Simulation run(cart(), beside_hanging());
  run.on({.value = [](const Motion& m) { return m.q[1]; }}, [&](const Motion&) { run.hold("push", 1); });
  EXPECT_THROW(run.advance_to(5), std::invalid_argument);
}

TEST(Simulation, WritesTheInputsThatAreHeld) {
  Simulation run(cart(), beside_hanging());
  std::vector<double> pushes;
  run.on_rows(every(sample), [&](std::span<const double> numbers) { pushes.push_back(numbers[5]); });
  EXPECT_EQ(run.model().columns()[5], "push");
  control(run, 0, 3);
  EXPECT_EQ(pushes, (std::vector{0.0, push(0), push(1), push(2)}));  // of the steps that led there
}

/// Two equal links, as their kernel has them.
Model model_of_kernel() {
  kernels::Planar2::Parameters<double> parameters;
  parameters.masses.setOnes();
  parameters.lengths.setOnes();
  parameters.damping.setZero();
  parameters.gravity = 9.81;
  return model<kernels::Planar2>(parameters);
}

TEST(Model, IsAKernelWithItsNumbers) {
  Simulation own(model_of_kernel(), let_go(), {.stages = 4, .step = 0.01});
  Simulation built_in(equal_chain<Planar>(2), let_go(), {.stages = 4, .solver = Solver::dense, .step = 0.01});
  own.advance_to(1);
  built_in.advance_to(1);
  EXPECT_LT(apart(own.motion(), built_in.motion()), 1e-12);  // measured 0
  EXPECT_EQ(own.model().columns()[1], "theta_1");
  EXPECT_THROW(Model("no_such_model"), NoKernel);
}

TEST(Model, IsDrivenBySinesThatAddUp) {
  const Model plain = model_of_kernel();
  Simulation twice(plain.driven("torque_1", 1.5, 2.0, 0.3).driven("torque_1", -0.5, 2.0, 0.3), let_go());
  ChainParameters<Planar> of_chain{.masses = Eigen::Vector2d(1, 1), .lengths = Eigen::Vector2d(1, 1)};
  of_chain.drives.push_back({0, Eigen::Matrix<double, 1, 1>(1.0), 2.0, 0.3});
  const Model chain{Chain<Planar>(of_chain)};
  Simulation once(chain, let_go(), {.solver = Solver::dense}), never(plain, let_go());
  for (Simulation* simulation : {&once, &twice, &never}) simulation->advance_to(1);
  EXPECT_LT(apart(once.motion(), twice.motion()), 1e-12);  // measured 1.6e-15
  EXPECT_GT(apart(once.motion(), never.motion()), 0.05);   // measured 0.44
  EXPECT_THROW(plain.driven("push", 1, 1), std::invalid_argument);
  EXPECT_THROW(plain.driven("torque_1", std::nan(""), 1), std::invalid_argument);
  EXPECT_THROW(chain.driven("torque_1", 1, 1), std::invalid_argument);
}

TEST(Propagate, IsThatOfEachAlone) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  Eigen::MatrixXd starts(40, 2);
  for (Eigen::Index k = 0; k < starts.rows(); ++k) starts.row(k) << 0.05 * static_cast<double>(k), 0.5;
  const Ends ends = propagate(chain, starts, {.duration = 1, .run = {.stages = 8, .step = 1e-2}, .threads = 2});
  ASSERT_EQ(ends.q.rows(), 40);
  for (Eigen::Index k = 0; k < starts.rows(); k += 13) {
    Simulation alone(chain, {0, starts.row(k).transpose(), Eigen::Vector2d::Zero()}, {.stages = 8, .step = 1e-2});
    alone.advance_to(1);
    EXPECT_EQ(ends.how[static_cast<std::size_t>(k)], PENDULA_OK);
    EXPECT_LT((ends.q.row(k).transpose() - alone.motion().q).norm(), 5e-15) << k;  // measured 2.2e-16
    EXPECT_LT(ends.energy_errors[k], 1e-14);                                       // measured 3.1e-16
  }
}

TEST(Propagate, TakesAModelEach) {
  std::vector<Model> models;
  for (const double mass : {0.5, 1.0, 2.0}) {
    models.emplace_back(Chain<Planar>({.masses = Eigen::Vector2d(1, mass), .lengths = Eigen::Vector2d(1, 1)}));
  }
  const Ends ends = propagate(models, Eigen::MatrixXd::Constant(3, 4, 0.3), {.duration = 1});
  Simulation second(models[1], {0, Eigen::Vector2d::Constant(0.3), Eigen::Vector2d::Constant(0.3)});
  second.advance_to(1);
  EXPECT_LT((ends.q.row(1).transpose() - second.motion().q).norm(), 1e-8);  // measured 2.4e-10
  EXPECT_GT((ends.q.row(0) - ends.q.row(2)).norm(), 1e-3);
  EXPECT_THROW(propagate(models, Eigen::MatrixXd::Zero(2, 4)), std::invalid_argument);
  EXPECT_THROW(propagate(models[0], Eigen::MatrixXd::Zero(2, 3)), std::invalid_argument);
}

TEST(Propagate, StopsWhereThatIsRequested) {
  std::stop_source source;
  source.request_stop();
  const Ends ends = propagate(equal_chain<Planar>(2), Eigen::MatrixXd::Constant(3, 2, 1.0),
                              {.duration = 1e6, .stop = source.get_token()});
  EXPECT_EQ(ends.how[2], PENDULA_STOPPED);
}

TEST(CInterface, PutsLinkagesTogether) {
  const auto linkage = [](double ground) {
    const std::array parameters = {9.81, ground, 0.0, 0.4, 0.4, 1.1, 1.1, 0.8, 0.8};
    return pendula_model_of_table(&system_table<kernels::FourBar>, parameters.data(), parameters.size(), nullptr, 0);
  };
  pendula_model* const model = linkage(1.0);
  ASSERT_NE(model, nullptr) << pendula_error();
  const std::array guess = {1.57, 0.8, -2.9}, rates = {9.0, -6.0, -6.0};
  for (const bool keeps : {true, false}) {
    const std::array kept = {1, 0, 0};
    std::array q = guess, v = rates;
    ASSERT_EQ(pendula_assemble(model, 0, keeps ? kept.data() : nullptr, q.data(), v.data()), PENDULA_OK);
    EXPECT_EQ(q[0] == guess[0], keeps);
    const auto sum = [](auto part) { return 0.4 * part(0) + 1.1 * part(1) + 0.8 * part(2); };
    EXPECT_NEAR(sum([&](std::size_t k) { return std::sin(q[k]); }), 1, 1e-15);         // measured 0
    EXPECT_NEAR(sum([&](std::size_t k) { return std::cos(q[k]); }), 0, 1e-15);         // measured 1.2e-16
    EXPECT_NEAR(sum([&](std::size_t k) { return std::cos(q[k]) * v[k]; }), 0, 1e-14);  // measured 8.9e-16
    EXPECT_NEAR(sum([&](std::size_t k) { return std::sin(q[k]) * v[k]; }), 0, 1e-14);  // measured 8.9e-16
    EXPECT_LT(std::abs(v[0] - rates[0]), 0.5);                                         // measured 0.012
  }
  pendula_model_free(model);
  pendula_model* const wide = linkage(5.0);
  std::array q = guess, v = rates;
  EXPECT_EQ(pendula_assemble(wide, 0, nullptr, q.data(), v.data()), PENDULA_INVALID);
  EXPECT_NE(std::string(pendula_error()).find("m in the loop_x"), std::string::npos) << pendula_error();
  EXPECT_EQ(q, guess);
  pendula_model_free(wide);
}

// For as long as chaos leaves the digits of two compilations alike. tests/lyapunov_test.cpp has published exponents.
TEST(Lyapunov, IsThatOfTheIntegrator) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  constexpr double duration = 5;
  const auto integrator = make_integrator(chain, {.stages = 4, .step = 0.01});
  for (const int count : {4, 1}) {
    const LyapunovSpectrum wanted = find_lyapunov_spectrum(
        *integrator, let_go(), 0.01, duration, count, [](const LyapunovProgress&) {}, [] { return false; });
    const LyapunovSpectrum found =
        lyapunov(chain, let_go(), {.duration = duration, .count = count, .run = {.stages = 4, .step = 0.01}});
    EXPECT_EQ(found.duration, duration);
    ASSERT_EQ(found.exponents.size(), count);
    EXPECT_GT(found.exponents[0], 0.2);                                            // measured 0.36 and 0.30
    EXPECT_LT((found.exponents - wanted.exponents).cwiseAbs().maxCoeff(), 1e-10);  // measured 0
    EXPECT_LT(count == 4 ? std::abs(found.sum) : 0, 1e-13);                        // measured 1.3e-15
  }
}

TEST(Lyapunov, SaysWhatIsWrong) {
  const Model chain = equal_chain<Planar>(2);
  EXPECT_THROW(lyapunov(chain, let_go(), {.count = 5}), std::invalid_argument);
  EXPECT_THROW(lyapunov(chain, let_go(), {.run = {.method = Method::dopri5}}), std::invalid_argument);
  std::stop_source source;
  source.request_stop();
  EXPECT_LT(lyapunov(chain, let_go(), {.duration = 1e6, .stop = source.get_token()}).duration, 1);
}

}  // namespace
}  // namespace pendula
