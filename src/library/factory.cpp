#include "library/factory.hpp"

#include <pendula/chain/chain_numbers.hpp>
#include <pendula/gauss/tableau.hpp>
#include <pendula/run/integrator.hpp>
#include <stdexcept>
#include <string>

#include "library/chain_integrator.hpp"
#include "library/explicit_methods.hpp"
#include "library/solver_choice.hpp"

namespace pendula {
namespace {

template <class Space>
std::string no_kernel_message(int links) {
  const std::string wanted = std::string(Space::name) + ":" + std::to_string(links);
  std::string built;
  for (const SystemTable* kernel : library<KernelList<Space>>().tables) {
    built += (built.empty() ? "" : ", ") + std::string(kernel->info.name);
  }
  return "no kernel for a " + std::string(Space::name) + " chain of " + std::to_string(links) +
         (links == 1 ? " link" : " links") + " in this build (it has " + (built.empty() ? "none" : built) +
         "); configure with -DPENDULA_KERNELS=\"" + wanted + "\" to have one";
}

template <class Space>
const SystemTable& require_kernel(int links) {
  if (const SystemTable* kernel = kernel_of<Space>(links)) return *kernel;
  throw NoKernel(no_kernel_message<Space>(links));
}

template <class Space>
std::unique_ptr<PlainIntegrator> make_over(const SystemTable& kernel, const PlainChain& chain,
                                           const RunOptions& options) {
  const ChainSystem numbers(chain, Space::torque_components);
  return make_system_integrator(kernel, numbers.plain(), options, chain.links);
}

template <class Space>
std::unique_ptr<PlainIntegrator> make_explicit(const PlainChain& plain, const RunOptions& options) {
  const Chain<Space> chain = chain_of<Space>(plain);
  if (options.method == Method::taylor) {
    const SystemTable* const kernel = series_kernel<Space>(plain.links, chain.loaded(), false);
    if (kernel != nullptr) return make_over<Space>(*kernel, plain, options);
  }
  return make_explicit_chain(chain, options);
}

// The end of a chain is held by Gauss steps in rods alone.
void require_gauss(const RunOptions& options) {
  const auto refuse = [](const char* key, std::string_view expected, std::string_view got) {
    throw std::invalid_argument(std::string(key) + ": expected " + std::string(expected) +
                                " for a chain whose end is held, got " + std::string(got));
  };
  if (options.method != Method::gauss) refuse("method", "gauss or auto", name_of(options.method));
  if (options.form != Form::momentum) refuse("form", "momentum", name_of(options.form));
  if (options.solver == Solver::dense) refuse("solver", "chain or auto", name_of(options.solver));
  if (options.iteration == Iteration::newton) refuse("iteration", "fixed-point or auto", name_of(options.iteration));
}

}  // namespace

template <class Space>
std::unique_ptr<PlainIntegrator> make_plain_integrator(const PlainChain& chain, const RunOptions& options) {
  if (chain.end != nullptr) require_gauss(options);
  if (is_explicit(options.method)) return make_explicit<Space>(chain, options);
  require_stages(options.stages);
  if (chain.end != nullptr ||
      solver_for<Space>(chain.links, options, kernel_of<Space>(chain.links) != nullptr) == Solver::chain)
    return make_chain_integrator(chain_of<Space>(chain), options);
  return make_over<Space>(require_kernel<Space>(chain.links), chain, options);
}

template std::unique_ptr<PlainIntegrator> make_plain_integrator<Planar>(const PlainChain&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_plain_integrator<Spatial>(const PlainChain&, const RunOptions&);

}  // namespace pendula
