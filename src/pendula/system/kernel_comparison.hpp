#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/system/kernel_values.hpp>
#include <pendula/system/kernel_widths.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Compares a kernel with the expressions of its model at several points. Errors are in units of the rounding error of
/// the model's own expressions, with each operation rounded once.
class KernelComparison {
 public:
  /// `said` are the numbers that `python -m pendula_codegen written` writes. Throws std::invalid_argument if they
  /// belong to another model. Both arguments must outlive this object.
  KernelComparison(const SystemTable& table, std::span<const double> said);

  /// Rounding error of the energy at the first point  [J].
  double energy_rounding() const { return count_ == 0 ? 0 : std::abs(truth(0, Written::energy, 0).error); }

  std::vector<KernelLine> check() const;

 private:
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

  std::size_t place(Written what) const;
  template <class Keep>
  void compare_solved(std::size_t point, const std::vector<double>& values, const Keep& keep) const;

  const SystemTable& table_;
  std::span<const double> said_;
  int n_, components_, parameters_, inputs_;
  int arguments_ = 0, outputs_ = 0;
  std::size_t point_size_ = 0, count_ = 0;
  std::array<int, written_count> places_{};
};

}  // namespace pendula
