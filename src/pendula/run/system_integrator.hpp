#pragma once

#include <memory>
#include <pendula/gauss/gauss_integrator.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/velocity_newton.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>

namespace pendula {

/// Every implicit method over one generated kernel; the number of stages stays a run-time number, so that a build does
/// not hold stages × forms × kernels specialisations. `parts` is what failures name: the number of links of a chain,
/// else 0 for the coordinates themselves. Throws std::invalid_argument for stages without a tableau, and for options
/// that make no sense.
template <System S>
std::unique_ptr<PlainIntegrator> make_system_integrator(const PlainSystem& plain, const RunOptions& options,
                                                        int parts = 0) {
  const SystemModel<S> model(plain);
  const GaussDescription described{"dense", S::name, parts == 0 ? S::coordinates : parts};
  require_stages(options.stages);
  const Family family = family_of(options.method);
  if (options.form == Form::velocity) {
    require_newton(options.iteration);
    return std::make_unique<GaussIntegrator<VelocityNewton<S>>>(model, options, described, family);
  }
  if (options.stages <= 4) {
    return std::make_unique<GaussIntegrator<LagrangianSolver<S, 4>>>(model, options, described, options.iteration,
                                                                     family);
  }
  return std::make_unique<GaussIntegrator<LagrangianSolver<S, 8>>>(model, options, described, options.iteration,
                                                                   family);
}

}  // namespace pendula
