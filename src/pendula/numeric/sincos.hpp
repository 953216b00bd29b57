#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <pendula/numeric/lanes.hpp>
#include <tuple>
#include <xsimd/xsimd.hpp>

namespace pendula {

namespace detail {

// The argument is r + low, |r| ≤ π/4. Minimax polynomials of fdlibm:
// sin r = r + r³ P(r²), cos r = 1 − r²/2 + r⁴ Q(r²).
template <class Arch>
struct ReducedSinCos {
  using Batch = xsimd::batch<double, Arch>;
  Batch sine, cosine;

  ReducedSinCos(const Batch& r, const Batch& low) {
    const Batch z = r * r;
    const Batch minus_z_low = fused(-r, r, z);
    const Batch z2 = z * z;
    const Batch p01 = fused(z, Batch(8.33333333332248946124e-03), Batch(-1.66666666666666324348e-01));
    const Batch p23 = fused(z, Batch(2.75573137070700676789e-06), Batch(-1.98412698298579493134e-04));
    const Batch p45 = fused(z, Batch(1.58969099521155010221e-10), Batch(-2.50507602534068634195e-08));
    const Batch p = fused(z2, fused(z2, p45, p23), p01);
    const Batch q01 = fused(z, Batch(-1.38888888888741095749e-03), Batch(4.16666666666666019037e-02));
    const Batch q23 = fused(z, Batch(-2.75573143513906633035e-07), Batch(2.48015872894767294178e-05));
    const Batch q45 = fused(z, Batch(-1.13596475577881948265e-11), Batch(2.08757232129817482790e-09));
    const Batch q = fused(z2, fused(z2, q45, q23), q01);
    const Batch half = Batch(0.5) * z;
    const Batch one_less_half = Batch(1.0) - half;
    sine = r + fused(r * z, p, low * one_less_half);
    const Batch tail = ((Batch(1.0) - one_less_half) - half) - r * low + Batch(0.5) * minus_z_low;
    cosine = one_less_half + fused(z2, q, tail);
  }
};

/// From here on the argument reduction below loses digits.
inline constexpr double large_angle = 1e5;

/// Recomputes the lanes with large or NaN arguments by the standard library; the other lanes keep their results.
template <class Arch>
[[gnu::noinline, gnu::cold]] void sincos_of_large(const xsimd::batch<double, Arch>& x, xsimd::batch<double, Arch>& sine,
                                                  xsimd::batch<double, Arch>& cosine) {
  using Batch = xsimd::batch<double, Arch>;
  alignas(pack_alignment) double at[Batch::size], s[Batch::size], c[Batch::size];
  x.store_aligned(at);
  sine.store_aligned(s);
  cosine.store_aligned(c);
  for (std::size_t i = 0; i < Batch::size; ++i) {
    if (std::abs(at[i]) < large_angle) continue;
    s[i] = std::sin(at[i]);
    c[i] = std::cos(at[i]);
  }
  sine = Batch::load_aligned(s);
  cosine = Batch::load_aligned(c);
}

}  // namespace detail

/// Sine and cosine of every number of a register, to 0.8 ulp (0.7 with fused multiply-add) where |x| < 10⁵ and by the
/// standard library beyond. (xsimd's own has 1.25 ulp, and is slower.)
template <class Arch>
void sincos(const xsimd::batch<double, Arch>& x, xsimd::batch<double, Arch>& sine, xsimd::batch<double, Arch>& cosine) {
  using Batch = xsimd::batch<double, Arch>;
  using Integers = xsimd::batch<std::int64_t, Arch>;
  // Adding 1.5·2⁵² rounds x/(π/2) to an integer and leaves its low bits in the mantissa. The two leading pieces of π/2
  // have 33 bits each, so that their products with that integer are exact.
  const Batch magic(6755399441055744.0);
  const Batch shifted = detail::fused(x, Batch(0x1.45f306dc9c883p-1), magic);
  const Batch n = shifted - magic;
  const Batch y = detail::fused(n, Batch(-0x1.921fb544p+0), x);
  const Batch middle = n * Batch(0x1.0b4611a6p-34);
  const Batch r = y - middle;
  const Batch low = detail::fused(n, Batch(-0x1.3198a2e037073p-69), (y - r) - middle);
  const detail::ReducedSinCos<Arch> reduced(r, low);

  const auto bits = [](const Batch& value) { return std::bit_cast<Integers>(value); };
  const Integers quadrant = bits(shifted);
  const Integers sign(INT64_MIN);
  const Integers swap = Integers(0) - (quadrant & Integers(1));  // all ones in odd quadrants
  const Integers difference = (bits(reduced.sine) ^ bits(reduced.cosine)) & swap;
  const Integers sine_sign = (Integers(0) - (quadrant & Integers(2))) & sign;  // −2 has the sign bit
  const Integers cosine_sign = sine_sign ^ (swap & sign);
  sine = std::bit_cast<Batch>((bits(reduced.sine) ^ difference) ^ sine_sign);
  cosine = std::bit_cast<Batch>((bits(reduced.cosine) ^ difference) ^ cosine_sign);

  if (!xsimd::all(xsimd::abs(x) < Batch(detail::large_angle))) [[unlikely]]
    detail::sincos_of_large(x, sine, cosine);
}

/// In single precision, to 1.25 ulp.
template <class Arch>
void sincos(const xsimd::batch<float, Arch>& x, xsimd::batch<float, Arch>& sine, xsimd::batch<float, Arch>& cosine) {
  std::tie(sine, cosine) = xsimd::sincos(x);
}

template <class Real>
void sincos(const Real& x, Real& sine, Real& cosine) {
  using std::cos, std::sin;
  sine = sin(x);
  cosine = cos(x);
}

template <int Size, class Register>
void sincos(const Pack<Size, Register>& x, Pack<Size, Register>& sine, Pack<Size, Register>& cosine) {
  for_each_register([](const Register& at, Register& s, Register& c) { sincos(at, s, c); }, x, sine, cosine);
}

/// Sines and cosines of `count` numbers in a row. All three arrays are aligned and readable up to the next multiple of
/// eight numbers.
template <class Real>
void sincos_all(const Real* x, Real* sine, Real* cosine, std::ptrdiff_t count) {
  using Register = RegisterFor<8, Real>;
  for (std::ptrdiff_t i = 0; i < count; i += detail::register_size<Register>) {
    Register at, s, c;
    detail::load(x + i, at);
    sincos(at, s, c);
    detail::store(sine + i, s);
    detail::store(cosine + i, c);
  }
}

}  // namespace pendula
