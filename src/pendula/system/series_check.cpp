#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/series_check.hpp>
#include <pendula/system/series_info.hpp>
#include <vector>

namespace pendula {
namespace {

using Rows = std::vector<double, detail::PackAllocator<double>>;

constexpr std::size_t order = 10;
constexpr double share = 0.05;  // of the radius of convergence: terms beyond the order are below 1e-11
constexpr int nearer = 3;       // times, each an eighth of the one before: what is narrow and ahead is not met at all

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

  /// Of the motion in a lane, the smallest of several times; NaN where it has no numbers.
  double error(std::size_t lane) const {
    double radius = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n_; ++i) {
      const double size = std::max(1.0, std::abs(coefficient(0, i, lane)));
      for (std::size_t k = order - 3; k <= order + 1; ++k) {
        const double term = std::abs(coefficient(k, i, lane)) / size;
        if (term > 0) radius = std::min(radius, std::pow(term, -1 / static_cast<double>(k)));
      }
    }
    if (std::isinf(radius)) radius = 1;  // where nothing but the start moves it
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
