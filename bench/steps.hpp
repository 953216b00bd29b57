#pragma once

namespace bench {

/// Step times on few links: every kernel of the build, 1, 2, 4 and 8 stages, both forms, and the chain solver on the
/// same.
void register_few_links();

/// Cost of the chain solver a link and iteration, from n = 2 to 10⁵.
void register_chain_costs();

/// One step of 2-stage Gauss at h = 1e-3 against GSL's rk4imp, which is the same method.
void register_against_rk4imp();

}  // namespace bench
