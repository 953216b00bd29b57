#pragma once

#include <cmath>

namespace pendula::detail {

/// Whether std::fma is one instruction. Clang does not define the standard's FP_FAST_FMA, so __FMA__ is asked, too.
template <class Real>
inline constexpr bool has_fast_fma = false;
#if defined(FP_FAST_FMA) || defined(__FMA__) || defined(__aarch64__)
template <>
inline constexpr bool has_fast_fma<double> = true;
#endif
#if defined(FP_FAST_FMAF) || defined(__FMA__) || defined(__aarch64__)
template <>
inline constexpr bool has_fast_fma<float> = true;
#endif

}  // namespace pendula::detail
