#pragma once

namespace bench {

/// The leading Lyapunov exponent of the double pendulum whose exponent is published, over 100 s.
void register_lyapunov();

}  // namespace bench
