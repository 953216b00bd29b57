#include "cli/motion_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <utility>

namespace pendula::cli {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double epsilon = std::numeric_limits<double>::epsilon();

// Largest measured distance in roundings: 1.5, over the committed kernels, the built-in models, and those of examples
// and tests, with parameters over four decades.
constexpr double most_roundings = 30;

std::string label(const std::string& what, int stages, Form form) {
  return what + ", " + std::to_string(stages) + (stages == 1 ? " stage, " : " stages, ") +
         (form == Form::momentum ? "momentum" : "velocity") + " form";
}

// Velocity form and derivatives cannot keep constraints.
bool has_constraints(const Subject& subject) {
  const auto* const system = dynamic_cast<const SystemSubject*>(&subject);
  return system != nullptr && !system->info().constraints.empty();
}

}  // namespace

// Doubles the time, from a picosecond up to thirty thousand years, until eight steps no longer follow the motion;
// longer times might step over forces that act for a moment only. The first times may be too short: where forces nearly
// balance at the start, only rounding moves. Checks run over half that time, or less if that is not short enough.
MotionCheck::MotionCheck(std::string_view kernel, const Subject& subject, Motion start, std::vector<std::string> units,
                         double energy_rounding)
    : kernel_(kernel),
      subject_(subject),
      start_(std::move(start)),
      units_(std::move(units)),
      energy_rounding_(energy_rounding) {
  const double longest = std::ldexp(1.0, 40);
  // In steps far shorter than the motion, constraints see nothing but rounding, and may refuse some.
  double time = std::ldexp(1.0, has_constraints(subject_) ? -20 : -40);
  while (time < longest && !follows(time)) time *= 2;
  for (; time < longest && follows(time); time *= 2) time_ = time;
  constexpr int most_spans = 8;
  for (int k = 1; k <= most_spans && time_ > 0; ++k) {
    if (std::optional<Span> found = span(std::ldexp(time_, -k))) spans_.push_back(std::move(*found));
  }
  if (spans_.empty()) time_ = 0;
}

std::vector<CheckLine> MotionCheck::lines() const {
  std::vector<CheckLine> lines;
  const auto add = [&](const std::function<CheckLine(const Span&)>& line) { lines.push_back(best(line)); };
  std::vector<Form> forms = {Form::momentum};
  const bool is_free = !has_constraints(subject_);
  if (is_free) forms.push_back(Form::velocity);
  for (const Form form : forms) {
    for (const int stages : {1, 2, 3}) {
      add([this, stages, form](const Span& span) { return order(stages, form, span); });
    }
  }
  for (const Form form : forms) {
    add([this, form](const Span& span) { return energy(form, span); });
  }
  add([this](const Span& span) { return way_back(span); });
  add([this](const Span& span) { return iterations(span); });
  add([this](const Span& span) { return full_order(span); });
  add([this](const Span& span) { return dense_output(span); });
  add([this](const Span& span) { return event(span); });
  const bool differentiates = is_free && !subject_.loaded() && subject_.switches().empty();
  if (differentiates) add([this](const Span& span) { return tangents(span); });
  return lines;
}

CheckLine MotionCheck::dense_to_chain(Iteration iteration) const {
  return best([this, iteration](const Span& span) {
    RunOptions chain = options(6, Form::momentum, Solver::chain);
    chain.iteration = iteration;
    return at_most("dense = chain, 6 stages, " + std::string(name_of(iteration)),
                   roundings(end(chain, 16, span), end(options(6, Form::momentum), 16, span), span));
  });
}

/// The line of the first span that passes, or the best line.
CheckLine MotionCheck::best(const std::function<CheckLine(const Span&)>& line) const {
  CheckLine best;
  for (const Span& span : spans_) {
    CheckLine found = line(span);
    if (found.ok()) return found;
    const bool nearer = found.at_least ? found.measured > best.measured : found.measured < best.measured;
    if (best.what.empty() || std::isnan(best.measured) || nearer) best = std::move(found);
  }
  return best;
}

CheckLine MotionCheck::at_most(const std::string& what, double roundings) const {
  return {kernel_, what, roundings, most_roundings};
}

CheckLine MotionCheck::at_least(const std::string& what, double order, double limit) const {
  return {kernel_, what, order, limit, true};
}

