#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "io/input_error.hpp"
#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"

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

/// Checks of anything that moves by its integrators, through the same door as every run.
class IntegrationCheck {
 public:
  /// `time` is how long it moves, few of its own times.
  IntegrationCheck(std::string_view kernel, const Subject& subject, Motion start, double time)
      : kernel_(kernel), subject_(subject), start_(std::move(start)), time_(time) {}

  // What was measured is the worst of the committed kernels and the built-in models.
  std::vector<CheckLine> lines() const {
    std::vector<CheckLine> lines;
    for (const Form form : {Form::momentum, Form::velocity}) {
      for (const int stages : {1, 2, 3}) {
        lines.push_back(
            line(label("order", stages, form), order(stages, form), 2 * stages - 0.3));  // measured 2s − 0.27
        lines.back().at_least = true;
      }
    }
    for (const Form form : {Form::momentum, Form::velocity}) {
      lines.push_back(line(label("energy error", 6, form), energy_error(6, form), 1e-12));  // measured 9.5e-16
    }
    lines.push_back(line(label("way back", 4, Form::momentum), time_reversal(), 1e-11));  // measured 2.4e-15
    lines.push_back(line("newton = fixed point, 6 stages",
                         distance(end(Solver::dense, Iteration::newton), end(Solver::dense, Iteration::fixed_point)),
                         1e-11));                                                        // measured 1.3e-15
    lines.push_back(line("looks into a step, 6 stages", farthest_look(), 1e-11));        // measured 2.6e-12, else 2e-15
    lines.push_back(line("glances into a step, 6 stages", farthest_glance(), 1e-4));     // measured 3.9e-6
    lines.push_back(line("an event's time, relative, 6 stages", event_error(), 1e-10));  // measured 2.3e-15
    if (!subject_.loaded()) {
      lines.push_back(line("tangents: D'JD = J, 4 stages", symplectic_defect(), 1e-13));  // measured 2.7e-17
    }
    return lines;
  }

  /// How far the ends of runs by the dense kernel and by the chain solver are apart.
  CheckLine dense_to_chain(Iteration iteration) const {
    return line("dense = chain, 6 stages, " + std::string(name_of(iteration)),
                distance(end(Solver::chain, iteration), end(Solver::dense, Iteration::automatic)),
                1e-12);  // measured 1.6e-15
  }

 private:
  CheckLine line(const std::string& what, double measured, double limit) const {
    return {kernel_, what, measured, limit};
  }

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

  struct End {
    Motion motion;
    double work = 0;  // that loads brought  [J]
  };

  /// The state after `steps` steps over `time`, which is negative on the way back; NaN where a step fails.
  End run(const RunOptions& options, const Motion& start, int steps, double time) const {
    const auto integrator = subject_.make_integrator(options);
    bool ok = static_cast<bool>(integrator->start(start));
    for (int i = 0; i < steps && ok; ++i) ok = static_cast<bool>(integrator->step(time / steps));
    End end{integrator->state(), integrator->statistics().load_work};
    if (!ok) end.motion.q.setConstant(std::numeric_limits<double>::quiet_NaN());
    return end;
  }

  Motion end(Solver solver, Iteration iteration) const {
    RunOptions wanted = options(6, Form::momentum, solver);
    wanted.iteration = iteration;
    return run(wanted, start_, 16, time_).motion;
  }

  static double distance(const Motion& a, const Motion& b) {
    const double q = (a.q - b.q).cwiseAbs().maxCoeff();
    return a.q.allFinite() && b.q.allFinite() ? std::max(q, (a.v - b.v).cwiseAbs().maxCoeff())
                                              : std::numeric_limits<double>::quiet_NaN();
  }

  /// Order from the errors of steps that are four times apart, against eight stages; of smaller steps where errors of
  /// these are no power of the step yet.
  double order(int stages, Form form) const {
    const Motion exact = run(options(8, Form::momentum), start_, 16, time_).motion;
    int steps = stages == 1 ? 32 : stages == 2 ? 8 : 4;
    double error = error_of(stages, form, steps, exact), order = 0;
    for (int refinement = 0; refinement < 4 && order < 2 * stages - 0.3; ++refinement, steps *= 2) {
      const double smaller = error_of(stages, form, 4 * steps, exact);
      if (refinement > 0 && smaller < 1e-12) break;
      order = std::log2(error / smaller) / 2;
      error = error_of(stages, form, 2 * steps, exact);
    }
    return order;
  }

