#pragma once

#include <array>
#include <cstddef>

namespace pendula {

// Explicit Runge–Kutta methods: stage i is at y + h Σ_j a_ij k_j, the end at y + h Σ_i b_i k_i. The error estimate is h
// Σ_i e_i k_i, where the last k is the slope at the end; a method with `error_order` 0 has no estimate. If `is_blind`,
// the estimate compares slopes at both ends only, and does not see forces that depend on time. A new method also needs
// a case in library/explicit_methods.hpp.

/// The classical Runge–Kutta method of order 4.
struct ClassicalRungeKutta {
  static constexpr std::size_t stages = 4;
  static constexpr int error_order = 0;
  static constexpr double a[stages][stages] = {{}, {1.0 / 2}, {0, 1.0 / 2}, {0, 0, 1}};
  static constexpr std::array<double, stages> b = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
  static constexpr std::array<double, stages + 1> e = {};
};

namespace detail {

/// Node c_i of a stage: the sum of its weights a_ij.
template <std::size_t Count>
constexpr double node_of(const double (&weights)[Count]) {
  double sum = 0;
  for (const double weight : weights) sum += weight;
  return sum;
}

}  // namespace detail

/// Order 5 with an estimate of order 4 (Dormand, Prince, J. Comput. Appl. Math. 6 (1980) 19).
struct DormandPrince5 {
  static constexpr std::size_t stages = 6;
  static constexpr int error_order = 4;
  static constexpr bool is_blind = false;
  static constexpr double a[stages][stages] = {
      {},
      {1.0 / 5},
      {3.0 / 40, 9.0 / 40},
      {44.0 / 45, -56.0 / 15, 32.0 / 9},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656}};
  static constexpr std::array<double, stages> b = {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84};
  static constexpr std::array<double, stages + 1> e = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                                       -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
};

/// Order 8 with an estimate of order 7 (Fehlberg, NASA TR R-287 (1968)).
struct Fehlberg8 {
  static constexpr std::size_t stages = 13;
  static constexpr int error_order = 7;
  static constexpr bool is_blind = true;
  static constexpr double a[stages][stages] = {
      {},
      {2.0 / 27},
      {1.0 / 36, 1.0 / 12},
      {1.0 / 24, 0, 1.0 / 8},
      {5.0 / 12, 0, -25.0 / 16, 25.0 / 16},
      {1.0 / 20, 0, 0, 1.0 / 4, 1.0 / 5},
      {-25.0 / 108, 0, 0, 125.0 / 108, -65.0 / 27, 125.0 / 54},
      {31.0 / 300, 0, 0, 0, 61.0 / 225, -2.0 / 9, 13.0 / 900},
      {2, 0, 0, -53.0 / 6, 704.0 / 45, -107.0 / 9, 67.0 / 90, 3},
      {-91.0 / 108, 0, 0, 23.0 / 108, -976.0 / 135, 311.0 / 54, -19.0 / 60, 17.0 / 6, -1.0 / 12},
      {2383.0 / 4100, 0, 0, -341.0 / 164, 4496.0 / 1025, -301.0 / 82, 2133.0 / 4100, 45.0 / 82, 45.0 / 164, 18.0 / 41},
      {3.0 / 205, 0, 0, 0, 0, -6.0 / 41, -3.0 / 205, -3.0 / 41, 3.0 / 41, 6.0 / 41},
      {-1777.0 / 4100, 0, 0, -341.0 / 164, 4496.0 / 1025, -289.0 / 82, 2193.0 / 4100, 51.0 / 82, 33.0 / 164, 12.0 / 41,
       0, 1}};
  static constexpr std::array<double, stages> b = {0,        0,         0,         0, 0,          34.0 / 105, 9.0 / 35,
                                                   9.0 / 35, 9.0 / 280, 9.0 / 280, 0, 41.0 / 840, 41.0 / 840};
  static constexpr std::array<double, stages + 1> e = {41.0 / 840, 0, 0, 0,          0,           0,           0,
                                                       0,          0, 0, 41.0 / 840, -41.0 / 840, -41.0 / 840, 0};
};

}  // namespace pendula
