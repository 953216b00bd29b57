// Taylor series of kernels: their sums solve the equations of motion, which other functions of the kernels have.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <memory>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/planar_4.hpp>
#include <pendula/kernels/swinging_atwood.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <pendula/system/interpreter.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/series_sums.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

namespace pendula::test {
namespace {

constexpr int order = 20;

/// W motions of a kernel, drawn at random, and their series.
template <int W>
class Motions {
  static constexpr std::size_t width = W;
  using Numbers = PackRows<width>;

 public:
  explicit Motions(const SystemTable& table)
      : table_(table),
        functions_(functions_of<W>(table)),
        n_(table.info.coordinates.size()),
        given_(table.info.inputs.size()),
        parameters_(count_of_parameters(table.info)),
        inputs_((order + 1) * given_ + 1),
        state_row_(series_state_row(n_, width)),
        state_((order + 1) * state_row_ / width + 8),
        kept_(static_cast<std::size_t>(table.info.series.kept) + 1),
        operands_(order * series_operand_row(table.info.series, width) / width + 8) {
    std::mt19937 draw(W);
    const auto fill = [&](double* numbers, std::size_t rows, double low, double high) {
      std::generate_n(numbers, rows * width, [&] { return std::uniform_real_distribution(low, high)(draw); });
    };
    fill(parameters_[0], parameters_.rows(), 0.5, 1.5);
    fill(times_[0], 1, 0, 1);
    fill(unit_[0], 1, 0.01, 0.02);
    fill(inputs_[0], 3 * given_, -1, 1);  // polynomials of degree 2
    fill(state_[0], 2 * n_, 0.5, 1.5);    // far from where masses are singular
  }

  /// The largest distance of derivatives of the series from what the kernel says of them at its sum, relative to the
  /// largest of them.
  double residual() {
    const SeriesRows rows{unit_[0], state_[0], kept_[0], operands_[0]};
    const Conditions at{table_.context, parameters_[0], times_[0], inputs_[0]};
    functions_.series_start(at, rows);
    functions_.series_next(at, rows, 1, 2);
    functions_.series_next(at, rows, 3, order - 1);
    const double tau = 0.75;
    Numbers there(2 * n_), slope(2 * n_), now(given_ + 1), time(1), found(2 * n_);
    sum(state_[0], state_row_, order, 2 * n_, tau, there[0], slope[0]);
    sum(inputs_[0], given_ * width, 2, given_, tau, now[0], nullptr);
    for (std::size_t lane = 0; lane < width; ++lane) time[0][lane] = times_[0][lane] + tau * unit_[0][lane];
    const Conditions then{table_.context, parameters_[0], time[0], now[0]};
    if (table_.info.series.has_momenta) {
      functions_.hamiltonian_form(then, there[0], there[n_], found[0], found[n_]);
    } else {
      functions_.acceleration(then, there[0], there[n_], found[n_]);
      std::copy_n(there[n_], n_ * width, found[0]);
    }
    double largest = 0, off = 0;
    for (std::size_t k = 0; k < 2 * n_; ++k) {
      for (std::size_t lane = 0; lane < width; ++lane) {
        const double error = std::abs(slope[k][lane] / unit_[0][lane] - found[k][lane]);
        off = std::isfinite(error) ? std::max(off, error) : HUGE_VAL;
        largest = std::max(largest, std::abs(found[k][lane]));
      }
    }
    return off / largest;
  }

 private:
  static std::size_t count_of_parameters(const SystemInfo& info) {
    std::size_t count = 0;
    for (const int size : info.parameter_sizes) count += static_cast<std::size_t>(size);
    return count;
  }

  /// Σ c_k τ^k of numbers in rows, and its derivative.
  static void sum(const double* rows, std::size_t row, std::size_t last, std::size_t count, double tau, double* value,
                  double* slope) {
    for (std::size_t i = 0; i < count * width; ++i) {
      double sum = 0, change = 0;
      for (std::size_t k = last + 1; k-- > 0;) {
        change = change * tau + sum;
        sum = sum * tau + rows[k * row + i];
      }
      value[i] = sum;
      if (slope != nullptr) slope[i] = change;
    }
  }

  const SystemTable& table_;
  const SystemFunctions& functions_;
  std::size_t n_, given_;
  Numbers parameters_, times_{1}, unit_{1}, inputs_;
  std::size_t state_row_;
  Numbers state_, kept_, operands_;
};

double residual(const SystemTable& table) {
  return std::max({Motions<1>(table).residual(), Motions<2>(table).residual(), Motions<4>(table).residual(),
                   Motions<8>(table).residual()});
}

TEST(KernelSeries, SolveTheEquationsOfMotion) {
  namespace kernels = pendula::kernels;
  EXPECT_LT(residual(system_table<kernels::Planar2>), 1e-14);         // measured 3.3e-16
  EXPECT_LT(residual(system_table<kernels::Planar4>), 1e-14);         // measured 7e-16
  EXPECT_LT(residual(system_table<kernels::SwingingAtwood>), 1e-14);  // measured 9.0e-16
}

// Of a program that the generator wrote for the interpreter when this test was built: trigonometric functions, an
// input.
TEST(KernelSeries, OfInterpretedKernelsDoSo) {
  std::ostringstream text;
  text << std::ifstream(INTERPRETED_FURUTA).rdbuf();
  const auto table = table_of(text.str(), program_interpreter);
  EXPECT_GT(table->info.series.sums, 0);
  EXPECT_LT(residual(*table), 1e-14);  // measured 2.5e-16
}

// Sums of random operands, against the same one by one.
TEST(KernelSeries, SumsAreOfAllProducts) {
  constexpr std::size_t operands = 5;
  const std::vector<SeriesSum> pairs{{0, 1}, {2, 2}, {4, 0}, {3, 1}, {1, 1}, {2, 4}, {0, 0}, {3, 4}, {2, 1}};
  const SeriesInfo info{true, static_cast<int>(pairs.size()), operands, 0};
  std::mt19937 draw(1);
  std::uniform_real_distribution<double> some(-1, 1);
  PackRows<8> rows((order + 1) * operands), lanes((order + 1) * series_operand_row(info, 1) / 8);
  for (std::size_t k = 0; k < rows.rows(); ++k) std::generate_n(rows[k], 8, [&] { return some(draw); });
  for (std::size_t j = 0; j <= order; ++j) {
    for (std::size_t m = 0; m < pairs.size(); ++m) {
      double* const row = lanes[0] + j * series_operand_row(info, 1);
      row[m] = rows[j * operands + pairs[m].first][3];
      row[series_lanes(info) + m] = rows[j * operands + pairs[m].second][3];
    }
  }
  for (std::size_t k = 1; k <= order; ++k) {
    PackRows<8> many(pairs.size()), one(series_lanes(info) / 8);
    detail::sums_of_many<8>(rows[0], pairs, operands * 8, k, many[0]);
    detail::sums_in_lanes(lanes[0], series_lanes(info), k, one[0]);
    for (std::size_t m = 0; m < pairs.size(); ++m) {
      for (std::size_t lane = 0; lane < 8; ++lane) {
        double sum = 0;
        for (std::size_t j = 1; j < k; ++j) {
          sum += rows[j * operands + pairs[m].first][lane] * rows[(k - j) * operands + pairs[m].second][lane];
        }
        EXPECT_NEAR(many[m][lane], sum, 2e-15) << k;
        if (lane == 3) {
          EXPECT_NEAR(one[0][m], sum, 2e-15) << k;
        }
      }
    }
  }
}

}  // namespace
}  // namespace pendula::test
