// The chain integrators in the plane with 7 to 8 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 7>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 8>(const Chain<Planar>&, const RunOptions&);

}  // namespace pendula::detail
