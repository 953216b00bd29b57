#pragma once

#include <cstddef>

namespace pendula {

/// Orthonormalizer::make_orthonormal: makes tangents orthonormal by QR, for Lyapunov exponents.
void make_orthonormal(double* directions, std::ptrdiff_t rows, std::ptrdiff_t count, double* lengths);

}  // namespace pendula
