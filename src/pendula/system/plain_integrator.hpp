#pragma once

#include <pendula/system/member.hpp>
#include <pendula/system/outcome.hpp>
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
  virtual const Statistics& statistics() const = 0;
  virtual Description describe() const = 0;

  /// All that the next steps depend on, of an integrator that was started or is being given another one's member.
  virtual void member(MemberNumbers& numbers) = 0;
};

}  // namespace pendula
