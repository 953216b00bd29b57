// The chain integrators in space with 1 to 4 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 1>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 2>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 3>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 4>(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula::detail
