#include "library/factory.hpp"

#include <pendula/gauss/gauss_integrator.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/velocity_form.hpp>
#include <pendula/system/no_constraints.hpp>
#include <string>

#include "library/explicit_methods.hpp"

namespace pendula {
namespace {

/// An implicit method, with the narrowest pack that holds its stages.
template <class Equations>
std::unique_ptr<PlainIntegrator> make_gauss(const SystemModel& model, const RunOptions& options,
                                            const GaussDescription& described) {
  require_stages(options.stages);
  const auto make = [&]<int width>() -> std::unique_ptr<PlainIntegrator> {
    return std::make_unique<GaussIntegrator<LagrangianSolver<width, Equations>>>(
        model, options, described, options.iteration, family_of(options.method));
  };
  if (options.stages <= 2) return make.template operator()<2>();
  return options.stages <= 4 ? make.template operator()<4>() : make.template operator()<8>();
}

}  // namespace

std::unique_ptr<PlainIntegrator> make_system_integrator(const SystemTable& table, const PlainSystem& plain,
                                                        const RunOptions& options, int parts) {
  if (is_explicit(options.method)) {
    require_no_constraints(table.info, "method: expected gauss, got " + std::string(name_of(options.method)));
    return make_explicit_system(table, plain, options);
  }
  const SystemModel model(table, plain);
  const auto coordinates = static_cast<int>(model.coordinates());
  if (parts == 0) parts = coordinates;
  const GaussDescription described{"dense", table.info.name, parts};
  if (options.form == Form::momentum) return make_gauss<MomentumForm>(model, options, described);
  require_newton(options.iteration);
  return make_gauss<VelocityForm>(model, options, described);
}

}  // namespace pendula
