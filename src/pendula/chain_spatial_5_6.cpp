// The chain integrators in space with 5 to 6 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 5>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 6>(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula::detail
