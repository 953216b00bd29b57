#pragma once

#include <pendula/system/member.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/stop_sign.hpp>
#include <string_view>

namespace pendula {

/// An integrator as it crosses from the compiled library to a program (library.hpp): `Integrator` without Eigen. q and
/// v are all the angles and their rates.
class PlainIntegrator {
 public:
  struct Description {  // lives as long as the integrator
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

  /// Whether steps are remembered from now on, so that glance and look can go back into the last one; it costs a copy
  /// of the state a step.
  virtual void remember_steps(bool wanted) = 0;
  /// The state at `time` within the last step, by polynomials through what the step knows: cheap, and of less digits.
  virtual void glance(double time, double* q, double* v) = 0;
  /// The same at the full order of the method: by a step from where the last one began. Leaves the integrator as it is.
  /// `work` is what loads have brought by then  [J].
  virtual Outcome look(double time, double* q, double* v, double& work) = 0;

  /// Steps and looks that take long end by Status::interrupted where `stop` says so; what comes next does not follow
  /// from where that was. Methods and systems whose steps are short need not ask.
  virtual void heed(StopSign /*stop*/) {}

  virtual const Statistics& statistics() const = 0;
  virtual Description describe() const = 0;

  /// All that the next steps depend on, of an integrator that was started or is being given another one's member.
  virtual void member(MemberNumbers& numbers) = 0;

  /// From now on every step leaves its derivative behind; gives how many rows a tangent has, zero where the method has
  /// no derivative. Coordinates are the integrator's own: of a chain those of chain_tangent.hpp, of a generated kernel
  /// (δq, δp).
  virtual int linearize() { return 0; }

  /// The largest z for which a step makes e^(−z) of a tangent that decays, but for `error` of z; of methods that have a
  /// derivative.
  virtual double resolved_decay(double /*error*/) const { return 0; }

  /// Rows of a variation of the parameters, once `linearize` has asked for derivatives.
  virtual int parameters() { return 0; }

  /// Replaces tangents at the start of the last step, (rows x count) row by row, by those at its end, once `linearize`
  /// has asked for that; where parameters vary, too, by (parameters x count), if that is not null.
  virtual void push(double* /*tangents*/, int /*count*/, const double* /*parameters*/) {}

  /// The transpose: replaces gradients with respect to the end of the last step by those with respect to its start, and
  /// adds those with respect to the parameters to (parameters x count), if that is not null.
  virtual void pull(double* /*gradients*/, int /*count*/, double* /*parameters*/) {}
};

}  // namespace pendula
