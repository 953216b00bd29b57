#pragma once

#include <memory>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>

namespace pendula {

/// What make_integrator of integrator.hpp calls in the library.
template <class Space>
std::unique_ptr<PlainIntegrator> make_plain_integrator(const PlainChain& chain, const RunOptions& options);

}  // namespace pendula
