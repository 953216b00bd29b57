#include <array>
#include <pendula/chain_integrator.hpp>
#include <pendula/gauss/chain_forward_dynamics.hpp>
#include <pendula/gauss/tableau.hpp>
#include <stdexcept>

namespace pendula {
namespace detail {

#define PENDULA_CHAIN_STAGES(Space, S)                                                                \
  extern template std::unique_ptr<Integrator<Space>> make_chain_stages<Space, S>(const Chain<Space>&, \
                                                                                 const RunOptions&);
#define PENDULA_CHAIN_ALL_STAGES(Space) \
  PENDULA_CHAIN_STAGES(Space, 1)        \
  PENDULA_CHAIN_STAGES(Space, 2)        \
  PENDULA_CHAIN_STAGES(Space, 3)        \
  PENDULA_CHAIN_STAGES(Space, 4)        \
  PENDULA_CHAIN_STAGES(Space, 5)        \
  PENDULA_CHAIN_STAGES(Space, 6)        \
  PENDULA_CHAIN_STAGES(Space, 7)        \
  PENDULA_CHAIN_STAGES(Space, 8)

PENDULA_CHAIN_ALL_STAGES(Planar)
PENDULA_CHAIN_ALL_STAGES(Spatial)

#undef PENDULA_CHAIN_ALL_STAGES
#undef PENDULA_CHAIN_STAGES

}  // namespace detail

template <class Space>
std::unique_ptr<Integrator<Space>> make_chain_integrator(const Chain<Space>& chain, const RunOptions& options) {
  require_stages(options.stages);
  if (options.form == Form::velocity) {
    throw std::invalid_argument(
        "form: the chain solver has the momentum form only, got velocity; solver = dense has it");
  }
  using Make = std::unique_ptr<Integrator<Space>> (*)(const Chain<Space>&, const RunOptions&);
  static constexpr std::array<Make, max_stages> make = {
      &detail::make_chain_stages<Space, 1>, &detail::make_chain_stages<Space, 2>, &detail::make_chain_stages<Space, 3>,
      &detail::make_chain_stages<Space, 4>, &detail::make_chain_stages<Space, 5>, &detail::make_chain_stages<Space, 6>,
      &detail::make_chain_stages<Space, 7>, &detail::make_chain_stages<Space, 8>};
  return make[static_cast<std::size_t>(options.stages - 1)](chain, options);
}

template <class Space>
std::unique_ptr<ForwardDynamics<Space>> make_chain_forward_dynamics(const Chain<Space>& chain) {
  return std::make_unique<ChainForwardDynamics<Space>>(chain);
}

template std::unique_ptr<Integrator<Planar>> make_chain_integrator(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_integrator(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<ForwardDynamics<Planar>> make_chain_forward_dynamics(const Chain<Planar>&);
template std::unique_ptr<ForwardDynamics<Spatial>> make_chain_forward_dynamics(const Chain<Spatial>&);

}  // namespace pendula
