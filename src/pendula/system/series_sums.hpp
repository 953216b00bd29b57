#pragma once

#include <array>
#include <cstddef>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/written_out.hpp>
#include <pendula/system/series_info.hpp>
#include <span>
#include <utility>

namespace pendula::detail {

/// Computes sums of one motion, in lanes `at` to at + 8 groups. `operands` has rows of `lanes` first operands and as
/// many second ones. Terms are added from the middle of each sum outward to j = least, so that rows that were just
/// written come last.
template <std::size_t groups, std::size_t least>
[[gnu::always_inline]] inline void sums_in_groups(const double* operands, std::size_t lanes, std::size_t at,
                                                  std::size_t k, double* sums) {
  using Lanes = Pack<8, RegisterFor<8>>;
  std::array<Lanes, groups> even, odd;
  const auto each = [](auto visit) PENDULA_WRITTEN_OUT {
    [&]<std::size_t... g>(std::index_sequence<g...>) PENDULA_WRITTEN_OUT {
      (visit(std::integral_constant<std::size_t, g>()), ...);
    }
    (std::make_index_sequence<groups>());
  };
  const auto first = [&](std::size_t j, std::size_t g)
                         PENDULA_WRITTEN_OUT { return Lanes::load(operands + 2 * lanes * j + at + 8 * g); };
  const auto second = [&](std::size_t j, std::size_t g)
                          PENDULA_WRITTEN_OUT { return Lanes::load(operands + (2 * j + 1) * lanes + at + 8 * g); };
  each([&](auto g) PENDULA_WRITTEN_OUT { even[g] = odd[g] = Lanes(0.0); });
  if (k % 2 == 0 && k / 2 >= least) {
    each([&](auto g) PENDULA_WRITTEN_OUT { even[g] = first(k / 2, g) * second(k / 2, g); });
  }
  for (std::size_t j = (k - 1) / 2; j >= least; --j) {
    each([&](auto g) PENDULA_WRITTEN_OUT {
      even[g] = fma(first(j, g), second(k - j, g), even[g]);
      odd[g] = fma(first(k - j, g), second(j, g), odd[g]);
    });
  }
  each([&](auto g) PENDULA_WRITTEN_OUT { (even[g] + odd[g]).store(sums + at + 8 * g); });
}

/// Computes all sums of one motion.
template <std::size_t least = 1>
[[gnu::always_inline]] inline void sums_in_lanes(const double* operands, std::size_t lanes, std::size_t k,
                                                 double* sums) {
  std::size_t at = 0;
  for (; at + 16 <= lanes; at += 16) sums_in_groups<2, least>(operands, lanes, at, k, sums);
  if (at < lanes) sums_in_groups<1, least>(operands, lanes, at, k, sums);
}

/// The sums of W motions: `operands` has rows of W numbers of each operand.
template <int W>
void sums_of_many(const double* operands, std::span<const SeriesSum> pairs, std::size_t row, std::size_t k,
                  double* sums) {
  using Lanes = Pack<W, RegisterFor<W>>;
  const auto at = [&](std::size_t j, std::size_t operand) {
    return Lanes::load(operands + row * j + operand * static_cast<std::size_t>(W));
  };
  for (const auto& [first, second] : pairs) {
    Lanes even(0.0), odd(0.0);
    for (std::size_t j = (k - 1) / 2; j > 0; --j) {
      even = fma(at(j, first), at(k - j, second), even);
      if (first != second) odd = fma(at(k - j, first), at(j, second), odd);
    }
    even = first == second ? even + even : even + odd;
    if (k % 2 == 0) even = fma(at(k / 2, first), at(k / 2, second), even);
    even.store(sums);
    sums += W;
  }
}

/// The sums of eight motions, and their derivatives where `d_operands` has those of the operands.
inline void sums_along(const double* operands, const double* d_operands, std::span<const SeriesSum> pairs,
                       std::size_t row, std::size_t k, double* sums, double* d_sums) {
  constexpr std::size_t width = 8;
  using Lanes = Pack<width, RegisterFor<width>>;
  const auto at = [&](const double* from, std::size_t j, std::size_t operand) {
    return Lanes::load(from + row * j + operand * width);
  };
  for (const auto& [first, second] : pairs) {
    Lanes sum(0.0), by_first(0.0), by_second(0.0);
    for (std::size_t j = 1; j < k; ++j) {
      const Lanes a = at(operands, j, first), b = at(operands, k - j, second);
      sum = fma(a, b, sum);
      by_first = fma(at(d_operands, j, first), b, by_first);
      by_second = fma(a, at(d_operands, k - j, second), by_second);
    }
    sum.store(sums);
    (by_first + by_second).store(d_sums);
    sums += width;
    d_sums += width;
  }
}

/// The same with `pairs` known to the compiler: sums that share operands load these once.
template <int W, const auto& pairs>
[[gnu::always_inline]] inline void known_sums_of_many(const double* operands, std::size_t row, std::size_t k,
                                                      Pack<W, RegisterFor<W>>* sums) {
  using Lanes = Pack<W, RegisterFor<W>>;
  constexpr std::size_t count = pairs.size(), together = 10, groups = (count + together - 1) / together;
  const auto some = [&]<std::size_t from, std::size_t... i>(std::index_sequence<i...>) PENDULA_WRITTEN_OUT {
    const auto at = [&](std::size_t j, std::size_t operand) PENDULA_WRITTEN_OUT {
      return Lanes::load(operands + row * j + operand * static_cast<std::size_t>(W));
    };
    std::array<Lanes, sizeof...(i)> found{(static_cast<void>(i), Lanes(0.0))...};
    const auto add = [&]<std::size_t m>(std::size_t j, std::size_t l) PENDULA_WRITTEN_OUT {
      constexpr std::size_t first = pairs[from + m][0], second = pairs[from + m][1];
      found[m] = fma(at(j, first), at(l, second), found[m]);
    };
    const auto twice = [&]<std::size_t m>(std::size_t j, std::size_t l) PENDULA_WRITTEN_OUT {
      add.template operator()<m>(j, l);
      if constexpr (pairs[from + m][0] != pairs[from + m][1]) add.template operator()<m>(l, j);
    };
    for (std::size_t j = (k - 1) / 2; j > 0; --j) (twice.template operator()<i>(j, k - j), ...);
    const auto end = [&]<std::size_t m>() PENDULA_WRITTEN_OUT {
      if constexpr (pairs[from + m][0] == pairs[from + m][1]) found[m] = found[m] + found[m];
      if (k % 2 == 0) add.template operator()<m>(k / 2, k / 2);
      sums[from + m] = found[m];
    };
    (end.template operator()<i>(), ...);
  };
  [&]<std::size_t... g>(std::index_sequence<g...>) PENDULA_WRITTEN_OUT {
    (some.template operator()<g * count / groups>(
         std::make_index_sequence<(g + 1) * count / groups - g * count / groups>()),
     ...);
  }
  (std::make_index_sequence<groups>());
}

}  // namespace pendula::detail
