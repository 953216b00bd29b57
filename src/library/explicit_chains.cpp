#include <pendula/explicit/chain_accelerations.hpp>
#include <pendula/explicit/explicit_chain.hpp>
#include <pendula/explicit/explicit_steps.hpp>
#include <pendula/explicit/single_integrator.hpp>
#include <pendula/taylor/taylor_steps.hpp>
#include <stdexcept>
#include <string>

#include "library/explicit_methods.hpp"

namespace pendula {
namespace {

template <class Space>
struct Make {
  const Chain<Space>& chain;
  const RunOptions& options;

  template <class Method>
  std::unique_ptr<PlainIntegrator> of() const {
    using Steps = ExplicitSteps<ChainAccelerations<Space, Eigen::Dynamic, double>, Method>;
    return std::make_unique<SingleIntegrator<Steps, ExplicitChain<Space>>>(ExplicitChain<Space>(chain),
                                                                           options.tolerance);
  }
  std::unique_ptr<PlainIntegrator> by_series() const {
    if (chain.loaded()) {
      throw std::invalid_argument(
          "method: taylor takes damping, torques and drives where there is a planar kernel for the number of links, "
          "got " +
          std::string(Space::name) + ':' + std::to_string(chain.links()) + "; gauss takes them all");
    }
    using Steps = TaylorSteps<ChainAccelerations<Space, Eigen::Dynamic, double>>;
    return std::make_unique<SingleIntegrator<Steps, ExplicitChain<Space>>>(
        ExplicitChain<Space>(chain), options.tolerance, typename Steps::Options{options.tolerance});
  }
};

}  // namespace

template <class Space>
std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Space>& chain, const RunOptions& options) {
  return detail::make_explicit(options, Make<Space>{chain, options});
}

template std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula
