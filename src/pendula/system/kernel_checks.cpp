#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/kernel_checks.hpp>
#include <pendula/system/series_info.hpp>
#include <random>
#include <tuple>
#include <vector>

namespace pendula {
namespace {

using Numbers = std::vector<double>;
/// One array for each point.
using Arrays = std::vector<Numbers>;
/// Rows of as many numbers as there are lanes.
using Wide = std::vector<double, detail::PackAllocator<double>>;

constexpr std::array<std::size_t, 3> widths{2, 4, 8};

const SystemFunctions& functions(const SystemTable& table, std::size_t width) {
  return width == 1 ? table.of_1 : width == 2 ? table.of_2 : width == 4 ? table.of_4 : table.of_8;
}

/// The largest difference from reference numbers, relative to the largest of these.
class Difference {
 public:
  void take(double found, double right) {
    if (std::isfinite(right)) largest_ = std::max(largest_, std::abs(right));
    if (found == right || (std::isnan(found) && std::isnan(right))) return;
    worst_.keep(std::abs(found - right));
  }
  double relative() const { return worst_.error == 0 ? 0 : worst_.error / (largest_ > 0 ? largest_ : 1); }

 private:
  KernelLine worst_;
  double largest_ = 0;
};

class Widths {
 public:
  Widths(const SystemTable& table, std::span<const KernelPoint> points)
      : table_(table), points_(points), n_(table.info.coordinates.size()) {
    for (const KernelPoint& point : points) {
      times_.push_back({point.time});
      parameters_.push_back(point.parameters);
      inputs_.push_back(point.inputs);
      q_.push_back(point.q);
      v_.push_back(point.v);
      a_.push_back(point.a);
    }
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Wide p = call(&SystemFunctions::momentum_from_velocity, 1, k, {&q_, &v_}, {n_})[0];
      p_.emplace_back(p.begin(), p.end());
    }
  }

  double error() {
    using Of = SystemFunctions;
    const std::size_t square = n_ * n_;
    compare(&Of::hamiltonian_form, {&q_, &p_}, {n_, n_});
    compare(&Of::momentum_form, {&q_, &v_}, {n_, n_});
    compare(&Of::momentum_form_with_jacobians, {&q_, &v_}, {n_, n_, square, square, square, square});
    compare(&Of::residual_with_jacobians, {&q_, &v_, &a_}, {n_, square, square, square});
    compare(&Of::momentum_from_velocity, {&q_, &v_}, {n_});
    compare(&Of::velocity_from_momentum, {&q_, &p_}, {n_});
    compare(&Of::acceleration, {&q_, &v_}, {n_});
    compare(&Of::mass_matrix, {&q_}, {square});
    compare(&Of::energies, {&q_, &v_}, {1, 1});
    compare(&Of::power, {&q_, &v_}, {1});
    compare(&Of::acceleration_along, {&q_, &v_, &v_, &a_}, {n_, n_});
    compare(&Of::momentum_form_along, {&parameters_, &inputs_, &q_, &v_}, {n_, n_});
    if (table_.of_1.call_arguments != nullptr) {
      compare(&Of::call_arguments, {&q_, &v_}, {table_.info.argument_is_base.size()});
    }
    if (const std::size_t count = table_.info.constraints.size(); count > 0) {
      compare(&Of::constraints, {&q_}, {count, count * n_});
      compare(&Of::constraint_rates, {&q_, &v_}, {count, count});
      compare(&Of::constraint_rate_slopes, {&q_, &v_}, {count * n_});
      compare(&Of::constraints_along, {&parameters_, &q_}, {count, count * n_});
      compare(&Of::constraint_rates_along, {&parameters_, &v_, &a_, &q_, &v_}, {count, count});
    }
    compare_iteration(1);
    for (const std::size_t width : widths) compare_iteration(width);
    return worst_.error;
  }

 private:
  std::size_t point_of(std::size_t first, std::size_t lane) const { return (first + lane) % points_.size(); }

