// The run-time factory, the explicit methods, the simulation loop, and how failures are told.

#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/explicit/chain_forward_dynamics.hpp>
#include <pendula/explicit/system_forward_dynamics.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/velocity_form.hpp>
#include <pendula/run/chain_subject.hpp>

#include "support/kernels.hpp"
#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

State<Planar> swinging(int links) {
  return State<Planar>::from_angles(Eigen::VectorXd::Constant(links, 1.0));
}

TEST(Factory, NamesTheKernelsToConfigure) {
  const Chain<Planar> chain = equal_chain<Planar>(40);
  try {
    make_integrator(chain, gauss(2));
    FAIL() << "expected NoKernel";
  } catch (const NoKernel& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("no kernel for a planar chain of 40 links"), std::string::npos) << text;
    EXPECT_NE(text.find("-DPENDULA_KERNELS=\"planar:40\""), std::string::npos) << text;
  }
}

TEST(Factory, RefusesStagesWithoutATableau) {
  EXPECT_THROW(make_integrator(equal_chain<Planar>(2), gauss(9)), std::invalid_argument);
  EXPECT_THROW(make_integrator(equal_chain<Planar>(2), gauss(0)), std::invalid_argument);
}

TEST(Factory, SaysWhatRuns) {
  const Description description = make_integrator(equal_chain<Spatial>(2), gauss(3))->describe();
  EXPECT_EQ(description.solver, "dense");
  EXPECT_EQ(description.iteration, "fixed-point");
  EXPECT_EQ(description.kernel, "spatial_2");
}

template <class Space>
std::string chosen(int links, int stages, Iteration iteration = Iteration::automatic) {
  RunOptions options;
  options.stages = stages;
  options.iteration = iteration;
  return make_integrator(equal_chain<Space>(links), options)->describe().solver;
}

TEST(Factory, ChoosesTheFasterSolver) {
  for (int stages = 1; stages <= max_stages; ++stages) {
    EXPECT_EQ(chosen<Planar>(1, stages), "dense");
    EXPECT_EQ(chosen<Planar>(2, stages), stages > 2 ? "dense" : "chain");
    EXPECT_EQ(chosen<Planar>(3, stages), stages > 3 ? "dense" : "chain");
    EXPECT_EQ(chosen<Planar>(4, stages), "chain");
    EXPECT_EQ(chosen<Spatial>(1, stages), "chain");
  }
  EXPECT_EQ(chosen<Planar>(2, 8, Iteration::newton), "chain");
}

TEST(Factory, ChoosesTheChainSolverForAnyNumberOfLinks) {
  RunOptions options;
  const auto integrator = make_integrator(equal_chain<Spatial>(40), options);
  EXPECT_EQ(integrator->describe().solver, "chain");
  EXPECT_EQ(integrator->describe().kernel, "");
  options.iteration = Iteration::fixed_point;
  EXPECT_EQ(make_integrator(equal_chain<Spatial>(40), options)->describe().iteration, "fixed-point");
  options.form = Form::velocity;
  options.solver = Solver::chain;
  EXPECT_THROW(make_integrator(equal_chain<Spatial>(40), options), std::invalid_argument);
}

TEST(Factory, FixedSizeSteppersAgreeWithIt) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  GaussStepper<LagrangianSolver<4>> stepper(system_of<kernels::Planar2>(chain), 3);
  const auto integrator = make_integrator(chain, gauss(3));
  ASSERT_TRUE(stepper.start(swinging(2)));
  ASSERT_TRUE(integrator->start(swinging(2)));
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(stepper.step(0.01));
    ASSERT_TRUE(integrator->step(0.01));
  }
  EXPECT_LT(distance(stepper.state(), integrator->state()), 3e-15);  // measured 2e-16
}

