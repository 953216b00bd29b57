// The derivative of a step by Taylor series is that of the discrete step, in the state, in parameters and in inputs;
// that of a run is what Gauss steps say, whose derivative comes from other functions of the kernel.

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <functional>
#include <memory>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/derivatives.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/system/interpreter.hpp>
#include <pendula/system/kernel_table.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/tangents.hpp"

namespace pendula::test {
namespace {

/// A system, with one parameter or input changed, and where its motion starts.
struct Case {
  std::string name;
  std::function<std::shared_ptr<const Subject>(int varied, double change)> make;
  Motion start;
};

std::shared_ptr<const SystemTable> interpreted(const char* file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return table_of(text.str(), program_interpreter);
}

Motion motion(std::vector<double> q, std::vector<double> v) {
  const auto size = static_cast<Eigen::Index>(q.size());
  return {0.2, Eigen::Map<Eigen::VectorXd>(q.data(), size), Eigen::Map<Eigen::VectorXd>(v.data(), size)};
}

Case system(const std::string& name, const std::shared_ptr<const SystemTable>& table, const SystemNumbers& numbers,
            const Motion& start) {
  const auto make = [=](int k, double change) {
    SystemNumbers changed = numbers;
    const auto at = static_cast<std::size_t>(k), known = changed.parameters.size();
    (at < known ? changed.parameters[at] : changed.inputs[at - known]) += change;
    return std::make_shared<SystemSubject>(table, changed);
  };
  return {name, make, start};
}

/// In both forms of series, compiled and interpreted, free and driven.
std::vector<Case> cases() {
  const std::shared_ptr<const SystemTable> atwood(&system_table<kernels::SwingingAtwood>, [](const auto*) {});
  const auto furuta = interpreted(INTERPRETED_FURUTA);
  const SystemNumbers numbers{
      {0.5, 0.3, 1, 0.4, 0.3, 9.81, 0.01, 0.02}, {0.2}, {{.input = 0, .amplitude = 0.5, .frequency = 3, .phase = 0.4}}};
  const Chain<Planar> chain({.masses = Eigen::Vector2d(1, 0.5),
                             .lengths = Eigen::Vector2d(0.7, 0.4),
                             .damping = Eigen::Vector2d(0.01, 0.02),
                             .torque = Eigen::RowVector2d(0.3, -0.1)});
  const auto changed = [=](int k, double change) {
    return std::make_shared<ChainSubject<Planar>>(varied(chain, k, change));
  };
  return {system("swinging atwood", atwood, {{2.5, 1, 9.81}, {}, {}}, motion({1, 1.2}, {0.3, -0.2})),
          system("furuta", furuta, numbers, motion({0.1, 1}, {2, -1})),
          {"planar chain", changed, motion({1.1, 2}, {0.5, -1})}};
}

RunOptions series(double tolerance) {
  return {.method = Method::taylor, .step = 0, .tolerance = tolerance};
}

Eigen::Index varied_of(const Subject& subject) {
  Eigen::Index count = 0;
  for (const Varied& each : varied_by(subject)) count += each.size;
  return count;
}

/// Variations of the end by state and parameters, each of them alone.
Directions<> whole(const Subject& subject, const Motion& start, const RunOptions& options, double duration) {
  const std::array<double, 1> times{start.time + duration};
  const MotionTask task{.subject = subject, .options = options, .start = start, .times = times};
  const Eigen::Index state = 2 * start.q.size(), all = state + varied_of(subject);
  const Directions<> seeds = identity(all);
  const Forward found = move_variations(task, seeds.topRows(state), seeds.bottomRows(all - state));
  EXPECT_TRUE(found.outcome);
  return found.variations.front();
}

TEST(SeriesTangents, AreThoseThatGaussStepsHave) {
  const RunOptions gauss{.stages = 8, .solver = Solver::dense, .step = 0, .tolerance = 1e-15};
  for (const Case& each : cases()) {
    const auto subject = each.make(0, 0);
    const Directions<> found = whole(*subject, each.start, series(1e-16), 2);
    const Directions<> expected = whole(*subject, each.start, gauss, 2);
    EXPECT_GT(expected.cwiseAbs().maxCoeff(), 2) << each.name;  // the motion does something to them
    EXPECT_LT(distance(found, expected), 1e-12) << each.name;   // measured 1.6e-14
  }
}

// What hangs at rest has a series without a term, and would take a step of any length; what is beside it swings.
TEST(SeriesTangents, MoveWhereTheMotionDoesNot) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(2));
  const Motion hanging = motion({0, 0}, {0, 0});
  const RunOptions gauss{.stages = 8, .solver = Solver::dense, .step = 0.01};
  const Directions<> found = whole(chain, hanging, series(1e-14), 20);
  EXPECT_LT(distance(found, whole(chain, hanging, gauss, 20)), 1e-12);  // measured 5.7e-14
}

