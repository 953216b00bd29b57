#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/linearize.hpp>
#include <pendula/run/method_choice.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>

namespace pendula {
namespace {

constexpr int most_coordinates = 10;    // generated kernels write their series out up to here
constexpr int always_few = 2, few = 3;  // links; with three, Gauss steps are faster below fine_tolerance
constexpr double fine_tolerance = 1e-10;
constexpr double short_run = 100;  // steps

/// Why Taylor series are not chosen for a subject: it has none, or Gauss steps take less time. Empty if they may be.
std::string against_series(const Subject& subject, double tolerance) {
  if (const auto* const system = dynamic_cast<const SystemSubject*>(&subject)) {
    if (!system->info().constraints.empty()) return "constraints";
    if (system->table().of_1.series_next == nullptr) return "no series in the kernel";
    if (system->info().coordinates.size() > most_coordinates) return "many coordinates";
    if (system->info().depends_on_time) return "time in the equations";
    if (!system->switches().empty() && !system->info().argument_is_base.empty()) return "roots in functions of pieces";
    return system->may_be_narrow() ? "forces that may be narrow" : "";
  }
  if (dynamic_cast<const ChainSubject<Spatial>*>(&subject) != nullptr) return "a chain in space";
  const auto* const chain = dynamic_cast<const ChainSubject<Planar>*>(&subject);
  if (chain == nullptr) return "inputs that change from step to step";
  const int links = chain->chain().links();
  if (links > (tolerance < fine_tolerance ? always_few : few)) return "many links";
  return series_kernel<Planar>(links, true, false) == nullptr ? "no kernel for the number of links" : "";
}

/// Whether a motion is stiff at a state: damping is much faster there than all that swings or turns, so that it limits
/// explicit steps.
bool is_stiff(const Subject& subject, const Motion& place) {
  constexpr double much = 5;
  const Directions<> a = linearize(subject, place).a;
  if (!a.allFinite()) return true;
  double decay = 0, pace = place.v.cwiseAbs().maxCoeff();
  for (const std::complex<double>& rate : eigenvalues(a)) {
    decay = std::max(decay, -rate.real());
    pace = std::max({pace, rate.real(), std::abs(rate.imag())});
  }
  return decay > much * pace;
}

/// Whether the motion is stiff at the start, or at a state that coarse steps reach: friction grows as rates fall, and a
/// mass may run into a damper. A start at rest is not asked: a level rod does not swing, so any damping seems fast.
bool becomes_stiff(const RunSetup& setup) {
  constexpr int most_steps = 256;
  const Subject& subject = *setup.subject;
  if (setup.start.v.any() && is_stiff(subject, setup.start)) return true;
  RunOptions coarse = setup.options;
  coarse.stages = 4;
  coarse.tolerance = 1e-3;
  const auto integrator = subject.make_integrator(coarse);
  if (!integrator->start(setup.start)) return false;
  const double end = setup.start.time + setup.duration;
  for (int step = 1; step <= most_steps && integrator->time() < end; ++step) {
    if (!integrator->step(end - integrator->time())) return false;
    const bool is_power_of_two = (step & (step - 1)) == 0;
    if (is_power_of_two && is_stiff(subject, integrator->state())) return true;
  }
  return is_stiff(subject, integrator->state());
}

/// The size of the first step; 0 if it fails.
double first_step(const RunSetup& setup, const RunOptions& options) {
  const auto integrator = setup.subject->make_integrator(options);
  if (!integrator->start(setup.start) || !integrator->step(setup.duration)) return 0;
  return integrator->time() - setup.start.time;
}

}  // namespace

double step_tolerance(double asked, double longer, double finest) {
  return std::max(finest, asked / (100 * std::pow(10, std::ceil(std::log10(std::max(1.0, longer))))));
}

MethodChoice choose_method(const RunSetup& setup) {
  const double asked = setup.accuracy.error > 0 ? setup.accuracy.error : setup.options.tolerance;
  const Subject& subject = *setup.subject;
  if (setup.options.method != Method::gauss || !is_adaptive(setup.options)) return {0, "other steps are asked for"};
  if (std::string reason = against_series(subject, asked); !reason.empty()) return {0, std::move(reason)};
  if (!(setup.duration > 0)) return {0, "no motion"};
  RunOptions options = setup.options;
  options.method = Method::taylor;
  options.tolerance = step_tolerance(asked, 1, smallest_tolerance);
  try {
    if (subject.damped() && becomes_stiff(setup)) return {0, "strong damping"};
    const double step = first_step(setup, options);
    if (step == 0) return {0, "a start from which series take no step"};
    const double steps = setup.duration / step;
    if (steps * smallest_tolerance > asked) return {0, "a long run, in which series lose energy"};
    options.tolerance = step_tolerance(asked, steps / short_run, smallest_tolerance);
  } catch (const std::invalid_argument& error) {
    return {0, error.what()};
  }
  return {options.tolerance, "few coordinates, and series take less time"};
}

}  // namespace pendula