// Push is the derivative of a step by its start and its parameters, and pull its transpose, whatever the solver is.
TEST(Integrator, PushesAndPullsParameters) {
  Random random(5);
  const Chain<Planar> chain = equal_chain<Planar>(2);
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    RunOptions options = gauss(3);
    options.solver = solver;
    const auto integrator = make_integrator(chain, options);
    const int rows = integrator->linearize();
    ASSERT_TRUE(integrator->start(swinging(2)));
    ASSERT_TRUE(integrator->step(0.1));
    const int parameters = integrator->parameters();
    ASSERT_GE(parameters, 7) << solver;  // masses, lengths, damping, gravity
    const Directions<> start = random.matrix<Directions<>>(rows, 3, -1, 1);
    const Directions<> varied = random.matrix<Directions<>>(parameters, 3, -1, 1);
    const Directions<> weights = random.matrix<Directions<>>(rows, 3, -1, 1);
    Directions<> pushed = start, alone = start, pulled = weights, by_start = weights;
    Directions<> by_parameters = Directions<>::Zero(parameters, 3);
    integrator->push(pushed, varied);
    integrator->push(alone);
    integrator->pull(pulled, by_parameters);
    integrator->pull(by_start);
    EXPECT_EQ(pulled, by_start) << solver;
    EXPECT_GT((pushed - alone).norm(), 1e-3) << solver;
    const double forward = weights.cwiseProduct(pushed).sum();
    const double backward = pulled.cwiseProduct(start).sum() + by_parameters.cwiseProduct(varied).sum();
    EXPECT_NEAR(forward, backward, 2e-14) << solver;  // measured 5.6e-16
    Directions<> wrong = Directions<>::Zero(rows + 1, 3);
    EXPECT_THROW(integrator->push(wrong), std::invalid_argument);
    EXPECT_THROW(integrator->push(pushed, wrong), std::invalid_argument);
    EXPECT_THROW(integrator->pull(wrong), std::invalid_argument);
  }
}

TEST(Options, HaveNamesBothWays) {
  for (const std::string_view name : names_of<Method>) EXPECT_EQ(name_of(*option_of<Method>(name)), name);
  EXPECT_EQ(option_of<Iteration>("fixed-point"), Iteration::fixed_point);
  EXPECT_EQ(option_of<Solver>("newton"), std::nullopt);
}

TEST(ExplicitMethods, MeetGaussLegendre) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const State<Planar> reference = final_state(chain, swinging(2), gauss(8), 0.01, 1);
  RunOptions options;
  options.method = Method::rk4;
  EXPECT_LT(distance(final_state(chain, swinging(2), options, 1e-3, 1), reference), 5e-10);  // measured 1.1e-10
  options.tolerance = 1e-10;
  const double any = std::numeric_limits<double>::infinity();
  options.method = Method::dopri5;
  EXPECT_LT(distance(final_state(chain, swinging(2), options, any, 1), reference), 1e-9);  // measured 1.4e-10
  options.method = Method::fehlberg78;
  EXPECT_LT(distance(final_state(chain, swinging(2), options, any, 1), reference), 3e-9);  // measured 4e-10
  options.method = Method::taylor;
  EXPECT_LT(distance(final_state(chain, swinging(2), options, any, 1), reference), 4e-10);  // measured 4e-11
}

template <class Space>
void expect_the_same_accelerations(const Chain<Space>& chain, SystemForwardDynamics& dense, const State<Space>& at) {
  Eigen::VectorXd expected(at.q.size()), got(at.q.size());
  dense.acceleration(0.3, at.q.data(), at.v.data(), expected.data());
  ChainForwardDynamics<Space>(chain).acceleration(0.3, at.q.data(), at.v.data(), got.data());
  EXPECT_LT((got - expected).norm(), 1e-13 * expected.norm());  // measured 5e-15
}

TEST(ExplicitMethods, HaveTheSameAccelerationsWithoutAKernel) {
  Random random(3);
  const Chain<Planar> planar = random_chain<Planar>(random, 4, true);
  SystemForwardDynamics planar_dense(system_of<kernels::Planar4>(planar));
  expect_the_same_accelerations(planar, planar_dense, random_state<Planar>(random, 4));
  const Chain<Spatial> spatial = random_chain<Spatial>(random, 3, true);
  SystemForwardDynamics spatial_dense(system_of<kernels::Spatial3>(spatial));
  expect_the_same_accelerations(spatial, spatial_dense, random_state<Spatial>(random, 3));
  RunOptions options;
  options.method = Method::rk4;
  const auto integrator = make_integrator(equal_chain<Planar>(40), options);
  ASSERT_TRUE(integrator->start(swinging(40)));
  EXPECT_TRUE(integrator->step(1e-4));
}

