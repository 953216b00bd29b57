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
const KernelEntry<Space>& find_kernel(int links) {
  for (const KernelEntry<Space>& entry : kernel_registry<Space>()) {
    if (entry.info.links == links) return entry;
  }
  throw NoKernel(no_kernel_message<Space>(links));
}

void validate(const RunOptions& options) {
  if (options.method != Method::gauss) return;
  require_stages(options.stages);
  if (options.solver == Solver::chain) throw std::invalid_argument("solver: this build has no chain solver");
  if (options.iteration == Iteration::fixed_point) {
    throw std::invalid_argument("iteration: the dense solver has newton only, got fixed-point");
  }
}

}  // namespace

template <class Space>
std::unique_ptr<Integrator<Space>> make_integrator(const Chain<Space>& chain, const RunOptions& options) {
  validate(options);
  return find_kernel<Space>(chain.links()).make(chain, options);
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
