#pragma once

#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/explicit/dense_forward_dynamics.hpp>
#include <pendula/explicit/explicit_integrator.hpp>
#include <pendula/gauss/dense_newton.hpp>
#include <pendula/gauss/gauss_integrator.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>

namespace pendula {

/// Every method over one generated kernel; the number of stages stays a run-time number, so that a build does not hold
/// stages × forms × kernels specialisations. Throws std::invalid_argument for stages without a tableau.
template <class Kernel>
std::unique_ptr<PlainIntegrator> make_dense_integrator(const Chain<SpaceOf<Kernel>>& chain, const RunOptions& options) {
  if (is_explicit(options.method)) {
    return make_explicit_integrator(std::make_unique<DenseForwardDynamics<Kernel>>(chain), chain.links(),
                                    SpaceOf<Kernel>::dof, options, Kernel::name);
  }
  const Family family = family_of(options.method);
  if (options.form == Form::velocity) {
    return std::make_unique<GaussIntegrator<DenseVelocityNewton<Kernel>>>(chain, options.stages, "dense", Kernel::name,
                                                                          family);
  }
  return std::make_unique<GaussIntegrator<DenseMomentumNewton<Kernel>>>(chain, options.stages, "dense", Kernel::name,
                                                                        family);
}

}  // namespace pendula
