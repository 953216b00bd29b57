// The chain integrators in the plane with 5 to 6 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 5>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 6>(const Chain<Planar>&, const RunOptions&);

}  // namespace pendula::detail
