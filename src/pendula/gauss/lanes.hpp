#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <xsimd/xsimd.hpp>

/// Before a function that carries packs through a loop: everything it calls is inlined, so that they stay in registers.
/// Not where a sanitizer would have all of that instrumented.
#if defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__)
#define PENDULA_IN_REGISTERS [[gnu::flatten]]
#else
#define PENDULA_IN_REGISTERS
#endif

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

// x y + z, rounded once where the processor can. The one place with intrinsics: xsimd's rounds twice in registers of
// two and, before version 11, of eight (its issue 884), and what a product loses to rounding could not be told.
inline double fused(double x, double y, double z) {
#ifdef FP_FAST_FMA
  return std::fma(x, y, z);
#else
  return x * y + z;
#endif
}
template <class Arch>
xsimd::batch<double, Arch> fused(const xsimd::batch<double, Arch>& x, const xsimd::batch<double, Arch>& y,
                                 const xsimd::batch<double, Arch>& z) {
#ifdef __FMA__
  if constexpr (xsimd::batch<double, Arch>::size == 2) return _mm_fmadd_pd(x, y, z);
#endif
#ifdef __AVX512F__
  if constexpr (xsimd::batch<double, Arch>::size == 8) return _mm512_fmadd_pd(x, y, z);
#endif
  return xsimd::fma(x, y, z);
}

}  // namespace detail

/// The register that a pack of `Size` numbers is made of. It is a parameter of everything that is made of packs, so
/// that code compiled for different processors has different names and cannot be mixed by a linker.
template <int Size>
using RegisterFor = typename decltype(detail::widest_register<Size>())::type;

/// `Size` numbers in SIMD registers that the compiler's target decides on; arithmetic goes number by number.
/// Loads and stores need addresses aligned to `pack_alignment`. More than one register is two packs, not an array:
/// compilers keep those in registers.
template <int Size, class Register = RegisterFor<Size>>
class Pack {
  static constexpr int width = detail::register_size<Register>;
  static constexpr bool split = Size > width;
  static_assert(Size % width == 0);
  static constexpr int low_size = (Size / width + 1) / 2 * width;
  using Low = Pack<split ? low_size : Size, Register>;
  using High = Pack<split ? Size - low_size : Size, Register>;
  struct Halves {
    Low low;
    High high;
  };

 public:
  static constexpr int size = Size;

  Pack() = default;
  explicit Pack(double value) {
    if constexpr (split) {
      held_ = {Low(value), High(value)};
    } else {
      held_ = Register(value);
    }
  }

  static Pack load(const double* from) {
    Pack pack;
    if constexpr (split) {
      pack.held_ = {Low::load(from), High::load(from + low_size)};
    } else {
      detail::load(from, pack.held_);
    }
    return pack;
  }
  void store(double* to) const {
    if constexpr (split) {
      held_.low.store(to);
      held_.high.store(to + low_size);
    } else {
      detail::store(to, held_);
    }
  }

  friend Pack operator+(const Pack& a, const Pack& b) {
    return each([](const auto& x, const auto& y) { return x + y; }, a, b);
  }
  friend Pack operator-(const Pack& a, const Pack& b) {
    return each([](const auto& x, const auto& y) { return x - y; }, a, b);
  }
  friend Pack operator*(const Pack& a, const Pack& b) {
    return each([](const auto& x, const auto& y) { return x * y; }, a, b);
  }
  friend Pack operator/(const Pack& a, const Pack& b) {
    return each([](const auto& x, const auto& y) { return x / y; }, a, b);
  }
  friend Pack operator-(const Pack& a) {
    return each([](const auto& x) { return -x; }, a);
  }

  /// a b + c, with one rounding where the processor has such an instruction.
  friend Pack fma(const Pack& a, const Pack& b, const Pack& c) {
    return each([](const Register& x, const Register& y, const Register& z) { return detail::fused(x, y, z); }, a, b,
                c);
  }

  friend Pack abs(const Pack& a) {
    return each(
        [](const Register& x) -> Register {
          using std::abs, xsimd::abs;
          return abs(x);
        },
        a);
  }
  friend Pack max(const Pack& a, const Pack& b) {
    return each(
        [](const Register& x, const Register& y) -> Register {
          using std::max, xsimd::max;
          return max(x, y);
        },
        a, b);
  }

 private:
  template <int, class>
  friend class Pack;

  template <class Operation, class... Packs>
  static Pack each(Operation operation, const Packs&... packs) {
    Pack result;
    if constexpr (split) {
      result.held_ = {Low::each(operation, packs.held_.low...), High::each(operation, packs.held_.high...)};
    } else {
      result.held_ = operation(packs.held_...);
    }
    return result;
  }

  std::conditional_t<split, Halves, Register> held_;
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