RunOptions MotionCheck::options(int stages, Form form, Solver solver) {
  RunOptions options;
  options.stages = stages;
  options.form = form;
  options.solver = solver;
  return options;
}

double MotionCheck::distance(const std::optional<Motion>& a, const std::optional<Motion>& b, const Span& span) {
  if (!a || !b) return none;
  return std::max(((a->q - b->q).array() / span.q.array()).abs().maxCoeff(),
                  ((a->v - b->v).array() / span.v.array()).abs().maxCoeff());
}

/// The distance in roundings: 1 is the distance to which a rounding in each of 32 steps grows.
double MotionCheck::roundings(const std::optional<Motion>& a, const std::optional<Motion>& b, const Span& span) {
  return distance(a, b, span) / (32 * epsilon * span.growth);
}

/// The state after `steps` steps over `time`, which is negative on the way back; empty if a step failed, or was
/// divided.
std::optional<MotionCheck::End> MotionCheck::run(const RunOptions& options, const Motion& start, int steps,
                                                 double time) const {
  const auto integrator = subject_.make_integrator(options);
  if (!integrator->start(start)) return std::nullopt;
  for (int i = 0; i < steps; ++i) {
    if (!integrator->step(time / steps) || integrator->statistics().rejected_steps > 0) return std::nullopt;
  }
  End end{integrator->state(), integrator->statistics().load_work};
  if (!end.motion.q.allFinite() || !end.motion.v.allFinite()) return std::nullopt;
  return end;
}

std::optional<Motion> MotionCheck::end(const RunOptions& options, int steps, const Span& span) const {
  const std::optional<End> end = run(options, start_, steps, span.time);
  return end ? std::optional(end->motion) : std::nullopt;
}

/// The end by adaptive steps, which notice forces that act for less than a step.
std::optional<Motion> MotionCheck::own_steps(double time) const {
  RunSetup setup{{options(8, Form::momentum), time, std::numeric_limits<std::int64_t>::max()},
                 {std::shared_ptr<void>(), &subject_},
                 start_,
                 false};
  setup.options.step = 0;
  setup.options.tolerance = 1e-10;
  const RunReport report = Run(setup).go();
  return report.end == RunEnd::complete ? std::optional(report.last) : std::nullopt;
}

/// A span with its sizes only.
std::optional<MotionCheck::Span> MotionCheck::sized(double time) const {
  constexpr int steps = 16;
  const auto integrator = subject_.make_integrator(options(8, Form::momentum));
  if (!integrator->start(start_)) return std::nullopt;
  Eigen::VectorXd q = start_.q.cwiseAbs(), v = start_.v.cwiseAbs();
  for (int i = 0; i < steps; ++i) {
    if (!integrator->step(time / steps)) return std::nullopt;
    const Motion motion = integrator->state();
    q = q.cwiseMax(motion.q.cwiseAbs());
    v = v.cwiseMax(motion.v.cwiseAbs());
  }
  if (!q.allFinite() || !v.allFinite()) return std::nullopt;
  Span span;
  span.time = time;
  span.q = q;
  span.v = v;
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      if (units_[static_cast<std::size_t>(i)] != units_[static_cast<std::size_t>(k)]) continue;
      span.q[k] = std::max({span.q[k], q[i], v[i] * time});
      span.v[k] = std::max({span.v[k], v[i], q[i] / time});
    }
    if (span.q[k] == 0) span.q[k] = span.v[k] = 1;
  }
  return span;
}

/// Whether eight stages with steps of several sizes agree on the end.
bool MotionCheck::follows(double time) const {
  const std::optional<Span> span = sized(time);
  if (!span) return false;
  const RunOptions eight = options(8, Form::momentum);
  RunOptions fixed_point = options(6, Form::momentum);
  fixed_point.iteration = Iteration::fixed_point;
  const std::optional<Motion> fine = end(eight, 16, *span);
  for (const auto& [option, steps] : {std::pair(eight, 8), std::pair(eight, 21), std::pair(fixed_point, 16)}) {
    if (!(distance(fine, end(option, steps, *span), *span) < 1e-10)) return false;
  }
  return !subject_.loaded() || distance(fine, own_steps(time), *span) < 1e-7;
}