  double error_of(int stages, Form form, int steps, const Motion& exact) const {
    return distance(run(options(stages, form), start_, steps, time_).motion, exact);
  }

  /// Of the balance of energy and what loads brought.
  double energy_error(int stages, Form form) const {
    const End end = run(options(stages, form), start_, 32, time_);
    const Observation before = subject_.observe(start_), after = subject_.observe(end.motion);
    const double most = std::max({before.kinetic, after.kinetic, std::abs(end.work)});
    const double scale = std::max(subject_.energy_scale().value_or(0), most);
    return std::abs(after.energy - before.energy - end.work) / (scale > 0 ? scale : 1);
  }

  double time_reversal() const {
    const Motion end = run(options(4, Form::momentum), start_, 16, time_).motion;
    return distance(run(options(4, Form::momentum), end, 16, start_.time - end.time).motion, start_);
  }

  /// Of states within one step of a quarter of the time, by `find`, from those where shorter steps end.
  template <class Find>
  double farthest_within(Find find) const {
    const double step = time_ / 4;
    double farthest = 0;
    for (const double part : {0.0, 0.19, 0.5, 0.83, 1.0}) {
      const auto integrator = subject_.make_integrator(options(6, Form::momentum));
      integrator->start(start_);
      integrator->remember_steps(true);
      if (!integrator->step(step)) return std::numeric_limits<double>::quiet_NaN();
      const Motion found = find(*integrator, start_.time + part * step);
      const Motion there = part == 0 ? start_ : run(options(8, Form::momentum), start_, 8, part * step).motion;
      farthest = std::max(farthest, distance(found, there));
    }
    return farthest;
  }
  double farthest_look() const {
    return farthest_within([](Integrator& integrator, double time) {
      Motion there;
      integrator.look(time, there);
      return there;
    });
  }
  double farthest_glance() const {
    return farthest_within([](Integrator& integrator, double time) { return integrator.glance(time); });
  }

  /// The event is that the fastest coordinate comes by where it is after 0.37 of the time.
  double event_error() const {
    const double when = 0.37 * time_;
    const Motion there = run(options(8, Form::momentum), start_, 16, when).motion;
    Eigen::Index fastest = 0;
    there.v.cwiseAbs().maxCoeff(&fastest);
    RunSetup setup;
    setup.subject = {std::shared_ptr<void>(), &subject_};
    setup.start = start_;
    setup.options = options(6, Form::momentum);
    setup.duration = time_;
    setup.doubted = false;
    setup.options.step = time_ / 8;
    setup.events = {{"there", [&](const Motion& motion) { return motion.q[fastest] - there.q[fastest]; }}};
    const RunReport report = Run(setup).go();
    const EventTally& tally = report.events.front();
    const double first = std::abs(tally.first - start_.time - when), last = std::abs(tally.last - start_.time - when);
    return std::min(first, last) / when;
  }

  /// Of the derivative of a step, in coordinates and momenta.
  double symplectic_defect() const {
    const auto integrator = subject_.make_integrator(options(4, Form::momentum));
    const Eigen::Index rows = integrator->linearize(), half = rows / 2;
    integrator->start(start_);
    if (!integrator->step(time_ / 4)) return std::numeric_limits<double>::quiet_NaN();
    Directions<> derivative = Eigen::MatrixXd::Identity(rows, rows);
    integrator->push(derivative);
    Eigen::MatrixXd form = Eigen::MatrixXd::Zero(rows, rows);
    form.topRightCorner(half, half).setIdentity();
    form.bottomLeftCorner(half, half) = -form.topRightCorner(half, half);
    const Eigen::MatrixXd D = derivative;
    return (D.transpose() * form * D - form).cwiseAbs().maxCoeff() / D.squaredNorm();
  }

  std::string_view kernel_;
  const Subject& subject_;
  Motion start_;
  double time_;
};

/// A start for a system of which nothing is known: angles and lengths that differ, slow rates.
Motion any_start(const SystemInfo& info) {
  const auto count = static_cast<Eigen::Index>(info.coordinates.size());
  Motion start(0, Eigen::VectorXd(count), Eigen::VectorXd(count));
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto number = static_cast<double>(k);
    start.q[k] = (info.is_angle[static_cast<std::size_t>(k)] ? 0.7 : 1.2) + 0.3 * std::sin(number);
    start.v[k] = 0.2 * std::cos(2 * number);
  }
  return start;
}

