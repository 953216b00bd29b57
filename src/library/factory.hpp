#pragma once

#include <memory>
#include <pendula/options.hpp>
#include <pendula/plain_chain.hpp>
#include <pendula/plain_integrator.hpp>

namespace pendula {

/// What make_integrator, of integrator.hpp, finds in the library.
template <class Space>
std::unique_ptr<PlainIntegrator> make_plain_integrator(const PlainChain& chain, const RunOptions& options);

}  // namespace pendula