/// A span; empty if the motion is chaotic within it.
std::optional<MotionCheck::Span> MotionCheck::span(double time) const {
  std::optional<Span> span = sized(time);
  if (!span) return std::nullopt;
  span->growth = std::max(growth(start_, time, *span), 1.0);
  const RunOptions eight = options(8, Form::momentum);
  const std::optional<Motion> exact = end(eight, 32, *span), other = end(eight, 21, *span);
  if (!exact || !other || !(span->growth < 1e6)) return std::nullopt;
  span->exact = *exact;
  span->noise = std::max(100 * epsilon * span->growth, 10 * distance(exact, other, *span));
  return span;
}

/// The factor by which a small change of a state grows.
double MotionCheck::growth(const Motion& from, double time, const Span& span) const {
  constexpr double change = 1e-9;
  Motion near = from;
  for (Eigen::Index k = 0; k < near.q.size(); ++k) {
    near.q[k] += (k % 2 == 0 ? change : -change) * span.q[k];
    near.v[k] += (k % 3 == 0 ? change : -change) * span.v[k];
  }
  subject_.close(near);
  const RunOptions eight = options(8, Form::momentum);
  const std::optional<End> there = run(eight, from, 16, time), nearby = run(eight, near, 16, time);
  return there && nearby ? distance(there->motion, nearby->motion, span) / change : none;
}

/// The order from three successive errors above the noise, each for half the step: the best of them. If errors are
/// noise for steps of any size, the error itself.
CheckLine MotionCheck::order(int stages, Form form, const Span& span) const {
  std::vector<double> errors;
  double error = none, order = none;
  for (int steps = 2; steps <= 256 && !(error < span.noise); steps *= 2) {
    error = distance(end(options(stages, form), steps, span), span.exact, span);
    if (error >= span.noise) errors.push_back(error);
  }
  for (std::size_t k = 0; k + 2 < errors.size(); ++k) {
    const double first = std::log2(errors[k] / errors[k + 1]), second = std::log2(errors[k + 1] / errors[k + 2]);
    const double worse = std::min(first, second);
    if (std::max(first, second) < 2 * stages + 1 && !(worse <= order)) order = worse;
  }
  if (errors.empty())
    return at_most(label("error", stages, form), roundings(end(options(stages, form), 2, span), span.exact, span));
  return at_least(label("order", stages, form), order, 2 * stages - 0.5);
}

/// The error of the balance of energy with the work of loads, in roundings of the energy.
CheckLine MotionCheck::energy(Form form, const Span& span) const {
  double roundings = none;
  if (const std::optional<End> end = run(options(6, form), start_, 32, span.time)) {
    const Observation before = subject_.observe(start_), after = subject_.observe(end->motion);
    const double error = std::abs(after.energy - before.energy - end->work);
    const double largest = std::max({before.kinetic, after.kinetic, std::abs(before.energy), std::abs(after.energy),
                                     std::abs(end->work), subject_.energy_scale().value_or(0)});
    const double one = std::max(epsilon * largest, energy_rounding_);
    roundings = error == 0 ? 0 : error / (32 * one);
  }
  return at_most(label("energy", 6, form), roundings);
}

CheckLine MotionCheck::way_back(const Span& span) const {
  const RunOptions four = options(4, Form::momentum);
  double off = none;
  if (const std::optional<End> there = run(four, start_, 16, span.time)) {
    const double back = start_.time - there->motion.time;
    if (const std::optional<End> home = run(four, there->motion, 16, back)) {
      Span both = span;
      both.growth *= std::max(growth(there->motion, back, span), 1.0);
      off = roundings(home->motion, start_, both);
    }
  }
  return at_most(label("way back", 4, Form::momentum), off);
}

CheckLine MotionCheck::iterations(const Span& span) const {
  RunOptions newton = options(6, Form::momentum), fixed_point = newton;
  newton.iteration = Iteration::newton;
  fixed_point.iteration = Iteration::fixed_point;
  return at_most("newton = fixed point, 6 stages", roundings(end(newton, 16, span), end(fixed_point, 16, span), span));
}