TEST(ExplicitMethods, ToleranceSteersTheError) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const State<Planar> reference = final_state(chain, swinging(2), gauss(8), 0.01, 1);
  const double any = std::numeric_limits<double>::infinity();
  RunOptions options;
  options.method = Method::dopri5;
  options.tolerance = 1e-5;
  const double coarse = distance(final_state(chain, swinging(2), options, any, 1), reference);
  options.tolerance = 1e-9;
  const double fine = distance(final_state(chain, swinging(2), options, any, 1), reference);
  EXPECT_LT(fine, coarse / 1000);  // measured 1.5e-9 and 6.4e-5
  EXPECT_GT(coarse, 1e-9);
}

// A billionth of a swing takes as many steps as a thousandth, and is as right. One that has come to rest takes no more.
TEST(ExplicitMethods, FollowSmallSwings) {
  const Chain<Planar> chain = equal_chain<Planar>(1);
  const auto swung = [&](Method method, double size) {
    RunOptions options;
    options.method = method;
    const auto integrator = make_integrator(chain, options);
    EXPECT_TRUE(integrator->start(State<Planar>::from_angles(Eigen::VectorXd::Constant(1, size))));
    while (integrator->time() < 10) EXPECT_TRUE(integrator->step(10 - integrator->time()));
    return std::pair(integrator->state().q[0] / size, integrator->statistics().steps);
  };
  for (const Method method : {Method::dopri5, Method::fehlberg78, Method::taylor}) {
    const auto [angle, steps] = swung(method, 1e-9);
    EXPECT_NEAR(angle, std::cos(std::sqrt(9.81) * 10), 1e-6) << method;  // measured 4.7e-9
    const auto [other, as_many] = swung(method, 1e-3);
    EXPECT_NEAR(static_cast<double>(steps), static_cast<double>(as_many), 0.1 * static_cast<double>(as_many)) << method;
    EXPECT_LE(swung(method, 0).second, as_many) << method;
  }
}

// Pi as a double is 1.2e-16 off the top, so that a rod at rest there falls after 12 s. Its first steps are smaller than
// the last bit of its angle.
TEST(ExplicitMethods, FallFromTheTop) {
  const Chain<Planar> chain = equal_chain<Planar>(1);
  const State<Planar> top = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, M_PI));
  for (const Method method : {Method::rk4, Method::dopri5, Method::fehlberg78}) {
    RunOptions options;
    options.method = method;
    options.tolerance = 1e-13;
    const double h = method == Method::rk4 ? 1e-3 : std::numeric_limits<double>::infinity();
    const double before = final_state(chain, top, options, h, 9).q[0] - M_PI;
    // 1.2e-16 cosh(√9.81 · 9) = 1.1e-4; measured -5.5e-5 to -8.2e-5, since sines of stages see whole bits of the angle.
    EXPECT_NEAR(before, -1.1e-4, 8e-5) << method;
  }
}

// A thousandth of a turn in a year, a thousand turns from where angles begin.
TEST(ExplicitMethods, SmallStepsAddUp) {
  ChainParameters<Planar> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
  parameters.gravity = 0;
  RunOptions options;
  options.method = Method::rk4;
  State<Planar> state = State<Planar>::from_angles(Eigen::VectorXd::Constant(1, 6000));
  state.v[0] = 2e-10;
  const State<Planar> end = final_state(Chain<Planar>(parameters), state, options, 1e-3, 10);
  EXPECT_NEAR(end.q[0] - 6000, 2e-9, 1e-12);  // its last bit is 9e-13; without a compensated sum it does not move
}

// The estimate of Fehlberg's pair does not see what depends on time alone: steps of half a minute came of this drive.
TEST(ExplicitMethods, FollowDrives) {
  for (const double frequency : {1.0, 10.0, 300.0}) {
    ChainParameters<Planar> parameters;
    parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(1);
    parameters.gravity = 0;
    parameters.drives = {{.link = 0, .amplitude = Torque<Planar, 1>::Constant(1), .frequency = frequency, .phase = 0}};
    const double theta = (10 - std::sin(10 * frequency) / frequency) / frequency;
    for (const Method method : {Method::dopri5, Method::fehlberg78}) {
      RunOptions options;
      options.method = method;
      const State<Planar> start = State<Planar>::from_angles(Eigen::VectorXd::Zero(1));
      const double any = std::numeric_limits<double>::infinity();
      const State<Planar> end = final_state(Chain<Planar>(parameters), start, options, any, 10);
      EXPECT_NEAR(end.q[0], theta, 1e-6 * theta) << method << ", " << frequency;
    }
  }
}

