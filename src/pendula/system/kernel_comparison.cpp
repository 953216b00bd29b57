#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/kernel_comparison.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
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
  if (const std::size_t count = info.constraints.size(); count > 0) {
    write({count, count * n}, of.constraints, q);
    write({count, count}, of.constraint_rates, q, v);
    write({count * n}, of.constraint_rate_slopes, q, v);
  }
  write({n}, of.acceleration, q, v);
  write({n}, of.velocity_from_momentum, q, momenta);
  write({n, n}, of.hamiltonian_form, q, momenta);
}

KernelComparison::KernelComparison(const SystemTable& table, std::span<const double> said)
    : table_(table),
      said_(said),
      n_(static_cast<int>(table.info.coordinates.size())),
      components_(std::accumulate(table.info.point_sizes.begin(), table.info.point_sizes.end(), 0)),
      parameters_(std::accumulate(table.info.parameter_sizes.begin(), table.info.parameter_sizes.end(), 0)),
      inputs_(static_cast<int>(table.info.inputs.size())),
      constraints_(static_cast<int>(table.info.constraints.size())) {
  int numbers = 0;
  for (int k = 0; k < written_count; ++k) {
    places_[static_cast<std::size_t>(k)] = numbers;
    numbers += size(static_cast<Written>(k));
  }
  for (const Written what : kernel_outputs) outputs_ += size(what);
  arguments_ = 1 + 3 * n_ + parameters_ + inputs_;
  point_size_ = static_cast<std::size_t>(arguments_) + 2 * static_cast<std::size_t>(numbers);
  count_ = said.empty() ? 0 : static_cast<std::size_t>(said.front());
  if (said.size() != 1 + count_ * point_size_) {
    throw std::invalid_argument("written values: expected " + std::to_string(1 + count_ * point_size_) +
                                " numbers for " + std::string(table.info.name) + ", got " +
                                std::to_string(said.size()));
  }
}

// Where the output `what`, or the first of several such outputs, begins among the outputs of a kernel.
std::size_t KernelComparison::place(Written what) const {
  std::size_t at = 0;
  for (const Written output : kernel_outputs) {
    if (output == what) return at;
    at += static_cast<std::size_t>(size(output));
  }
  return at;
}

// Checks solutions x of M x = b by their residual: L D Lᵀ without pivoting solves a system that differs by rounding.
template <class Keep>
void KernelComparison::compare_solved(std::size_t point, const std::vector<double>& values, const Keep& keep) const {
  const double* solved = values.data() + outputs_;
  const auto vector = [&](Solved what) { return solved + static_cast<int>(what) * n_; };
  const double* momenta = values.data() + place(Written::momenta);
  const double* v = arguments(point) + 1 + n_;
  for (int i = 0; i < n_; ++i) {
    const Truth rest = truth(point, Written::residual_at_rest, i), bias = truth(point, Written::momenta_at_rest, i);
    const Truth p = truth(point, Written::momenta, i), force = truth(point, Written::forces, i);
    const auto left = [&](const double* x, double right, double error) {
      long double total = -static_cast<long double>(right);
      double bound = error;
      for (int j = 0; j < n_; ++j) {
        const Truth m = truth(point, Written::mass, i * n_ + j);
        const double size = std::sqrt(
            std::abs(truth(point, Written::mass, i * n_ + i).value * truth(point, Written::mass, j * n_ + j).value));
        total += static_cast<long double>(m.value) * x[j];
        bound += (m.error + n_ * rounding * size) * std::abs(x[j]);
      }
      if (std::isnan(bound)) return;
      keep(total == 0 ? 0.0 : static_cast<double>(std::abs(total)) / bound);
    };
    left(vector(Solved::accelerations), -rest.value, rest.size());
    for (const Solved rates : {Solved::rates, Solved::hamiltonian_rates}) {
      left(vector(rates), momenta[i] - bias.value, bias.size() + p.size());
    }
    double bound = force.size();
    for (int j = 0; j < n_; ++j) {
      const double off = vector(Solved::hamiltonian_rates)[j] - v[j];
      bound += std::abs(truth(point, Written::forces_v, i * n_ + j).value * off);
    }
    if (!std::isnan(bound)) keep(std::abs(vector(Solved::hamiltonian_forces)[i] - force.value) / bound);
  }
}

