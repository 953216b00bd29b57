#pragma once

namespace pendula {

/// The longest floating-point type of a processor, for sums and for conversions between angles and rods.
///
/// WebAssembly has only double. Its long double is made of function calls, whose results were wrong with Clang 14,
/// without a word.
#ifdef __wasm__
using LongReal = double;
#else
using LongReal = long double;
#endif

}  // namespace pendula
