// The chain integrators in the plane with 1 to 4 stages.

#include <pendula/chain_stages_instance.hpp>

namespace pendula::detail {

template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 1>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 2>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 3>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<Integrator<Planar>> make_chain_stages<Planar, 4>(const Chain<Planar>&, const RunOptions&);

}  // namespace pendula::detail