std::vector<KernelLine> KernelComparison::check() const {
  constexpr double limit = 8;
  // Looser: functions of one state are compared with the model already, and a wrong function is off by far more than
  // this.
  constexpr double width_limit = 1e-6;
  constexpr double unknown = -1;  // until something is compared
  std::vector<KernelLine> lines;
  const auto add = [&](std::string_view what) {
    lines.push_back({what, unknown, limit});
    return lines.size() - 1;
  };
  const std::size_t energies = add("energies, as the model says");
  const std::size_t masses = add("mass matrix");
  const std::size_t forms = add("momenta and forces");
  const std::size_t form_jacobians = add("Jacobians of momenta and forces");
  const std::size_t residuals = add("residual of the equations of motion");
  const std::size_t residual_jacobians = add("Jacobians of the residual");
  const std::size_t powers = add("power of the forces");
  const std::size_t solutions = add("accelerations and rates, solved for");
  const std::size_t points = components_ > 0 ? add("points and their velocities") : 0;
  const std::size_t constraints = constraints_ > 0 ? add("constraints, their slopes and rates") : 0;
  const auto line_of = [&](Written what) {
    switch (what) {
      case Written::kinetic_energy:
      case Written::energy:
        return energies;
      case Written::mass:
        return masses;
      case Written::momenta:
      case Written::forces:
        return forms;
      case Written::momenta_q:
      case Written::forces_q:
      case Written::forces_v:
        return form_jacobians;
      case Written::residual_q:
      case Written::residual_v:
        return residual_jacobians;
      case Written::power:
        return powers;
      case Written::positions:
      case Written::velocities:
        return points;
      case Written::constraints:
      case Written::constraints_q:
      case Written::constraint_rates:
      case Written::constraint_second_rates:
      case Written::constraint_rates_q:
        return constraints;
      default:
        return residuals;
    }
  };
  const std::size_t lanes = add(width_line), series = table_.of_1.series_next == nullptr ? lanes : add(series_line);
  std::vector<KernelPoint> all;
  std::vector<double> values(static_cast<std::size_t>(outputs_ + solved_count * n_));
  for (std::size_t point = 0; point < count_; ++point) {
    const double* at = arguments(point);
    const PlainSystem system{at + 1 + 3 * n_, at + 1 + 3 * n_ + parameters_, {}};
    const auto numbers = [](const double* from, int count) { return std::vector(from, from + count); };
    all.push_back({at[0], numbers(system.parameters, parameters_), numbers(system.inputs, inputs_), numbers(at + 1, n_),
                   numbers(at + 1 + n_, n_), numbers(at + 1 + 2 * n_, n_)});
    evaluate_kernel(table_, system, at[0], at + 1, at + 1 + n_, at + 1 + 2 * n_, values.data());
    const double* value = values.data();
    for (const Written what : kernel_outputs) {
      for (int k = 0; k < size(what); ++k, ++value) {
        const Truth said = truth(point, what, k);
        if (said.is_known()) lines[line_of(what)].keep(said.roundings(*value));
      }
    }
    compare_solved(point, values, [&](double error) { lines[solutions].keep(error); });
  }
  for (const std::size_t line : {lanes, series}) lines[line].limit = width_limit;
  if (!all.empty()) lines[lanes].keep(width_error(table_, all));
  if (!all.empty() && series != lanes) lines[series].keep(series_error(table_, all));
  for (KernelLine& line : lines) {
    if (line.error == unknown) line.error = std::numeric_limits<double>::quiet_NaN();
  }
  return lines;
}

}  // namespace pendula
