#include "library/chain_stages.hpp"

namespace pendula {

template std::unique_ptr<PlainIntegrator> make_chain_stages<Planar, 4>(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_chain_stages<Planar, 8>(const Chain<Planar>&, const RunOptions&);

}  // namespace pendula
