#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <pendula/system/kernel_registry.hpp>
#include <pendula/system/kernel_values.hpp>
#include <span>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace pendula {

/// Compares a kernel with what its model says at several points, in units of what the text of the model is off by where
/// each of its operations is rounded once.
class KernelComparison {
 public:
  /// `said` are the numbers that `python -m pendula_codegen written` writes. Throws std::invalid_argument where they
  /// are of another model.
  KernelComparison(const SystemInfo& info, std::span<const double> said)
      : said_(said),
        n_(static_cast<int>(info.coordinates.size())),
        components_(std::accumulate(info.point_sizes.begin(), info.point_sizes.end(), 0)),
        parameters_(std::accumulate(info.parameter_sizes.begin(), info.parameter_sizes.end(), 0)),
        inputs_(static_cast<int>(info.inputs.size())) {
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
      throw std::invalid_argument("a kernel can be compared with what its own model says only");
    }
  }

  /// How many points there are.
  std::size_t count() const { return count_; }

  /// What energies are off by at the first point, by rounding  [J].
  double energy_rounding() const { return count_ == 0 ? 0 : std::abs(truth(0, Written::energy, 0).error); }

  // Beside the limits stands the largest of the built-in models and of those of the tests.
  KernelCheck check(EvaluateKernel* evaluate) const {
    KernelCheck check;
    const auto add = [&](std::string_view what) {
      check.lines[static_cast<std::size_t>(check.count++)] = {what, 0, limit};
      return static_cast<std::size_t>(check.count - 1);
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
        default:
          return residuals;
      }
    };
    std::array<int, 10> compared{};
    const auto keep = [&](std::size_t line, double error) {
      double& largest = check.lines[line].error;
      if (!std::isnan(largest) && !(error <= largest)) largest = error;  // NaN is the largest
      ++compared[line];
    };
    std::vector<double> values(static_cast<std::size_t>(outputs_ + solved_count * n_));
    for (std::size_t point = 0; point < count_; ++point) {
      const double* at = arguments(point);
      const PlainSystem system{at + 1 + 3 * n_, at + 1 + 3 * n_ + parameters_, {}};
      evaluate(system, at[0], at + 1, at + 1 + n_, at + 1 + 2 * n_, values.data());
      const double* value = values.data();
      for (const Written what : kernel_outputs) {
        for (int k = 0; k < size(what); ++k, ++value) {
          const Truth said = truth(point, what, k);
          if (said.is_known()) keep(line_of(what), said.roundings(*value));
        }
      }
      compare_solved(point, values, [&](double error) { keep(solutions, error); });
    }
    for (int k = 0; k < check.count; ++k) {
      if (compared[static_cast<std::size_t>(k)] == 0) {
        check.lines[static_cast<std::size_t>(k)].error = std::numeric_limits<double>::quiet_NaN();
      }
    }
    return check;
  }

 private:
  static constexpr double limit = 8;
  static constexpr double rounding = std::numeric_limits<double>::epsilon() / 2;

  struct Truth {
    double value, error;

    bool is_known() const { return !std::isnan(value); }
    double size() const { return error + rounding * std::abs(value); }
    double roundings(double computed) const { return computed == value ? 0 : std::abs(computed - value) / size(); }
  };

  int size(Written what) const { return written_size(what, n_, components_); }
  const double* arguments(std::size_t point) const { return said_.data() + 1 + point * point_size_; }
  Truth truth(std::size_t point, Written what, int k) const {
    const double* pair = arguments(point) + arguments_ + 2 * (places_[static_cast<std::size_t>(what)] + k);
    return {pair[0], pair[1]};
  }

  // Where the written output `what` begins among those of a kernel: the first of several.
  std::size_t place(Written what) const {
    std::size_t at = 0;
    for (const Written output : kernel_outputs) {
      if (output == what) return at;
      at += static_cast<std::size_t>(size(output));
    }
    return at;
  }

  // Of M x = b, by what is left of it: L D Lᵀ without pivoting has solved a system that is a rounding away.
  template <class Keep>
  void compare_solved(std::size_t point, const std::vector<double>& values, const Keep& keep) const {
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

  std::span<const double> said_;
  int n_, components_, parameters_, inputs_;
  int arguments_ = 0, outputs_ = 0;
  std::size_t point_size_ = 0, count_ = 0;
  std::array<int, written_count> places_{};
};

}  // namespace pendula
