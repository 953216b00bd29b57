#include "library/chain_integrator.hpp"

#include <array>
#include <pendula/gauss/tableau.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {
namespace {

template <class Space>
using Make = std::unique_ptr<PlainIntegrator> (*)(const Chain<Space>&, const RunOptions&);

// Functions by number of stages, from one on.
template <class Space, int... stages_less_one>
constexpr auto make_all_stages(std::integer_sequence<int, stages_less_one...>) {
  return std::array<Make<Space>, sizeof...(stages_less_one)>{&make_chain_stages<Space, stages_less_one + 1>...};
}

}  // namespace

template <class Space>
std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Space>& chain, const RunOptions& options) {
  require_stages(options.stages);
  if (options.form == Form::velocity) {
    throw std::invalid_argument(
        "form: the chain solver has the momentum form only, got velocity; solver = dense has it");
  }
  static constexpr auto make = make_all_stages<Space>(std::make_integer_sequence<int, max_stages>());
  return make[static_cast<std::size_t>(options.stages - 1)](chain, options);
}

template std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_chain_integrator(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula
