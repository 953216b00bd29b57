#pragma once

#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>

namespace pendula {

/// Taylor series steps for rods, for any number of links; passes poles. Throws std::invalid_argument for chains with
/// damping, torques or drives, and for a tolerance ≤ 0.
template <class Space>
std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Space>& chain, const RunOptions& options);

extern template std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula
