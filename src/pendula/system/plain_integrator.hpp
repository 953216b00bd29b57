#pragma once

#include <pendula/system/member.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/stop_sign.hpp>
#include <span>
#include <string_view>

namespace pendula {

/// `Integrator` without Eigen, as it crosses from the compiled library to a program (library.hpp). q and v are all the
/// coordinates and their rates.
class PlainIntegrator {
 public:
  struct Description {  // strings live as long as the integrator
    std::string_view solver, iteration, kernel;
  };

  PlainIntegrator() = default;
  PlainIntegrator(const PlainIntegrator&) = delete;
  PlainIntegrator& operator=(const PlainIntegrator&) = delete;
  virtual ~PlainIntegrator() = default;

  virtual Outcome start(double time, const double* q, const double* v) = 0;
  virtual Outcome step(double h) = 0;
  virtual double time() const = 0;
  virtual void read_state(double* q, double* v) const = 0;
  /// The values that sampled feedback holds at a time in the last step; empty without such feedback.
  virtual std::span<const double> held(double /*time*/) const { return {}; }

  /// Whether the limit `h` of the next step, or of an earlier one, may affect more than the last step of a run. If so,
  /// a longer run has other states on the way.
  virtual bool depends_on_end(double /*h*/) const { return false; }

  /// Whether to remember steps from now on, so that at and at_full_order can go back into the last one; this costs a
  /// copy of the state per step.
  virtual void remember_steps(bool wanted) = 0;
  /// The state at `time` within the last step by dense output, polynomials through what the step has computed: cheap,
  /// but less accurate.
  virtual void at(double time, double* q, double* v) = 0;
  /// Sets q and v to bounds of how far each coordinate and rate gets from its value at the start of the last step.
  /// Cheaper than dense output. False if they are not known. See StepView::bound_excursions.
  virtual bool bound_excursions(double* /*q*/, double* /*v*/) const { return false; }
  /// The state at `time` within the last step at the full order of the method: takes a step from where the last one
  /// began. The integrator is left unchanged. `work` is set to the work of loads until then  [J].
  virtual Outcome at_full_order(double time, double* q, double* v, double& work) = 0;

  /// Lets long steps, and those of at_full_order, end with Status::interrupted when `stop` says so; the integrator
  /// cannot be continued from there. Methods and systems with short steps may ignore it.
  virtual void set_stop_sign(StopSign /*stop*/) {}

  virtual const Statistics& statistics() const = 0;
  virtual Description describe() const = 0;

  /// Visits all that the next steps depend on, of an integrator that is started or is to be restored from a member.
  virtual void member(MemberNumbers& numbers) = 0;

  /// From now on every step keeps its derivative. Returns the number of rows of a tangent, zero if the method has no
  /// derivative. Tangents are in the integrator's own coordinates: for a chain those of chain_tangent.hpp, for a
  /// generated kernel (δq, δp).
  virtual int linearize() { return 0; }

  /// How many coordinates and rates of the state follow from others by constraints.
  virtual int conditions() const { return 0; }

  /// The largest z for which a step multiplies a tangent that decays as e^(−z) correctly to `error` in z. For methods
  /// with a derivative.
  virtual double resolved_decay(double /*error*/) const { return 0; }

  /// Number of rows of a variation of the parameters; valid after linearize().
  virtual int parameters() { return 0; }

  /// Replaces tangents at the start of the last step, (rows x count) row by row, by those at its end; valid after
  /// linearize(). `parameters`, (parameters x count), are variations of the parameters; may be null.
  virtual void push(double* /*tangents*/, int /*count*/, const double* /*parameters*/) {}

  /// The transpose of push: replaces gradients with respect to the end of the last step by those with respect to its
  /// start, and adds those with respect to the parameters to (parameters x count), unless that is null.
  virtual void pull(double* /*gradients*/, int /*count*/, double* /*parameters*/) {}
};

}  // namespace pendula