// Straight through the pole from below, and from a start that hangs there.
TEST(ExplicitMethods, PassThePole) {
  const Chain<Spatial> chain = equal_chain<Spatial>(2);
  RunOptions exact = gauss(8);
  exact.solver = Solver::chain;
  const auto hanging = State<Spatial>::from_angles(Eigen::Vector2d(0, 0.5), Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d(3, -1), Eigen::Vector2d::Zero());
  const State<Spatial> reference = final_state(chain, hanging, exact, 0.01, 2);
  for (const Method method : {Method::rk4, Method::dopri5, Method::fehlberg78}) {
    RunOptions options;
    options.method = method;
    const double h = method == Method::rk4 ? 1e-3 : std::numeric_limits<double>::infinity();
    EXPECT_LT(distance(final_state(chain, hanging, options, h, 2), reference), 1e-8)
        << method;  // measured 1.7e-10, 3.7e-10, 1.3e-9
  }
}

// Three links in their slowest mode, by steps that do not resolve the fastest one: corrections of the mode that moves
// are gone after a few iterations, those of the other shrink slowly, rest or grow for a while.
TEST(Iterations, OfAFixedPointGoOnWhereAModeThatHardlyMovesConvergesSlowly) {
  const ChainSubject<Planar> subject(test::equal_chain<Planar>(3));
  const Motion start(0, Eigen::Vector3d(1e-3, 1.2921127216082604e-3, 1.6312232922920724e-3), Eigen::Vector3d::Zero());
  const auto end = [&](Solver solver, Iteration iteration) {
    const auto integrator = subject.make_integrator({.stages = 8, .solver = solver, .iteration = iteration});
    EXPECT_TRUE(integrator->start(start));
    for (int step = 0; step < 5; ++step) EXPECT_TRUE(integrator->step(1));
    return integrator->state();
  };
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    const Motion newton = end(solver, Iteration::newton);
    for (const Iteration iteration : {Iteration::fixed_point, Iteration::automatic}) {
      const double off = (end(solver, iteration).q - newton.q).cwiseAbs().maxCoeff();
      EXPECT_LT(off, 5e-13) << solver << ' ' << iteration;  // measured 7.2e-14
    }
  }
}

TEST(Failure, OfAStateOfAnotherChainIsTold) {
  const auto integrator = make_integrator(equal_chain<Planar>(3), RunOptions());
  try {
    integrator->start(swinging(4));
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "state: coordinates: expected 3 numbers for this chain, got 4");
  }
}

TEST(Failure, AtThePoleNamesTheLink) {
  const auto integrator = make_integrator(equal_chain<Spatial>(2), gauss(2));
  const auto start = State<Spatial>::from_angles(Eigen::Vector2d(1, 0), Eigen::Vector2d::Zero());
  const Outcome outcome = integrator->start(start);
  EXPECT_EQ(outcome.status, Status::singular_mass_matrix);
  EXPECT_EQ(outcome.part, 1);
  EXPECT_EQ(message(outcome),
            "at t = 0 s: the mass matrix is singular at link 2: in space phi has no meaning where sin(theta) = 0; in "
            "the plane "
            "masses or lengths are too far apart");
}

// A tenth of a second takes four iterations, its halves take three.
TEST(Failure, OfAStepIsMendedByHalves) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  GaussStepper<LagrangianSolver<4>> stepper(system_of<kernels::Planar2>(chain), 4, {.max_iterations = 3},
                                            Iteration::newton);
  ASSERT_TRUE(stepper.start(swinging(2)));
  const Outcome outcome = stepper.step(0.1);
  ASSERT_TRUE(outcome) << outcome;
  EXPECT_EQ(outcome.step, 0.1);
  EXPECT_EQ(stepper.time(), 0.1);
  EXPECT_EQ(stepper.statistics().steps, 1);
  EXPECT_EQ(stepper.statistics().rejected_steps, 1);
  const double change = energy(chain, stepper.state()) - energy(chain, swinging(2));
  EXPECT_LT(std::abs(change), 1e-12 * energy_scale(chain));  // measured 6.4e-14; of the whole step at once, 1.1e-11
}

