#include "library/chain_stages.hpp"

namespace pendula {

template std::unique_ptr<PlainIntegrator> make_chain_stages<Spatial, 4>(const Chain<Spatial>&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_chain_stages<Spatial, 8>(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula
