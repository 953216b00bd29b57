#pragma once

#include <utility>

/// Written behind the parameters of a lambda: forces its inlining.
#define PENDULA_WRITTEN_OUT __attribute__((always_inline))

namespace pendula::detail {

/// body(0), body(1), … unrolled, with the index as a compile-time constant.
template <int Count, class Body>
[[gnu::always_inline]] inline void unrolled(Body body) {
  [&]<int... k>(std::integer_sequence<int, k...>) PENDULA_WRITTEN_OUT {
    (body(std::integral_constant<int, k>()), ...);
  }
  (std::make_integer_sequence<int, Count>());
}

/// Whether loops along a chain of N links are unrolled.
template <int N>
inline constexpr bool is_short_chain = N > 0 && N <= 3;  // Eigen::Dynamic is negative

/// body(i) for all links i from the pivot outward; unrolled for short chains.
template <int N, class Body>
[[gnu::always_inline]] inline void for_links(int links, Body body) {
  if constexpr (is_short_chain<N>) {
    unrolled<N>(body);
  } else {
    for (int i = 0; i < links; ++i) body(i);
  }
}

/// body(i) for all links i from the tip inward; unrolled for short chains.
template <int N, class Body>
[[gnu::always_inline]] inline void for_links_inward(int links, Body body) {
  if constexpr (is_short_chain<N>) {
    unrolled<N>([&](auto i) PENDULA_WRITTEN_OUT { body(std::integral_constant<int, N - 1 - i>()); });
  } else {
    for (int i = links; i-- > 1;) body(i);
    body(std::integral_constant<int, 0>());
  }
}

}  // namespace pendula::detail