// Of a coarse one, far from the motion.
TEST(SeriesTangents, AreThoseOfTheDiscreteStep) {
  constexpr double h = 0.1;
  const RunOptions coarse = series(1e-2);
  for (const Case& each : cases()) {
    const auto subject = each.make(0, 0);
    const Eigen::Index n = each.start.q.size();
    const auto end = [&](const Subject& of, const Motion& from) {
      const auto integrator = of.make_integrator(coarse);
      EXPECT_TRUE(integrator->start(from) && integrator->step(h));
      EXPECT_EQ(integrator->time(), from.time + h);
      Eigen::VectorXd found(2 * n);
      found << integrator->state().q, integrator->state().v;
      return found;
    };
    const Directions<> found = whole(*subject, each.start, coarse, h);
    EXPECT_GT(distance(found, whole(*subject, each.start, series(1e-16), h)), 1e-7) << each.name;  // measured 3.0e-6
    for (Eigen::Index k = 0; k < found.cols(); ++k) {
      const auto moved = [&](double change) {
        Motion from = each.start;
        if (k < 2 * n) (k < n ? from.q[k] : from.v[k - n]) += change;
        const bool is_parameter = k >= 2 * n;
        return end(*each.make(is_parameter ? static_cast<int>(k - 2 * n) : 0, is_parameter ? change : 0), from);
      };
      // Measured 5.6e-13.
      EXPECT_LT(distance(found.col(k), difference_quotient(moved, 2e-3)), 1e-11) << each.name << ", " << k;
    }
  }
}

TEST(SeriesTangents, ArePulledByTheirTranspose) {
  for (const Case& each : cases()) {
    const auto subject = each.make(0, 0);
    const RunOptions options = series(1e-9);
    const std::array<double, 1> times{each.start.time + 1};
    const MotionTask task{.subject = *subject, .options = options, .start = each.start, .times = times};
    const Directions<> forward = whole(*subject, each.start, options, 1);
    const Directions<> gradient = Directions<>::Ones(forward.rows(), 1);
    const Backward backward = move_gradients(task, gradient);
    Eigen::VectorXd back(forward.cols());
    back << backward.of_start, backward.of_parameters;
    const Eigen::VectorXd expected = forward.transpose() * gradient;
    EXPECT_LT(distance(back, expected), 1e-14) << each.name;  // measured 5.1e-16
  }
}

// A tangent at a time takes a lane; more than eight of them go several times.
TEST(SeriesTangents, AreTheSameOneByOne) {
  for (const Case& each : cases()) {
    const auto integrator = each.make(0, 0)->make_integrator(series(1e-9));
    const int rows = integrator->linearize();
    ASSERT_TRUE(integrator->start(each.start) && integrator->step(1));
    Directions<> many = identity(rows).replicate(1, 5);
    integrator->push(many);
    for (int k = 0; k < rows; ++k) {
      Directions<> one = identity(rows).col(k);
      integrator->push(one);
      EXPECT_EQ((many.col(4 * rows + k) - one).norm(), 0) << each.name;
    }
  }
}

// The canonical form is kept as far as the step is the motion's.
TEST(SeriesTangents, AreSymplecticAsTheMotionIs) {
  const Case atwood = cases().front();
  for (const double tolerance : {1e-6, 1e-15}) {
    const auto integrator = atwood.make(0, 0)->make_integrator(series(tolerance));
    Directions<> matrix = identity(integrator->linearize());
    ASSERT_TRUE(integrator->start(atwood.start) && integrator->step(1));
    integrator->push(matrix);
    const double off = distance(symplectic_form(matrix), symplectic_form(identity(matrix.rows())));
    EXPECT_LT(off, tolerance < 1e-10 ? 1e-14 : 1e-5) << tolerance;  // measured 7.8e-16, 7.4e-7
  }
}

TEST(SeriesTangents, ChainsByRodsHaveNone) {
  const ChainSubject<Planar> chain(equal_chain<Planar>(7));  // no kernel of so many links is built in
  EXPECT_THROW(chain.make_integrator(series(1e-9))->linearize(), std::invalid_argument);
}

}  // namespace
}  // namespace pendula::test