  // Interleaves arrays of points. One row more than needed: even without numbers there is a valid address.
  Wide wide(const Arrays& arrays, std::size_t width, std::size_t first) const {
    const std::size_t rows = arrays[0].size();
    Wide numbers((rows + 1) * width);
    for (std::size_t lane = 0; lane < width; ++lane) {
      const Numbers& from = arrays[point_of(first, lane)];
      for (std::size_t k = 0; k < rows; ++k) numbers[k * width + lane] = from[k];
    }
    return numbers;
  }

  /// Calls a function of `width` states at the points from `first` on. Returns its outputs, which have this many rows.
  template <class... Places>
  std::vector<Wide> call(void (*SystemFunctions::*function)(const Conditions&, Places...), std::size_t width,
                         std::size_t first, std::initializer_list<const Arrays*> given,
                         std::initializer_list<std::size_t> rows) const {
    const Wide parameters = wide(parameters_, width, first), times = wide(times_, width, first),
               inputs = wide(inputs_, width, first);
    std::vector<Wide> taken, found;
    std::array<double*, sizeof...(Places)> places{};
    for (const Arrays* arrays : given) taken.push_back(wide(*arrays, width, first));
    for (const std::size_t count : rows) found.emplace_back(count * width);
    auto* place = places.begin();
    for (std::vector<Wide>* wides : {&taken, &found}) {
      for (Wide& numbers : *wides) *place++ = numbers.data();
    }
    const Conditions at{table_.context, parameters.data(), times.data(), inputs.data()};
    std::apply([&](auto... to) { (functions(table_, width).*function)(at, to...); }, places);
    return found;
  }

  template <class... Places>
  void compare(void (*SystemFunctions::*function)(const Conditions&, Places...),
               std::initializer_list<const Arrays*> given, std::initializer_list<std::size_t> rows) {
    std::vector<std::vector<Wide>> right;
    right.reserve(points_.size());
    for (std::size_t k = 0; k < points_.size(); ++k) right.push_back(call(function, 1, k, given, rows));
    std::vector<Difference> differences(rows.size());
    for (const std::size_t width : widths) {
      for (std::size_t first = 0; first < points_.size(); ++first) {
        const std::vector<Wide> found = call(function, width, first, given, rows);
        for (std::size_t output = 0; output < found.size(); ++output) {
          for (std::size_t k = 0; k < found[output].size(); ++k) {
            differences[output].take(found[output][k], right[point_of(first, k % width)][output][k / width]);
          }
        }
      }
    }
    for (const Difference& difference : differences) worst_.keep(difference.relative());
  }

  /// One fixed-point iteration with arbitrary coefficients, against hamiltonian_form of each stage.
  void compare_iteration(std::size_t width) {
    Difference increments, changes;
    for (std::size_t first = 0; first < points_.size(); ++first) {
      // Stages differ in time and inputs, and share the parameters of one system.
      const Wide parameters = wide(Arrays(points_.size(), parameters_[first]), width, 0),
                 times = wide(times_, width, first), inputs = wide(inputs_, width, first);
      Wide m(width * width), hb(width), before(2 * n_ * width);
      for (std::size_t k = 0; k < m.size(); ++k) m[k] = 0.2 + 0.1 * std::sin(static_cast<double>(k));
      for (std::size_t k = 0; k < width; ++k) hb[k] = 1e-3 / static_cast<double>(k + 1);
      std::vector<Compensated<double>> start(2 * n_);
      Numbers weights(2 * n_);
      for (std::size_t k = 0; k < 2 * n_; ++k) {
        start[k] = {(k < n_ ? q_ : p_)[first][k % n_], 0};
        weights[k] = 1 + static_cast<double>(k);
        for (std::size_t lane = 0; lane < width; ++lane) {
          before[k * width + lane] = 1e-3 * std::cos(static_cast<double>(k + 5 * lane));
        }
      }
      Wide after = before;
      const IterationChange said = functions(table_, width)
                                       .iterate({table_.context, parameters.data(), times.data(), inputs.data()},
                                                {m.data(), hb.data(), start.data(), weights.data(), after.data()});
      IterationChange right{0, 0};
      for (std::size_t lane = 0; lane < width; ++lane) {
        const std::size_t stage = point_of(first, lane);
        Numbers reached(2 * n_), rates(2 * n_);
        for (std::size_t k = 0; k < 2 * n_; ++k) {
          reached[k] = start[k].value;
          for (std::size_t j = 0; j < width; ++j) reached[k] += m[j * width + lane] * before[k * width + j];
        }
        const Conditions at{table_.context, parameters_[first].data(), times_[stage].data(), inputs_[stage].data()};
        table_.of_1.hamiltonian_form(at, reached.data(), reached.data() + n_, rates.data(), rates.data() + n_);
        for (std::size_t k = 0; k < 2 * n_; ++k) {
          const double now = hb[lane] * rates[k], was = before[k * width + lane];
          increments.take(after[k * width + lane], now);
          right.size = std::max(right.size, weights[k] * std::abs(now));
          right.change = std::max(right.change, weights[k] * std::abs(now - was));
        }
      }
      if (!std::isfinite(right.size)) continue;
      changes.take(said.size, right.size);
      changes.take(said.change, right.change);
    }
    worst_.keep(increments.relative());
    worst_.keep(changes.relative());
  }