/// A time that eight stages in sixteen steps follow to round-off, at most 0.4 s.
double followed_time(const Subject& subject, const Motion& start) {
  RunOptions options;
  options.stages = 8;
  options.solver = Solver::dense;
  double time = 0.4;
  for (int halvings = 0; halvings < 20; ++halvings, time /= 2) {
    const auto fine = subject.make_integrator(options), coarse = subject.make_integrator(options);
    bool ok = fine->start(start) && coarse->start(start);
    for (int i = 0; i < 32 && ok; ++i) ok = static_cast<bool>(fine->step(time / 32));
    for (int i = 0; i < 4 && ok; ++i) ok = static_cast<bool>(coarse->step(time / 4));
    if (ok && subject.distance(fine->state(), coarse->state()) < 1e-9) break;
  }
  return time;
}

void print(const CheckLine& line) {
  std::cout << std::left << std::setw(17) << line.kernel << std::setw(46) << line.what << std::right << std::setw(10)
            << rounded(line.measured, 3) << (line.at_least ? "  >= " : "  <= ") << std::left << std::setw(8)
            << rounded(line.limit, 3) << (line.ok() ? "ok" : "FAILED") << '\n';
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

void add(const KernelCheck& check, std::string_view kernel, Tally& tally) {
  for (const KernelCheck::Line& line : std::span(check.lines).first(static_cast<std::size_t>(check.count))) {
    tally.add({kernel, std::string(line.what), line.error, line.limit});
  }
}

constexpr unsigned seed = 1;

template <class Space>
void check_space(const CheckOptions& options, Tally& tally) {
  if (options.space && *options.space != Space::name) return;
  for (const KernelEntry& entry : library_of<Space>().kernels) {
    const int links = entry.info.links;
    if (options.links && *options.links != links) continue;
    add(entry.check(seed), entry.info.name, tally);
    const ChainSubject<Space> subject(test_chain<Space>(links));
    const IntegrationCheck check(entry.info.name, subject, test_start<Space>(links), 0.4 / std::sqrt(links));
    for (const CheckLine& line : check.lines()) tally.add(line);
    for (const Iteration iteration : {Iteration::newton, Iteration::fixed_point}) {
      tally.add(check.dense_to_chain(iteration));
    }
  }
}

void check_system(const SystemSubject& subject, const KernelCheck& check, const Motion& start, Tally& tally) {
  add(check, subject.info().name, tally);
  const IntegrationCheck integration(subject.info().name, subject, start, followed_time(subject, start));
  for (const CheckLine& line : integration.lines()) tally.add(line);
}

/// A system with its defaults, 1 where it has none.
SystemNumbers usual_numbers(const SystemInfo& info) {
  SystemNumbers numbers;
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    const double usual = info.parameter_defaults[k];
    numbers.parameters.insert(numbers.parameters.end(), static_cast<std::size_t>(info.parameter_sizes[k]),
                              std::isfinite(usual) ? usual : 1.0);
  }
  numbers.inputs.assign(info.inputs.size(), 0.0);
  return numbers;
}

void check_model(const CheckOptions& options, Tally& tally) {
  const auto tell = [](const std::string& what) { std::cerr << "pendula: " << what << '\n'; };
  const io::Toolchain toolchain = io::Toolchain::of_this_program();
  if (options.model->ends_with(".toml")) {
    const io::FindSystem find = [&](const std::string& model, std::optional<int> links,
                                    const std::filesystem::path& folder) {
      return io::find_kernel(model, links, folder, toolchain, tell).entry;
    };
    const io::AnyScenario any = io::read_scenario(*options.model, {}, find);
    const auto* scenario = std::get_if<io::SystemScenario>(&any);
    if (scenario == nullptr) throw io::InputError(*options.model + ": check: expected a scenario with [system]");
    check_system(*scenario->system, scenario->system->check(seed), scenario->start, tally);
    return;
  }
  try {
    const auto entry = io::find_kernel(*options.model, options.links, "", toolchain, tell).entry;
    const SystemSubject subject(entry, usual_numbers(entry->info));
    check_system(subject, entry->check(seed), any_start(entry->info), tally);
  } catch (const io::ModelError& error) {
    throw io::InputError("check: " + std::string(error.what()));
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
  if (options.model) {
    check_model(options, tally);
  } else {
    check_space<Planar>(options, tally);
    check_space<Spatial>(options, tally);
  }
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
