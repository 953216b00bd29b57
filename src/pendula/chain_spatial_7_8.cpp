// The chain integrators in space with 7 to 8 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 7>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<Integrator<Spatial>> make_chain_stages<Spatial, 8>(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula::detail
