#include <pendula/chain_integrator.hpp>
#include <pendula/explicit_integrator.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/integrator.hpp>
#include <string>

namespace pendula {
namespace {

template <class Space>
std::string no_kernel_message(int links) {
  const std::string wanted = std::string(Space::name) + ":" + std::to_string(links);
  std::string built;
  for (const KernelEntry<Space>& entry : kernel_registry<Space>()) {
    built += (built.empty() ? "" : ", ") + std::string(entry.info.name);
  }
  return "no kernel for a " + std::string(Space::name) + " chain of " + std::to_string(links) +
         (links == 1 ? " link" : " links") + " in this build (it has " + (built.empty() ? "none" : built) +
         "); configure with -DPENDULA_KERNELS=\"" + wanted + "\" to have one";
}

template <class Space>
const KernelEntry<Space>* find_kernel(int links) {
  for (const KernelEntry<Space>& entry : kernel_registry<Space>()) {
    if (entry.info.links == links) return &entry;
  }
  return nullptr;
}

template <class Space>
const KernelEntry<Space>& require_kernel(int links) {
  if (const KernelEntry<Space>* kernel = find_kernel<Space>(links)) return *kernel;
  throw NoKernel(no_kernel_message<Space>(links));
}

template <class Space>
std::unique_ptr<Integrator<Space>> make_explicit(const Chain<Space>& chain, const RunOptions& options) {
  if (const KernelEntry<Space>* kernel = find_kernel<Space>(chain.links())) return kernel->make(chain, options);
  return make_explicit_integrator<Space>(make_chain_forward_dynamics(chain), options, "");
}

// In momentum form the chain solver is the faster one, on one spatial link with one stage as fast as the dense one,
// which cannot pass a pole (table "few links" in docs/benchmarks.md). The velocity form is the dense solver's alone,
// and only that needs a kernel.
Solver solver_for(const RunOptions& options) {
  if (options.solver != Solver::automatic) return options.solver;
  return options.form == Form::velocity ? Solver::dense : Solver::chain;
}

void require_newton(Iteration iteration) {
  if (iteration != Iteration::fixed_point) return;
  throw std::invalid_argument("iteration: the dense solver has newton only, got fixed-point");
}

}  // namespace

template <class Space>
std::unique_ptr<Integrator<Space>> make_integrator(const Chain<Space>& chain, const RunOptions& options) {
  if (options.method != Method::gauss) return make_explicit(chain, options);
  require_stages(options.stages);
  if (solver_for(options) == Solver::chain) return make_chain_integrator(chain, options);
  require_newton(options.iteration);
  return require_kernel<Space>(chain.links()).make(chain, options);
}

template std::unique_ptr<Integrator<Planar>> make_integrator(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_integrator(const Chain<Spatial>&, const RunOptions&);

std::vector<KernelInfo> built_in_kernels() {
  std::vector<KernelInfo> kernels;
  for (const auto& entry : kernel_registry<Planar>()) kernels.push_back(entry.info);
  for (const auto& entry : kernel_registry<Spatial>()) kernels.push_back(entry.info);
  return kernels;
}

}  // namespace pendula
