#pragma once

#include <memory>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/system_table.hpp>

namespace pendula {

/// Every method over a generated kernel. `parts` is what failures name: the number of links of a chain, else 0 for the
/// coordinates themselves. Throws std::invalid_argument for stages without a tableau, and for options that make no
/// sense.
std::unique_ptr<PlainIntegrator> make_system_integrator(const SystemTable& table, const PlainSystem& plain,
                                                        const RunOptions& options, int parts);

}  // namespace pendula