  const SystemTable& table_;
  std::span<const KernelPoint> points_;
  std::size_t n_;
  Arrays times_, parameters_, inputs_, q_, v_, a_, p_;
  KernelLine worst_;
};

}  // namespace

std::vector<KernelPoint> random_points(const SystemInfo& info, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<KernelPoint> points(5);
  for (KernelPoint& point : points) {
    for (std::size_t k = 0; k < info.parameters.size(); ++k) {
      const double usual = info.parameter_defaults[k];
      const double size = std::isfinite(usual) && usual != 0 ? usual : info.is_positive[k] ? 1 : 0.1;
      for (int i = 0; i < info.parameter_sizes[k]; ++i) point.parameters.push_back(size * uniform(0.5, 2));
    }
    for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
      point.q.push_back(uniform(0.3, 2.8));  // away from the poles of (θ, φ)
      point.v.push_back(uniform(-2, 2));
      point.a.push_back(uniform(-2, 2));
    }
    for (std::size_t k = 0; k < info.inputs.size(); ++k) point.inputs.push_back(uniform(-1, 1));
  }
  return points;
}

double width_error(const SystemTable& table, std::span<const KernelPoint> points) {
  return points.empty() ? 0 : Widths(table, points).error();
}

namespace {

using Rows = std::vector<double, detail::PackAllocator<double>>;

constexpr std::size_t order = 10;
constexpr double share = 0.05;  // of the radius of convergence: terms beyond the order are below 1e-11
constexpr int nearer = 3;       // times, each an eighth of the last: the nearest comes before any narrow force ahead

/// The series of W motions from points.
template <std::size_t W>
class Series {
 public:
  Series(const SystemTable& table, std::span<const KernelPoint> points, std::size_t first)
      : table_(table),
        points_(points),
        first_(first),
        n_(table.info.coordinates.size()),
        row_(series_state_row(n_, W)),
        state_((order + 2) * row_) {
    const SeriesInfo& info = table.info.series;
    const std::size_t inputs = points[0].inputs.size();
    Rows parameters((points[0].parameters.size() + 1) * W), times(W), pushes((order + 1) * (inputs + 1) * W);
    Rows unit(W), kept((static_cast<std::size_t>(info.kept) + 1) * W);
    Rows operands((order + 1) * (series_operand_row(info, W) + W));
    Rows q(n_ * W), v(n_ * W);
    for (std::size_t lane = 0; lane < W; ++lane) {
      const KernelPoint& point = at(lane);
      const auto put = [&](std::span<const double> from, Rows& to) {
        for (std::size_t k = 0; k < from.size(); ++k) to[k * W + lane] = from[k];
      };
      put(point.parameters, parameters);
      put(point.inputs, pushes);
      put(point.q, q);
      put(point.v, v);
      times[lane] = point.time;
      unit[lane] = 1;
    }
    const auto& functions = functions_of<static_cast<int>(W)>(table);
    const Conditions there{table.context, parameters.data(), times.data(), pushes.data()};
    std::ranges::copy(q, state_.begin());
    std::ranges::copy(v, state_.begin() + static_cast<std::ptrdiff_t>(n_ * W));
    if (info.has_momenta) functions.momentum_from_velocity(there, q.data(), v.data(), state_.data() + n_ * W);
    const SeriesRows rows{unit.data(), state_.data(), kept.data(), operands.data()};
    functions.series_start(there, rows);
    functions.series_next(there, rows, 1, order);
  }

