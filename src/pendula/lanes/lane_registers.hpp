#pragma once

#include <cstddef>
#include <memory>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/numeric/lanes.hpp>
#include <vector>

namespace pendula {

/// Numbers of all lanes side by side, as they cross to LaneDynamics: so many registers, one after the other, aligned.
template <class L>
class LaneRegisters {
 public:
  explicit LaneRegisters(int count) : numbers_(static_cast<std::size_t>(count) * L::width + alignment) {
    void* first = numbers_.data();
    std::size_t room = numbers_.size() * sizeof(double);
    first_ = static_cast<double*>(std::align(pack_alignment, sizeof(double), first, room));
  }
  LaneRegisters(const LaneRegisters&) = delete;
  LaneRegisters& operator=(const LaneRegisters&) = delete;

  double* operator[](int k) { return first_ + static_cast<std::ptrdiff_t>(k) * L::size; }
  const double* operator[](int k) const { return first_ + static_cast<std::ptrdiff_t>(k) * L::size; }
  L load(int k) const { return L::load((*this)[k]); }

 private:
  static constexpr std::size_t alignment = pack_alignment / sizeof(double);

  std::vector<double> numbers_;
  double* first_ = nullptr;
};

}  // namespace pendula
