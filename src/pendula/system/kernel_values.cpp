#include <array>
#include <cstddef>
#include <numeric>
#include <pendula/system/kernel_values.hpp>
#include <tuple>
#include <utility>

namespace pendula {

void evaluate_kernel(const SystemTable& table, const PlainSystem& system, double time, const double* q, const double* v,
                     const double* a, double* values) {
  const SystemInfo& info = table.info;
  const std::size_t n = info.coordinates.size(), square = n * n;
  const auto points = static_cast<std::size_t>(std::accumulate(info.point_sizes.begin(), info.point_sizes.end(), 0));
  const Conditions at{table.context, system.parameters, &time, system.inputs};
  // Calls a function with outputs of these sizes, written one after the other to `values`; returns where the first one
  // is.
  const auto write = [&]<std::size_t outputs>(const std::size_t(&sizes)[outputs], auto* function, auto... given) {
    std::array<double*, outputs> to{};
    for (std::size_t k = 0; k < outputs; ++k) to[k] = std::exchange(values, values + sizes[k]);
    std::apply([&](auto... places) { function(at, given..., places...); }, to);
    return to[0];
  };
  const SystemFunctions& of = table.of_1;
  write({1, 1}, of.energies, q, v);
  write({square}, of.mass_matrix, q);
  const double* momenta = write({n}, of.momentum_from_velocity, q, v);
  write({n, n}, of.momentum_form, q, v);
  write({n, n, square, square, square, square}, of.momentum_form_with_jacobians, q, v);
  write({n}, table.plain.residual, q, v, a);
  write({n, square, square, square}, of.residual_with_jacobians, q, v, a);
  write({1}, of.power, q, v);
  if (points > 0) {
    write({points}, table.plain.positions, q);
    write({points}, table.plain.velocities, q, v);
  }
  write({n}, of.acceleration, q, v);
  write({n}, of.velocity_from_momentum, q, momenta);
  write({n, n}, of.hamiltonian_form, q, momenta);
}

}  // namespace pendula