template <class Solver, class Model>
void expect_an_untouched_state_where_no_part_converges(const Model& model) {
  GaussStepper<Solver> stepper(model, 2, {.max_iterations = 1});
  ASSERT_TRUE(stepper.start(swinging(2)));
  const Outcome outcome = stepper.step(0.01);
  EXPECT_EQ(outcome.status, Status::not_converged) << outcome;
  EXPECT_EQ(outcome.step, 0.01 / 1024) << "the smallest part that was tried";
  EXPECT_EQ(outcome.time, 0);
  EXPECT_EQ(outcome.iterations, 1);
  EXPECT_GT(outcome.residual, 0);
  EXPECT_GE(outcome.part, 0);
  EXPECT_EQ(stepper.time(), 0);
  EXPECT_EQ(distance(stepper.state(), swinging(2)), 0);
  EXPECT_EQ(stepper.statistics().steps, 0);
  EXPECT_EQ(stepper.statistics().rejected_steps, 11);
}

TEST(Failure, LeavesTheStateAndSaysHowFarItCame) {
  const auto system = system_of<kernels::Planar2>(equal_chain<Planar>(2));
  expect_an_untouched_state_where_no_part_converges<LagrangianSolver<4>>(system);
  expect_an_untouched_state_where_no_part_converges<LagrangianSolver<4, VelocityForm>>(system);
  expect_an_untouched_state_where_no_part_converges<ChainSolver<Planar, 2>>(equal_chain<Planar>(2));
}

/// The largest energy that a double pendulum has in 50 s of steps far too large, in units of what it could have.
double most_energy(const RunOptions& options, double h) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const auto integrator = make_integrator(chain, options);
  EXPECT_TRUE(integrator->start(swinging(2)));
  const double before = energy(chain, swinging(2));
  double most = 0;
  while (integrator->time() < 50 && integrator->step(h)) {
    most = std::max(most, std::abs(energy(chain, integrator->state()) - before) / energy_scale(chain));
  }
  return most;
}

// The stage equations of such steps have roots with energies of 1e18, and Newton likes to find them.
TEST(Failure, OfAStepThatIsTooLargeIsNoOtherMotion) {
  for (const Solver solver : {Solver::chain, Solver::dense}) {
    for (const int stages : {1, 2, 4, 8}) {
      for (const double h : {0.3, 1.0, 2.0, 5.0}) {
        RunOptions options = gauss(stages);
        options.solver = solver;
        EXPECT_LT(most_energy(options, h), 1.5) << solver << ", " << stages << " stages of " << h;  // measured 0.99
      }
    }
  }
}

std::vector<double> row_times(const Schedule& schedule) {
  const auto integrator = make_integrator(equal_chain<Planar>(1), gauss(2));
  std::vector<double> times;
  const RunResult result =
      simulate(*integrator, swinging(1), schedule, [&](const auto& state) { times.push_back(state.time); });
  EXPECT_TRUE(result.outcome);
  return times;
}

TEST(Schedule, RowsAreEveryFewStepsAndTheLast) {
  EXPECT_EQ(row_times({0.25, 1.0, 2}), (std::vector<double>{0, 0.5, 1.0}));
  EXPECT_EQ(row_times({0.25, 1.0, 3}), (std::vector<double>{0, 0.75, 1.0}));
  EXPECT_EQ(row_times({0.25, 0.0, 3}), (std::vector<double>{0}));
}

TEST(Schedule, StopsAfterTheStepInWhichItIsAsked) {
  const auto integrator = make_integrator(equal_chain<Planar>(1), gauss(2));
  std::vector<double> times;
  int steps = 0;
  const RunResult result = simulate(
      *integrator, swinging(1), {0.25, 10, 1'000'000}, [&](const auto& state) { times.push_back(state.time); },
      [&] { return ++steps == 3; });
  EXPECT_TRUE(result.outcome);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(times, (std::vector<double>{0, 0.75}));  // its last state is a row
}

TEST(Schedule, TheLastStepIsCut) {
  const std::vector<double> times = row_times({0.3, 1.0, 1});
  ASSERT_EQ(times.size(), 5u);
  EXPECT_DOUBLE_EQ(times[3], 0.9);
  EXPECT_DOUBLE_EQ(times[4], 1.0);
  EXPECT_EQ(row_times({0.1, 1.0, 1}).size(), 11u) << "no sliver of a step at the end";
}

TEST(Schedule, RefusesANonsensicalSchedule) {
  EXPECT_THROW(row_times({0.0, 1.0, 1}), std::invalid_argument);
  EXPECT_THROW(row_times({0.1, -1.0, 1}), std::invalid_argument);
  EXPECT_THROW(row_times({0.1, 1.0, 0}), std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
