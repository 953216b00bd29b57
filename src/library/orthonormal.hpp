#pragma once

#include <cstddef>

namespace pendula {

/// Makes directions orthonormal by QR, for Lyapunov exponents: as Library::make_orthonormal.
void make_orthonormal(double* directions, std::ptrdiff_t rows, std::ptrdiff_t count, double* lengths);

}  // namespace pendula
