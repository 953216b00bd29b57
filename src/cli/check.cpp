#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/library.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cli/commands.hpp"
#include "io/input_error.hpp"
#include "io/number.hpp"

namespace pendula::cli {
namespace {

/// One line of the table: what was measured, and what it may be.
struct CheckLine {
  std::string_view kernel;
  std::string what;
  double measured = 0;
  double limit = 0;
  bool at_least = false;  ///< the limit is a lower one

  bool ok() const { return at_least ? measured >= limit : measured <= limit; }  // false for NaN
};

/// Links of unequal masses and lengths, whose fastest small oscillation does not depend much on their number.
template <class Space>
Chain<Space> test_chain(int links) {
  ChainParameters<Space> parameters;
  parameters.masses.resize(links);
  parameters.lengths.resize(links);
  for (int i = 0; i < links; ++i) {
    parameters.masses[i] = 1 + 0.25 * std::sin(3.0 * i);
    parameters.lengths[i] = 1 + 0.25 * std::cos(2.0 * i);
  }
  return Chain<Space>(parameters);
}

/// Links spread out, away from the poles and turning around the vertical, so that (θ, φ) serves well.
template <class Space>
State<Space> test_start(int links) {
  const Eigen::VectorXd number = Eigen::VectorXd::LinSpaced(links, 0, links - 1);
  const Eigen::VectorXd theta = (1.2 + 0.3 * number.array().sin()).matrix();
  const Eigen::VectorXd theta_dot = (0.2 * (2 * number.array()).cos()).matrix();
  if constexpr (Space::dof == 1) {
    return State<Space>::from_angles(theta, theta_dot);
  } else {
    const Eigen::VectorXd phi = (0.4 * number.array().cos()).matrix();
    const Eigen::VectorXd phi_dot = (1.5 + 0.1 * number.array().sin()).matrix();
    return State<Space>::from_angles(theta, phi, theta_dot, phi_dot);
  }
}

/// Checks of one chain by its integrators, through the same door as every run.
template <class Space>
class IntegrationCheck {
 public:
  IntegrationCheck(std::string_view kernel, int links)
      : kernel_(kernel),
        chain_(test_chain<Space>(links)),
        start_(test_start<Space>(links)),
        time_(0.4 / std::sqrt(links)) {}

  // What was measured is the worst of the committed kernels.
  std::vector<CheckLine> lines() const {
    std::vector<CheckLine> lines;
    const auto add = [&](const std::string& what, double measured, double limit, bool at_least = false) {
      lines.push_back({kernel_, what, measured, limit, at_least});
    };
    for (const Form form : {Form::momentum, Form::velocity}) {
      for (const int stages : {1, 2, 3}) {
        add(label("order", stages, form), order(stages, form), 2 * stages - 0.3, true);  // measured 2s − 0.06
      }
    }
    for (const Form form : {Form::momentum, Form::velocity}) {
      add(label("energy error", 6, form), energy_error(6, form), 1e-13);  // measured 9.1e-17
    }
    add(label("way back", 4, Form::momentum), time_reversal(), 1e-12);                              // measured 2.7e-15
    add("dense = chain, 6 stages, newton", dense_to_chain(6, Iteration::newton), 1e-12);            // measured 4e-15
    add("dense = chain, 6 stages, fixed-point", dense_to_chain(6, Iteration::fixed_point), 1e-12);  // measured 2.9e-15
    return lines;
  }

 private:
  static std::string label(const std::string& what, int stages, Form form) {
    return what + ", " + std::to_string(stages) + (stages == 1 ? " stage, " : " stages, ") +
           (form == Form::momentum ? "momentum" : "velocity") + " form";
  }

  static RunOptions options(int stages, Form form, Solver solver = Solver::dense) {
    RunOptions options;
    options.stages = stages;
    options.form = form;
    options.solver = solver;
    return options;
  }

