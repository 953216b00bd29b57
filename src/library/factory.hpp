#pragma once

#include <memory>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// What make_integrator of integrator.hpp calls in the library.
template <class Space>
std::unique_ptr<PlainIntegrator> make_plain_integrator(const PlainChain& chain, const RunOptions& options);

/// Every method for a generated kernel. `parts` is the number of parts that failures name: the links of a chain, or 0
/// for the coordinates. Throws std::invalid_argument for stages without a tableau, and for options that make no sense.
std::unique_ptr<PlainIntegrator> make_system_integrator(const SystemTable& table, const PlainSystem& plain,
                                                        const RunOptions& options, int parts);

}  // namespace pendula
