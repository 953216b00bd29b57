#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/written_out.hpp>
#include <type_traits>

namespace pendula {

/// The numbers of rods in memory: component after component, link after link. Loops take a block of links at a time; in
/// one motion a block fills whole registers. Zeros follow the last link.
template <class Space, int N, class Num>
class RodBlocks {
 public:
  static constexpr std::size_t D = Space::dimension;
  static constexpr int block = is_batch<Num> ? 1 : D == 2 ? 4 : 8;  ///< links
  static constexpr std::size_t block_size = static_cast<std::size_t>(block) * D;

  /// One T for each component of each link, and zeros behind the last link to the end of a block and for one more link.
  template <class T>
  class Numbers {
    static constexpr int held(int links) { return (links + block - 1) / block * block + block; }

   public:
    explicit Numbers(int links) : numbers_(held(links)) {
      std::fill_n(numbers_.data(), static_cast<std::size_t>(held(links)) * D, T(0.0));
    }
    T* operator[](int link) { return numbers_[link]; }
    const T* operator[](int link) const { return numbers_[link]; }

   private:
    detail::LinkArray<D, N == Eigen::Dynamic ? N : held(N), T> numbers_;
  };

  int links() const {
    if constexpr (N == Eigen::Dynamic) return links_;
    return N;
  }

  /// Calls body(k) for all numbers of a block; the loop is unrolled for several members.
  template <class Body>
  [[gnu::always_inline]] static void for_numbers(Body body) {
    if constexpr (is_batch<Num>) {
      detail::unrolled<static_cast<int>(block_size)>(
          [&](auto k) PENDULA_WRITTEN_OUT { body(std::integral_constant<std::size_t, k>()); });
    } else {
      for (std::size_t k = 0; k < block_size; ++k) body(k);
    }
  }

  /// Calls body(first link) for all blocks of links.
  template <class Body>
  [[gnu::always_inline]] void for_blocks(Body body) const {
    if constexpr (block == 1) {
      detail::for_links<N>(links(), body);
    } else {
      for (int begin = 0; begin < links(); begin += block) body(begin);
    }
  }

 protected:
  explicit RodBlocks(int links) : links_(links) {}

 private:
  int links_;
};

}  // namespace pendula
