// The library of the laboratory: Gauss steps of 4 and 8 stages, for chains and for interpreted models. It has no lanes,
// no explicit methods, no generated kernels: what is not asked for there does not go into its page.
#include <array>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/space.hpp>
#include <pendula/gauss/gauss_integrator.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/no_kernel.hpp>
#include <string>

#include "library/chain_stages.hpp"
#include "library/interpreter.hpp"
#include "library/orthonormal.hpp"

namespace pendula {

extern template std::unique_ptr<PlainIntegrator> make_chain_stages<Planar, 4>(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_chain_stages<Planar, 8>(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_chain_stages<Spatial, 4>(const Chain<Spatial>&,
                                                                               const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_chain_stages<Spatial, 8>(const Chain<Spatial>&,
                                                                               const RunOptions&);

namespace {

void require_offered(const RunOptions& options) {
  const bool offered =
      options.method == Method::gauss && options.form == Form::momentum && (options.stages == 4 || options.stages == 8);
  if (offered) return;
  throw NoKernel("method: the laboratory has gauss with 4 or 8 stages in momentum form, got " +
                 std::string(name_of(options.method)) + " with " + std::to_string(options.stages));
}

template <class Space>
std::unique_ptr<PlainIntegrator> make_plain_integrator(const PlainChain& plain, const RunOptions& options) {
  require_offered(options);
  const Chain<Space> chain = chain_of<Space>(plain);
  return options.stages == 4 ? make_chain_stages<Space, 4>(chain, options)
                             : make_chain_stages<Space, 8>(chain, options);
}

std::unique_ptr<PlainIntegrator> make_system_integrator(const SystemTable& table, const PlainSystem& plain,
                                                        const RunOptions& options, int parts) {
  require_offered(options);
  const SystemModel model(table, plain);
  const int named = parts == 0 ? static_cast<int>(model.coordinates()) : parts;
  return std::make_unique<GaussIntegrator<LagrangianSolver<8>>>(
      model, options, GaussDescription{"dense", table.info.name, named}, options.iteration, family_of(options.method));
}

}  // namespace

template <>
ChainMaker<Planar> library() {
  return {&make_plain_integrator<Planar>};
}
template <>
ChainMaker<Spatial> library() {
  return {&make_plain_integrator<Spatial>};
}
template <>
SystemMaker library() {
  return {&make_system_integrator};
}
template <>
KernelList<Planar> library() {
  return {};
}
template <>
KernelList<Spatial> library() {
  return {};
}
template <>
Orthonormalizer library() {
  return {&make_orthonormal};
}
template <>
const ProgramInterpreter* library() {
  return &interpreter;
}

std::string_view instruction_set() {
  return "wasm";
}

std::string_view needed_instruction_set() {
  return "";
}

}  // namespace pendula
