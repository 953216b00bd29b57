#pragma once

#include <concepts>
#include <cstddef>
#include <new>
#include <pendula/numeric/lanes.hpp>
#include <vector>

namespace pendula {

namespace detail {

/// Allocates memory aligned for loads and stores of packs.
template <class Number>
struct PackAllocator {
  using value_type = Number;

  PackAllocator() = default;
  template <class Other>
  PackAllocator(const PackAllocator<Other>& /*other*/) {}  // NOLINT(google-explicit-constructor)

  Number* allocate(std::size_t count) {
    return static_cast<Number*>(::operator new (count * sizeof(Number), std::align_val_t{pack_alignment}));
  }
  void deallocate(Number* numbers, std::size_t /*count*/) {
    ::operator delete (numbers, std::align_val_t{pack_alignment});
  }
  friend bool operator==(const PackAllocator&, const PackAllocator&) { return true; }
};

}  // namespace detail

/// Rows of `Width` numbers each, contiguous and aligned so that each row loads as a pack; initially zero.
template <std::size_t Width>
class PackRows {
 public:
  explicit PackRows(std::size_t rows = 0) : numbers_(rows * Width) {}

  std::size_t rows() const { return numbers_.size() / Width; }
  double* operator[](std::integral auto k) { return numbers_.data() + static_cast<std::size_t>(k) * Width; }
  const double* operator[](std::integral auto k) const { return numbers_.data() + static_cast<std::size_t>(k) * Width; }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers.range(numbers_.data(), numbers_.size());
  }

 private:
  std::vector<double, detail::PackAllocator<double>> numbers_;
};

}  // namespace pendula
