#include <algorithm>
#include <contestant.hpp>
#include <peers/pendula.hpp>
#include <systems.hpp>

namespace bench {
namespace {

using pendula::Form, pendula::Iteration, pendula::Method, pendula::Planar, pendula::RunOptions, pendula::Solver;

/// A run of the library; how long its steps are is for those that derive from it.
class PendulaRun : public Run {
 public:
  PendulaRun(const Problem& problem, const RunOptions& options) : problem_(problem) {
    if (problem.kernel.empty()) {
      start_ = pendula::State<Planar>::from_angles(Eigen::VectorXd::Constant(problem.links, problem.angle));
      integrator_ = pendula::make_integrator(chain_of(problem), options);
    } else {
      const SystemStart& start = system_start(problem);
      const auto vector = [](const std::vector<double>& values) {
        return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
      };
      start_ = {0, vector(start.q), vector(start.v)};
      integrator_ = subject_of(problem)->make_integrator(options);
    }
  }

  void operator()() override {
    outcome_ = integrator_->start(start_);
    if (outcome_) outcome_ = go(*integrator_);
  }

  EndState end() override {
    if (!outcome_) return failed(problem_);
    const auto state = integrator_->state();
    return {{state.q.begin(), state.q.end()}, {state.v.begin(), state.v.end()}};
  }

 private:
  /// From the start to the end.
  virtual pendula::Outcome go(pendula::Integrator& integrator) = 0;

  Problem problem_;
  pendula::Motion start_;
  std::unique_ptr<pendula::Integrator> integrator_;
  pendula::Outcome outcome_;
};

class ConstantSteps : public PendulaRun {
 public:
  ConstantSteps(const Problem& problem, const RunOptions& options, int steps, double step, double last_step)
      : PendulaRun(problem, options), steps_(steps), step_(step), last_step_(last_step) {}

 private:
  pendula::Outcome go(pendula::Integrator& integrator) override {
    pendula::Outcome outcome;
    for (int k = 1; k <= steps_ && outcome; ++k) outcome = integrator.step(k < steps_ ? step_ : last_step_);
    return outcome;
  }

  int steps_;
  double step_, last_step_;
};

/// Steps of the method's own choice.
class ChosenSteps : public PendulaRun {
 public:
  ChosenSteps(const Problem& problem, const RunOptions& options)
      : PendulaRun(problem, options), duration_(problem.duration) {}

 private:
  pendula::Outcome go(pendula::Integrator& integrator) override {
    pendula::Outcome outcome;
    while (outcome && integrator.time() < duration_) outcome = integrator.step(duration_ - integrator.time());
    return outcome;
  }

  double duration_;
};

std::unique_ptr<Run> make_whole_run(const Problem& problem, const RunOptions& options, int steps) {
  const double step = summing_step(problem, steps);
  return std::make_unique<ConstantSteps>(problem, options, steps, step, problem.duration - (steps - 1) * step);
}

RunOptions options_of(int stages, Solver solver, Iteration iteration) {
  return {.stages = stages, .solver = solver, .iteration = iteration};
}

void add(std::vector<Contestant>& contestants, const std::string& name, const RunOptions& options, double coarsest,
         double factor, int count) {
  const auto built_in = [options](const Problem& problem) {
    if (options.solver != Solver::dense) return true;
    if (!problem.kernel.empty()) return subject_of(problem) != nullptr;
    const auto kernels = pendula::built_in_kernels();
    return std::any_of(kernels.begin(), kernels.end(), [&](const pendula::KernelInfo& kernel) {
      return kernel.space == Planar::name && kernel.links == problem.links;
    });
  };
  const auto settings = [=](const Problem& problem) { return step_counts(problem, coarsest, factor, count); };
  const auto make = [options](const Problem& problem, double steps) {
    return make_whole_run(problem, options, static_cast<int>(steps));
  };
  contestants.push_back({"pendula " + name, "steps", built_in, settings, make});
}

/// As the program does where a scenario names a tolerance and nothing else.
void add_by_tolerance(std::vector<Contestant>& contestants) {
  const auto any = [](const Problem& problem) { return problem.kernel.empty(); };
  const auto settings = [](const Problem&) { return tolerances(9, 17, 2); };
  const auto make = [](const Problem& problem, double tolerance) {
    const int stages = pendula::stages_for(Method::gauss, tolerance);
    return std::make_unique<ChosenSteps>(problem, RunOptions{.stages = stages, .step = 0, .tolerance = tolerance});
  };
  contestants.push_back({"pendula by tolerance", "tolerance", any, settings, make});
}

}  // namespace

std::unique_ptr<Run> make_pendula(const Problem& problem, const RunOptions& options, int steps, double step) {
  return std::make_unique<ConstantSteps>(problem, options, steps, step, step);
}

void add_pendula(std::vector<Contestant>& contestants) {
  const auto chain = [](int stages, Iteration iteration) { return options_of(stages, Solver::chain, iteration); };
  add_by_tolerance(contestants);
  add(contestants, "s = 8 fixed point", chain(8, Iteration::fixed_point), 0.7, 1.07, 40);
  add(contestants, "s = 6 fixed point", chain(6, Iteration::fixed_point), 0.7, 1.1, 30);
  add(contestants, "s = 8 Newton", chain(8, Iteration::newton), 0.7, 1.1, 30);
  add(contestants, "s = 4 Newton", chain(4, Iteration::newton), 1, 1.5, 14);
  add(contestants, "s = 2 Newton", chain(2, Iteration::newton), 1, 2, 12);
}

void add_kernels(std::vector<Contestant>& contestants) {
  const auto kernel = [](int stages, Iteration iteration) { return options_of(stages, Solver::dense, iteration); };
  for (const int stages : {8, 6}) {
    const std::string name = "kernel s = " + std::to_string(stages);
    add(contestants, name, kernel(stages, Iteration::automatic), 0.7, 1.07, 40);
    add(contestants, name + " fixed point", kernel(stages, Iteration::fixed_point), 0.7, 1.07, 40);
  }
  add(contestants, "kernel s = 8 Newton", kernel(8, Iteration::newton), 0.7, 1.1, 30);
}

}  // namespace bench
