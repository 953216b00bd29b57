#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/fast_fma.hpp>
#include <type_traits>
#include <xsimd/xsimd.hpp>

/// Written before a function that carries packs through a loop: all its calls are inlined, so that packs stay in
/// registers. Not with the address sanitizer, which would instrument all of the inlined code.
#if defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__)
#define PENDULA_IN_REGISTERS [[gnu::flatten]]
#else
#define PENDULA_IN_REGISTERS
#endif

namespace pendula {

namespace detail {

// Types that SIMD registers exist for; numbers of any other type are computed one by one.
template <class Real>
inline constexpr bool has_registers = std::is_same_v<Real, double> || std::is_same_v<Real, float>;

// The widest register whose size divides `Size`; Real itself where there is none.
template <int Size, class Real, std::size_t Width = 8>
auto widest_register() {
  if constexpr (Width == 1 || !has_registers<Real>) {
    return std::type_identity<Real>{};
  } else if constexpr (static_cast<std::size_t>(Size) % Width == 0 &&
                       !std::is_void_v<xsimd::make_sized_batch_t<Real, Width>>) {
    return std::type_identity<xsimd::make_sized_batch_t<Real, Width>>{};
  } else {
    return widest_register<Size, Real, Width / 2>();
  }
}

// A plain number counts as a register of one.
template <class Register>
struct RegisterTraits {
  using Scalar = Register;
  static constexpr int size = 1;
};
template <class Real, class Arch>
struct RegisterTraits<xsimd::batch<Real, Arch>> {
  using Scalar = Real;
  static constexpr int size = static_cast<int>(xsimd::batch<Real, Arch>::size);
};

template <class Register>
inline constexpr int register_size = RegisterTraits<Register>::size;

template <class Real>
void load(const Real* from, Real& to) {
  to = *from;
}
template <class Real>
void store(Real* to, const Real& from) {
  *to = from;
}
template <class Real>
void store_unaligned(Real* to, const Real& from) {
  *to = from;
}
template <class Real, class Arch>
void store_unaligned(Real* to, const xsimd::batch<Real, Arch>& from) {
  from.store_unaligned(to);
}
template <class Real, class Arch>
void load(const Real* from, xsimd::batch<Real, Arch>& to) {
  to = xsimd::batch<Real, Arch>::load_aligned(from);
}
template <class Real, class Arch>
void store(Real* to, const xsimd::batch<Real, Arch>& from) {
  from.store_aligned(to);
}

// x y + z, rounded once where the processor can. Intrinsics are needed here, and only here: xsimd's fma rounds twice in
// registers of two, in those of four where the processor has AVX-VNNI and, before version 11, in those of eight (xsimd
// issue 884). Then exact_product would return a wrong error term.
template <class Real>
Real fused(const Real& x, const Real& y, const Real& z) {
  if constexpr (has_fast_fma<Real>) {
    return std::fma(x, y, z);
  } else {
    return x * y + z;
  }
}
template <class Real, class Arch>
xsimd::batch<Real, Arch> fused(const xsimd::batch<Real, Arch>& x, const xsimd::batch<Real, Arch>& y,
                               const xsimd::batch<Real, Arch>& z) {
  [[maybe_unused]] constexpr std::size_t bytes = sizeof(xsimd::batch<Real, Arch>);
  [[maybe_unused]] constexpr bool wide = std::is_same_v<Real, double>;
#ifdef __FMA__
  if constexpr (wide && bytes == 16) return _mm_fmadd_pd(x, y, z);
  if constexpr (!wide && bytes == 16) return _mm_fmadd_ps(x, y, z);
  if constexpr (wide && bytes == 32) return _mm256_fmadd_pd(x, y, z);
  if constexpr (!wide && bytes == 32) return _mm256_fmadd_ps(x, y, z);
#endif
#ifdef __AVX512F__
  if constexpr (wide && bytes == 64) return _mm512_fmadd_pd(x, y, z);
#endif
  return xsimd::fma(x, y, z);
}

}  // namespace detail

/// The register that a pack of `Size` numbers consists of. It is a template parameter of everything made of packs, so
/// that code compiled for different processors has different names and a linker cannot mix them up.
template <int Size, class Real = double, int Widest = 8>
using RegisterFor = typename decltype(detail::widest_register<Size, Real, Widest>())::type;

/// `Size` numbers in SIMD registers of the compiler's target; arithmetic is elementwise. Loads and stores need
/// addresses aligned to `pack_alignment`. A pack of more than one register is two packs, not an array: compilers keep
/// those in registers.
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
  using Scalar = typename detail::RegisterTraits<Register>::Scalar;
  static constexpr int size = Size;

  Pack() = default;
  explicit Pack(Scalar value) {
    if constexpr (split) {
      held_ = {Low(value), High(value)};
    } else {
      held_ = Register(value);
    }
  }

  static Pack load(const Scalar* from) {
    Pack pack;
    if constexpr (split) {
      pack.held_ = {Low::load(from), High::load(from + low_size)};
    } else {
      detail::load(from, pack.held_);
    }
    return pack;
  }
  void store(Scalar* to) const {
    if constexpr (split) {
      held_.low.store(to);
      held_.high.store(to + low_size);
    } else {
      detail::store(to, held_);
    }
  }
  void store_unaligned(Scalar* to) const {
    if constexpr (split) {
      held_.low.store_unaligned(to);
      held_.high.store_unaligned(to + low_size);
    } else {
      detail::store_unaligned(to, held_);
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

  /// operation(x, a, b) on every register, where a and b are two results of x.
  template <class Operation>
  friend void for_each_register(Operation operation, const Pack& x, Pack& a, Pack& b) {
    if constexpr (split) {
      for_each_register(operation, x.held_.low, a.held_.low, b.held_.low);
      for_each_register(operation, x.held_.high, a.held_.high, b.held_.high);
    } else {
      operation(x.held_, a.held_, b.held_);
    }
  }

  /// a b + c, with one rounding where the processor has such an instruction.
  friend Pack fma(const Pack& a, const Pack& b, const Pack& c) {
    return each([](const Register& x, const Register& y, const Register& z) { return detail::fused(x, y, z); }, a, b,
                c);
  }

  /// operation(x) on every register.
  template <class Operation>
  friend Pack mapped(Operation operation, const Pack& a) {
    return each(operation, a);
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

/// In bytes; enough for every register that xsimd has.
inline constexpr std::size_t pack_alignment = 64;

namespace detail {

template <class Number>
struct ScalarOf {
  using type = Number;
};
template <int Size, class Register>
struct ScalarOf<Pack<Size, Register>> {
  using type = typename Pack<Size, Register>::Scalar;
};

}  // namespace detail

/// The type of one number of a pack; of a plain number, its own type.
template <class Number>
using ScalarOf = typename detail::ScalarOf<Number>::type;

/// Size of a pack that holds one quantity at all `stages`: the next power of two where there are registers. The numbers
/// after the last stage are computed like the others and never used.
template <class Real = double>
constexpr int lanes_for(int stages) {
  if (!detail::has_registers<Real>) return stages;
  return stages <= 2 ? stages : stages <= 4 ? 4 : 8;
}

/// One quantity of one link at all stages.
template <int S, class Real = double>
using Lanes = Pack<lanes_for<Real>(S), RegisterFor<lanes_for<Real>(S), Real>>;

}  // namespace pendula