/// The largest distance of states within a step, as `find` gives them, from the ends of shorter steps.
template <class Find>
double MotionCheck::farthest_within(double step, const Span& span, Find find) const {
  double farthest = 0;
  for (const double part : {0.0, 0.19, 0.5, 0.83, 1.0}) {
    const auto integrator = subject_.make_integrator(options(6, Form::momentum));
    integrator->start(start_);
    integrator->remember_steps(true);
    if (!integrator->step(step) || integrator->statistics().rejected_steps > 0) return none;
    const double time = start_.time + part * step;
    const std::optional<End> there =
        part == 0 ? End{start_, 0} : run(options(8, Form::momentum), start_, 4, time - start_.time);
    const double off = there ? distance(find(*integrator, time), there->motion, span) : none;
    if (std::isnan(off)) return none;
    farthest = std::max(farthest, off);
  }
  return farthest;
}

CheckLine MotionCheck::full_order(const Span& span) const {
  const auto state = [](Integrator& integrator, double time) {
    Motion there;
    integrator.at_full_order(time, there);
    return there;
  };
  const double off = farthest_within(span.time / 16, span, state);
  return at_most("looks into a step, 6 stages", off / (32 * epsilon * span.growth));
}

/// Dense output: its order is that of rates among the stages.
CheckLine MotionCheck::dense_output(const Span& span) const {
  const auto state = [](Integrator& integrator, double time) { return integrator.at(time); };
  const double step = span.time / 8;
  const double off = farthest_within(step, span, state), nearer = farthest_within(step / 2, span, state);
  if (off < span.noise) return at_most("glances into a step, 6 stages", off / (32 * epsilon * span.growth));
  return at_least("order of glances into a step, 6 stages", nearer < span.noise ? none : std::log2(off / nearer), 5);
}

/// Checks an event: the fastest coordinate passes the value that it has after a while.
CheckLine MotionCheck::event(const Span& span) const {
  const double duration = span.time / 4, when = 0.37 * duration;
  const std::string what = "where an event happens, 6 stages";
  const std::optional<End> there = run(options(8, Form::momentum), start_, 16, when);
  if (!there) return at_most(what, none);
  Eigen::Index fastest = 0;
  const double speed = (there->motion.v.array() / span.v.array()).abs().maxCoeff(&fastest);
  if (speed < 1e-6) return at_most(what, 0);  // nothing moves
  RunSetup setup{{options(6, Form::momentum), duration}, {std::shared_ptr<void>(), &subject_}, start_, false};
  setup.options.step = duration / 4;
  setup.events = {{"there", [&](const Motion& motion) { return motion.q[fastest] - there->motion.q[fastest]; }}};
  const RunReport report = Run(setup).go();
  const EventTally& tally = report.events.front();
  const double off = std::min(std::abs(tally.first - start_.time - when), std::abs(tally.last - start_.time - when));
  const double moved = off * std::abs(there->motion.v[fastest]) / span.q[fastest];
  return at_most(what, moved / (32 * epsilon * span.growth));
}

/// The error of symplecticity of the derivative of a step, in coordinates and momenta, relative to its size. Momenta
/// are scaled so that each moves its coordinate by as much as itself.
CheckLine MotionCheck::tangents(const Span& span) const {
  const std::string what = "tangents: D'JD = J, 4 stages";
  const auto integrator = subject_.make_integrator(options(4, Form::momentum));
  const Eigen::Index rows = integrator->linearize(), half = rows / 2;
  integrator->start(start_);
  if (!integrator->step(span.time / 16)) return at_most(what, none);
  Directions<> derivative = Eigen::MatrixXd::Identity(rows, rows);
  integrator->push(derivative);
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(rows, rows);
  form.topRightCorner(half, half).setIdentity();
  form.bottomLeftCorner(half, half) = -form.topRightCorner(half, half);
  Eigen::VectorXd unit(rows);
  unit.head(half) = derivative.topRightCorner(half, half).diagonal().cwiseAbs().cwiseSqrt();
  unit.tail(half) = unit.head(half).cwiseInverse();
  const Eigen::MatrixXd D = unit.asDiagonal().inverse() * derivative * unit.asDiagonal();
  if (!D.allFinite()) return at_most(what, none);
  const double defect = (D.transpose() * form * D - form).cwiseAbs().maxCoeff();
  return at_most(what, defect / (epsilon * D.squaredNorm()));
}

}  // namespace pendula::cli
