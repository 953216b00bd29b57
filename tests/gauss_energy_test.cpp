// Energy over long runs: no drift in momentum form, and the velocity form beside it.

#include "support/random_chain.hpp"
#include "support/run.hpp"

namespace pendula::test {
namespace {

struct EnergyRun {
  double first_tenth = 0, last_tenth = 0;  // medians of |H − H₀| / Σ M g l over the rows
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

EnergyRun energy_run(const State<Planar>& start, const RunOptions& options, double step, std::int64_t steps) {
  const Chain<Planar> chain = equal_chain<Planar>(2);
  const auto integrator = make_integrator(chain, options);
  const double before = energy(chain, start);
  const double scale = energy_scale(chain);
  std::vector<double> errors;
  const RunResult result =
      simulate(*integrator, start, {step, step * static_cast<double>(steps), 100},
               [&](const auto& state) { errors.push_back(std::abs(energy(chain, state) - before) / scale); });
  EXPECT_TRUE(result.outcome) << result.outcome;
  EnergyRun run;
  const auto tenth = static_cast<std::ptrdiff_t>(errors.size() / 10);
  run.first_tenth = median({errors.begin(), errors.begin() + tenth});
  run.last_tenth = median({errors.end() - tenth, errors.end()});
  return run;
}

// The chaotic double pendulum of mathematics: 10⁶ steps.
TEST(LongRun, MomentumFormHasNoDriftAndVelocityFormWanders) {
  const auto start = State<Planar>::from_angles(Eigen::Vector2d::Constant(M_PI / 2));
  const EnergyRun momentum = energy_run(start, gauss(2, Form::momentum), 0.005, 1'000'000);
  const EnergyRun velocity = energy_run(start, gauss(2, Form::velocity), 0.005, 1'000'000);
  EXPECT_LT(momentum.first_tenth, 4e-10);                      // measured 2.2e-10
  EXPECT_LT(momentum.last_tenth, 1.5 * momentum.first_tenth);  // measured 0.98
  // Where a chaotic walk has got to by then is chance: measured 61; from starts up to 4e-3 rad beside, 16 to 170.
  EXPECT_GT(velocity.last_tenth, 5 * momentum.last_tenth);
}

}  // namespace
}  // namespace pendula::test
