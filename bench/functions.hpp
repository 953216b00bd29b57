#pragma once

namespace bench {

/// Generated kernels function by function: residuals against CasADi's code for the same, after comparing what both
/// give, and the momentum form against its sines alone.
void register_functions();

}  // namespace bench