  /// The error of the motion in a lane: the smallest of those at several times; NaN if none is a number.
  double error(std::size_t lane) const {
    double radius = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n_; ++i) {
      const double size = std::max(1.0, std::abs(coefficient(0, i, lane)));
      for (std::size_t k = order - 3; k <= order + 1; ++k) {
        const double term = std::abs(coefficient(k, i, lane)) / size;
        if (term > 0) radius = std::min(radius, std::pow(term, -1 / static_cast<double>(k)));
      }
    }
    if (std::isinf(radius)) radius = 1;  // all terms are zero: nothing acts
    double least = std::numeric_limits<double>::quiet_NaN(), time = share * radius;
    for (int k = 0; k < nearer; ++k, time /= 8) least = std::fmin(least, error(lane, time, radius));
    return least;
  }

 private:
  double error(std::size_t lane, double time, double radius) const {
    std::vector<double> q(n_), v(n_), a(n_), found(n_);
    double speed = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t k = order + 2; k-- > 0;) {
        const auto whole = static_cast<double>(k);
        q[i] = q[i] * time + coefficient(k, i, lane);
        if (k > 0) v[i] = v[i] * time + whole * coefficient(k, i, lane);
        if (k > 1) a[i] = a[i] * time + whole * (whole - 1) * coefficient(k, i, lane);
      }
      speed = std::max(speed, std::abs(v[i]));
    }
    const KernelPoint& point = at(lane);
    const double now = point.time + time;
    const Conditions there{table_.context, point.parameters.data(), &now, point.inputs.data()};
    table_.of_1.acceleration(there, q.data(), v.data(), found.data());
    double off = 0, size = speed / radius;
    for (std::size_t i = 0; i < n_; ++i) {
      off = std::max(off, std::abs(found[i] - a[i]));
      size = std::max(size, std::abs(found[i]));
      if (!std::isfinite(found[i] - a[i])) return std::numeric_limits<double>::quiet_NaN();
    }
    return size > 0 ? off / size : 0;
  }

  const KernelPoint& at(std::size_t lane) const { return points_[(first_ + lane) % points_.size()]; }
  double coefficient(std::size_t k, std::size_t i, std::size_t lane) const { return state_[k * row_ + i * W + lane]; }

  const SystemTable& table_;
  std::span<const KernelPoint> points_;
  std::size_t first_, n_, row_;
  Rows state_;
};

template <std::size_t W>
double error_of(const SystemTable& table, std::span<const KernelPoint> points) {
  std::vector<double> errors;
  for (std::size_t first = 0; first < points.size(); first += W) {
    const Series<W> series(table, points, first);
    for (std::size_t lane = 0; lane < W; ++lane) {
      const double error = series.error(lane);
      if (!std::isnan(error)) errors.push_back(error);
    }
  }
  if (errors.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto place = errors.begin() + static_cast<std::ptrdiff_t>(9 * (errors.size() - 1) / 10);
  std::ranges::nth_element(errors, place);
  return *place;
}

}  // namespace

double series_error(const SystemTable& table, std::span<const KernelPoint> points) {
  if (table.of_1.series_next == nullptr || points.empty()) return 0;
  return std::max(
      {error_of<1>(table, points), error_of<2>(table, points), error_of<4>(table, points), error_of<8>(table, points)});
}

}  // namespace pendula
