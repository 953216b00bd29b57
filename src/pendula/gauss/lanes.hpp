#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <xsimd/xsimd.hpp>

namespace pendula {

namespace detail {

// The widest register of doubles that divides a pack of `Size` numbers; double itself where there is none.
template <int Size>
auto widest_register() {
  constexpr bool has_eight = !std::is_void_v<xsimd::make_sized_batch_t<double, 8>>;
  constexpr bool has_four = !std::is_void_v<xsimd::make_sized_batch_t<double, 4>>;
  constexpr bool has_two = !std::is_void_v<xsimd::make_sized_batch_t<double, 2>>;
  if constexpr (Size % 8 == 0 && has_eight) {
    return std::type_identity<xsimd::make_sized_batch_t<double, 8>>{};
  } else if constexpr (Size % 4 == 0 && has_four) {
    return std::type_identity<xsimd::make_sized_batch_t<double, 4>>{};
  } else if constexpr (Size % 2 == 0 && has_two) {
    return std::type_identity<xsimd::make_sized_batch_t<double, 2>>{};
  } else {
    return std::type_identity<double>{};
  }
}

template <class Register>
inline constexpr int register_size = static_cast<int>(Register::size);
template <>
inline constexpr int register_size<double> = 1;

inline void load(const double* from, double& to) {
  to = *from;
}
inline void store(double* to, double from) {
  *to = from;
}
template <class Arch>
void load(const double* from, xsimd::batch<double, Arch>& to) {
  to = xsimd::batch<double, Arch>::load_aligned(from);
}
template <class Arch>
void store(double* to, const xsimd::batch<double, Arch>& from) {
  from.store_aligned(to);
}

}  // namespace detail

/// The register that a pack of `Size` numbers is made of. It is a parameter of everything that is made of packs, so
/// that code compiled for different processors has different names and cannot be mixed by a linker.
template <int Size>
using RegisterFor = typename decltype(detail::widest_register<Size>())::type;

/// `Size` numbers in SIMD registers that the compiler's target decides on; arithmetic goes number by number.
/// Loads and stores need addresses aligned to `pack_alignment`.
template <int Size, class Register = RegisterFor<Size>>
class Pack {
  static constexpr int width = detail::register_size<Register>;
  static constexpr int registers = Size / width;
  static_assert(registers * width == Size);

 public:
  static constexpr int size = Size;

  Pack() = default;
  explicit Pack(double value) {
    for (Register& r : registers_) r = Register(value);
  }

  static Pack load(const double* from) {
    Pack pack;
    for (int i = 0; i < registers; ++i) detail::load(from + i * width, pack.registers_[i]);
    return pack;
  }
  void store(double* to) const {
    for (int i = 0; i < registers; ++i) detail::store(to + i * width, registers_[i]);
  }

  friend Pack operator+(const Pack& a, const Pack& b) {
    return each([&](int i) { return a.registers_[i] + b.registers_[i]; });
  }
  friend Pack operator-(const Pack& a, const Pack& b) {
    return each([&](int i) { return a.registers_[i] - b.registers_[i]; });
  }
  friend Pack operator*(const Pack& a, const Pack& b) {
    return each([&](int i) { return a.registers_[i] * b.registers_[i]; });
  }
  friend Pack operator/(const Pack& a, const Pack& b) {
    return each([&](int i) { return a.registers_[i] / b.registers_[i]; });
  }
  friend Pack operator-(const Pack& a) {
    return each([&](int i) { return -a.registers_[i]; });
  }

  /// a b + c, with one rounding where the processor has such an instruction.
  friend Pack fma(const Pack& a, const Pack& b, const Pack& c) {
    using std::fma, xsimd::fma;
    return each([&](int i) {
      if constexpr (std::is_same_v<Register, double>) {
        return a.registers_[i] * b.registers_[i] + c.registers_[i];
      } else {
        return fma(a.registers_[i], b.registers_[i], c.registers_[i]);
      }
    });
  }

  friend Pack abs(const Pack& a) {
    using std::abs, xsimd::abs;
    return each([&](int i) { return Register(abs(a.registers_[i])); });
  }
  friend Pack max(const Pack& a, const Pack& b) {
    using std::max, xsimd::max;
    return each([&](int i) { return Register(max(a.registers_[i], b.registers_[i])); });
  }
  /// a > b ? x : y.
  friend Pack select_greater(const Pack& a, const Pack& b, const Pack& x, const Pack& y) {
    return each([&](int i) {
      if constexpr (std::is_same_v<Register, double>) {
        return a.registers_[i] > b.registers_[i] ? x.registers_[i] : y.registers_[i];
      } else {
        return xsimd::select(a.registers_[i] > b.registers_[i], x.registers_[i], y.registers_[i]);
      }
    });
  }

 private:
  template <class Operation>
  static Pack each(Operation operation) {
    Pack pack;
    for (int i = 0; i < registers; ++i) pack.registers_[i] = operation(i);
    return pack;
  }

  Register registers_[static_cast<std::size_t>(registers)];
};

/// In bytes; enough for any register that xsimd knows.
inline constexpr std::size_t pack_alignment = 64;

/// Numbers in a pack that holds all `stages` of one quantity: the next power of two. The numbers after the last stage
/// are computed like the others and never looked at.
inline constexpr int lanes_for(int stages) {
  return stages <= 2 ? stages : stages <= 4 ? 4 : 8;
}

/// All stages of one quantity of one link.
template <int S>
using Lanes = Pack<lanes_for(S)>;

}  // namespace pendula