  /// The state after `steps` steps over `time_`, which is negative on the way back; NaN where a step fails.
  State<Space> run(const RunOptions& options, const State<Space>& start, int steps, double time) const {
    const auto integrator = make_integrator(chain_, options);
    bool ok = static_cast<bool>(integrator->start(start));
    for (int i = 0; i < steps && ok; ++i) ok = static_cast<bool>(integrator->step(time / steps));
    State<Space> state = integrator->state();
    if (!ok) state.q.setConstant(std::numeric_limits<double>::quiet_NaN());
    return state;
  }

  static double distance(const State<Space>& a, const State<Space>& b) {
    const double q = (a.q - b.q).cwiseAbs().maxCoeff();
    return a.q.allFinite() && b.q.allFinite() ? std::max(q, (a.v - b.v).cwiseAbs().maxCoeff())
                                              : std::numeric_limits<double>::quiet_NaN();
  }

  /// Order from the errors of steps that are four times apart, against eight stages.
  double order(int stages, Form form) const {
    const int coarse = stages == 1 ? 32 : stages == 2 ? 8 : 4;
    const State<Space> exact = run(options(8, Form::momentum), start_, 16, time_);
    const double error = distance(run(options(stages, form), start_, coarse, time_), exact);
    const double smaller = distance(run(options(stages, form), start_, 4 * coarse, time_), exact);
    return std::log2(error / smaller) / 2;
  }

  double energy_error(int stages, Form form) const {
    const State<Space> end = run(options(stages, form), start_, 32, time_);
    return std::abs(energy(chain_, end) - energy(chain_, start_)) / energy_scale(chain_);
  }

  double time_reversal() const {
    const State<Space> end = run(options(4, Form::momentum), start_, 16, time_);
    return distance(run(options(4, Form::momentum), end, 16, -time_), start_);
  }

  /// How far the ends of a run by either solver are apart.
  double dense_to_chain(int stages, Iteration iteration) const {
    RunOptions by_chain = options(stages, Form::momentum, Solver::chain);
    by_chain.iteration = iteration;
    return distance(run(by_chain, start_, 16, time_), run(options(stages, Form::momentum), start_, 16, time_));
  }

  std::string_view kernel_;
  Chain<Space> chain_;
  State<Space> start_;
  double time_;
};

void print(const CheckLine& line) {
  std::cout << std::left << std::setw(12) << line.kernel << std::setw(46) << line.what << std::right << std::setw(10)
            << io::rounded(line.measured, 3) << (line.at_least ? "  >= " : "  <= ") << std::left << std::setw(8)
            << io::rounded(line.limit, 3) << (line.ok() ? "ok" : "FAILED") << '\n';
}

/// What came of all lines so far.
struct Tally {
  int lines = 0, failures = 0;

  void add(const CheckLine& line) {
    print(line);
    ++lines;
    failures += line.ok() ? 0 : 1;
  }
};

template <class Space>
void check_space(const CheckOptions& options, Tally& tally) {
  if (options.space && *options.space != Space::name) return;
  for (const KernelEntry& entry : library_of<Space>().kernels) {
    if (options.links && *options.links != entry.info.links) continue;
    constexpr unsigned seed = 1;
    for (const KernelCheck::Line& line : entry.check(seed).lines) {
      tally.add({entry.info.name, std::string(line.what), line.error, line.limit});
    }
    for (const CheckLine& line : IntegrationCheck<Space>(entry.info.name, entry.info.links).lines()) tally.add(line);
  }
}

std::string all_kernels() {
  std::string names;
  for (const KernelInfo& kernel : built_in_kernels()) names += (names.empty() ? "" : ", ") + std::string(kernel.name);
  return names.empty() ? "none" : names;
}

}  // namespace

ExitStatus check(const CheckOptions& options) {
  Tally tally;
  check_space<Planar>(options, tally);
  check_space<Spatial>(options, tally);
  if (tally.lines == 0) {
    throw io::InputError("check: expected --space and --links of a kernel in this build (" + all_kernels() + ")");
  }
  if (tally.failures == 0) {
    std::cout << "\nall " << tally.lines << " checks passed\n";
    return done;
  }
  std::cout << '\n' << tally.failures << " of " << tally.lines << " checks failed\n";
  return failed;
}

}  // namespace pendula::cli
