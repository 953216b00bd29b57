#pragma once

#include <cstddef>
#include <cstdint>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/sincos.hpp>
#include <pendula/numeric/written_out.hpp>
#include <xsimd/xsimd.hpp>

namespace pendula {

/// A number for each of several members of an ensemble, one member in each lane of a SIMD register. The result in a
/// lane depends on that lane alone, to the last bit.
///
/// A product is rounded where it is written and never fused with a sum. So code that the compiler has copied and
/// optimised in two ways still gives one result. Where one rounding is wanted, the code says fma.
template <class Register>
class LanePack {
 public:
  static constexpr std::size_t width = Register::size;
  static constexpr int size = static_cast<int>(width);
  using Mask = typename Register::batch_bool_type;  ///< a bool for every member

  LanePack() = default;
  explicit LanePack(double value) : held_(value) {}
  explicit LanePack(const Register& held) : held_(held) {}

  static LanePack load(const double* from) { return LanePack(Register::load_aligned(from)); }
  void store(double* to) const { held_.store_aligned(to); }
  const Register& held() const { return held_; }

  /// The number of one member; slow, for rare use.
  double operator[](int lane) const {
    alignas(pack_alignment) double values[width];
    store(values);
    return values[lane];
  }
  void set(int lane, double value) {
    alignas(pack_alignment) double values[width];
    store(values);
    values[lane] = value;
    held_ = Register::load_aligned(values);
  }

  friend LanePack operator+(const LanePack& a, const LanePack& b) { return LanePack(Register(a.held_ + b.held_)); }
  friend LanePack operator-(const LanePack& a, const LanePack& b) { return LanePack(Register(a.held_ - b.held_)); }
  friend LanePack operator*(const LanePack& a, const LanePack& b) {
    return LanePack(rounded(Register(a.held_ * b.held_)));
  }
  friend LanePack operator/(const LanePack& a, const LanePack& b) { return LanePack(Register(a.held_ / b.held_)); }
  friend LanePack operator-(const LanePack& a) { return LanePack(Register(-a.held_)); }

  friend Mask operator<(const LanePack& a, const LanePack& b) { return a.held_ < b.held_; }
  friend Mask operator<=(const LanePack& a, const LanePack& b) { return a.held_ <= b.held_; }
  friend Mask operator>(const LanePack& a, const LanePack& b) { return b.held_ < a.held_; }
  friend Mask operator>=(const LanePack& a, const LanePack& b) { return b.held_ <= a.held_; }
  friend Mask operator==(const LanePack& a, const LanePack& b) { return a.held_ == b.held_; }

  friend LanePack fma(const LanePack& a, const LanePack& b, const LanePack& c) {
    return LanePack(detail::fused(a.held_, b.held_, c.held_));
  }
  friend LanePack sqrt(const LanePack& a) { return LanePack(Register(xsimd::sqrt(a.held_))); }
  friend LanePack abs(const LanePack& a) { return LanePack(Register(xsimd::abs(a.held_))); }
  friend LanePack atan2(const LanePack& y, const LanePack& x) {
    return LanePack(Register(xsimd::atan2(y.held_, x.held_)));
  }
  friend LanePack sin(const LanePack& a) {
    Register sine, cosine;
    sincos(a.held_, sine, cosine);
    return LanePack(sine);
  }
  friend LanePack cos(const LanePack& a) {
    Register sine, cosine;
    sincos(a.held_, sine, cosine);
    return LanePack(cosine);
  }
  friend LanePack floor(const LanePack& a) { return LanePack(Register(xsimd::floor(a.held_))); }
  friend LanePack exp(const LanePack& a) { return LanePack(Register(xsimd::exp(a.held_))); }
  friend LanePack log(const LanePack& a) { return LanePack(Register(xsimd::log(a.held_))); }
  friend LanePack log2_near(const LanePack& a) {
    xsimd::batch<std::int64_t, typename Register::arch_type> exponent;
    const LanePack half(xsimd::frexp(a.held_, exponent));  // 1/2 to 1
    return LanePack(Register(xsimd::to_float(exponent))) - LanePack(1.0) + detail::log2_of_mantissa(half + half);
  }
  friend LanePack max(const LanePack& a, const LanePack& b) { return LanePack(Register(xsimd::max(a.held_, b.held_))); }
  friend LanePack min(const LanePack& a, const LanePack& b) { return LanePack(Register(xsimd::min(a.held_, b.held_))); }
  friend LanePack select(const Mask& which, const LanePack& yes, const LanePack& no) {
    return LanePack(Register(xsimd::select(which, yes.held_, no.held_)));
  }
  /// The same number, kept in a register: otherwise GCC would load it again from memory for each product.
  friend LanePack in_register(const LanePack& a) { return LanePack(kept(a.held_)); }

 private:
  static Register rounded(const Register& product) {
#if defined(__GNUC__) && !defined(__clang__)
    using Raw = typename Register::register_type;
    return Register(__builtin_assoc_barrier(static_cast<Raw>(product)));
#else
    return product;  // Clang fuses within one expression only
#endif
  }

  static Register kept(const Register& number) {
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
    auto raw = static_cast<typename Register::register_type>(number);
    asm("" : "+v"(raw));
    return Register(raw);
#else
    return number;
#endif
  }

  Register held_;
};

/// The widest register of this processor, up to eight members.
using MemberRegister = RegisterFor<8>;

// Multiplies every lane by one number.
template <class Register>
LanePack<Register> operator*(double a, const LanePack<Register>& b) {
  return LanePack<Register>(a) * b;
}

template <class Register>
Twofold<LanePack<Register>> exact_product(const LanePack<Register>& a, const LanePack<Register>& b) {
  using L = LanePack<Register>;
  const L product = a * b;
  if constexpr (detail::has_fast_fma<double>) {
    return {product, fma(a, b, -product)};
  } else {
    const auto high_bits = [](const L& x) {
      const L spread = x * L(134217729.0);
      return spread - (spread - x);
    };
    const L a_high = high_bits(a), b_high = high_bits(b);
    const L a_low = a - a_high, b_low = b - b_high;
    return {product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low};
  }
}

}  // namespace pendula
