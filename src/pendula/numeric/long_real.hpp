#pragma once

namespace pendula {

/// The longest number that a processor has, for sums and angles on their way to and from rods.
///
/// WebAssembly has none but double: there long double is made of function calls, and with Clang 14 results of theirs
/// were wrong without a word.
#ifdef __wasm__
using LongReal = double;
#else
using LongReal = long double;
#endif

}  // namespace pendula
