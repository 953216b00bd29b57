#include <algorithm>
#include <contestant.hpp>
#include <peers/pendula.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/method_choice.hpp>
#include <systems.hpp>
#include <tuple>
#include <utility>

namespace bench {
namespace {

using pendula::Form, pendula::Iteration, pendula::Method, pendula::Planar, pendula::RunOptions, pendula::Solver;

/// What a run is of, and from where.
std::pair<std::shared_ptr<const pendula::Subject>, pendula::Motion> start_of(const Problem& problem) {
  if (problem.kernel.empty()) {
    const auto angles = Eigen::VectorXd::Constant(problem.links, problem.angle);
    return {std::make_shared<pendula::ChainSubject<Planar>>(chain_of(problem)),
            pendula::State<Planar>::from_angles(angles)};
  }
  const SystemStart& start = system_start(problem);
  const auto vector = [](const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  return {subject_of(problem), {0, vector(start.q), vector(start.v)}};
}

/// A run of the library; how long its steps are is for those that derive from it.
class PendulaRun : public Run {
 public:
  PendulaRun(const Problem& problem, const RunOptions& options) : problem_(problem) {
    std::shared_ptr<const pendula::Subject> subject;
    std::tie(subject, start_) = start_of(problem);
    integrator_ = subject->make_integrator(options);
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

RunOptions by_tolerance(Method method, double tolerance) {
  return {.method = method, .stages = pendula::stages_for(method, tolerance), .step = 0, .tolerance = tolerance};
}

/// As the program does where a scenario names a tolerance and nothing else. Choosing is not timed, as nothing is that
/// makes a run ready.
RunOptions chosen_options(const Problem& problem, double tolerance) {
  pendula::RunSetup setup;
  std::tie(setup.subject, setup.start) = start_of(problem);
  setup.options = by_tolerance(Method::gauss, tolerance);
  setup.duration = problem.duration;
  const double of_series = pendula::choose_method(setup).series_tolerance;
  return of_series > 0 ? by_tolerance(Method::taylor, of_series) : setup.options;
}

void add_by_tolerance(std::vector<Contestant>& contestants) {
  const auto built_in = [](const Problem& problem) { return problem.kernel.empty() || subject_of(problem) != nullptr; };
  const auto settings = [](const Problem&) { return tolerances(4, 17, 2); };
  const auto make = [](const Problem& problem, double tolerance) {
    return std::make_unique<ChosenSteps>(problem, chosen_options(problem, tolerance));
  };
  contestants.push_back({"pendula by tolerance", "tolerance", built_in, settings, make});
}

/// Steps by one method, whatever would be chosen.
void add_method(std::vector<Contestant>& contestants, const std::string& name, Method method) {
  const auto few = [](const Problem& problem) {
    return problem.kernel.empty() ? problem.links <= 4 : subject_of(problem) != nullptr;
  };
  const auto settings = [](const Problem&) { return tolerances(4, 17, 2); };
  const auto make = [method](const Problem& problem, double tolerance) {
    return std::make_unique<ChosenSteps>(problem, by_tolerance(method, tolerance));
  };
  contestants.push_back({"pendula " + name, "tolerance", few, settings, make});
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
  add_by_tolerance(contestants);
  add_method(contestants, "series", Method::taylor);
  add_method(contestants, "Gauss by tolerance", Method::gauss);
  const auto kernel = [](int stages, Iteration iteration) { return options_of(stages, Solver::dense, iteration); };
  for (const int stages : {8, 6}) {
    const std::string name = "kernel s = " + std::to_string(stages);
    add(contestants, name, kernel(stages, Iteration::automatic), 0.7, 1.07, 40);
    add(contestants, name + " fixed point", kernel(stages, Iteration::fixed_point), 0.7, 1.07, 40);
  }
  add(contestants, "kernel s = 8 Newton", kernel(8, Iteration::newton), 0.7, 1.1, 30);
}

}  // namespace bench
