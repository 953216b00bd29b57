#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace pendula {

/// How far a sine may turn in a step so that a quadrature still integrates it. With n nodes the error is a constant
/// times a power of the turn: n!⁴/((2n + 1) (2n)!³) and the power 2n for Gauss, n (n − 1)!⁴/(2 (2n − 1)!³) and 2n − 1
/// for Radau.
class SineTurn {
 public:
  /// `order` of the quadrature: 2n or 2n − 1 for n nodes.
  SineTurn(int nodes, int order) : nodes_(nodes), order_(order), constant_(error_constant(nodes, order)) {}

  /// The largest turn whose error is within the tolerance, at most one radian per node  [rad].
  double within(double tolerance) const {
    return std::min(static_cast<double>(nodes_), std::pow(tolerance / constant_, 1.0 / order_));
  }

 private:
  static double error_constant(int n, int order) {
    const double all = std::tgamma(order + 1);
    if (order == 2 * n) return std::pow(std::tgamma(n + 1), 4) / ((order + 1) * all * all * all);
    return n * std::pow(std::tgamma(n), 4) / (2 * all * all * all);
  }

  int nodes_, order_;
  double constant_;
};

/// Limits a step so that its nodes resolve forces that depend on time: no error estimate shows a pulse between the
/// nodes, or forces that oscillate many times in the step.
///
/// The accelerations of a fixed state are integrated over the step by a quadrature, and again with the step divided
/// into many parts. The step is halved until both agree. This header does not use Eigen, because both the library's
/// copies for each instruction set and programs compiled with other flags use it.
class ForcingLook {
 public:
  /// `nodes` and `weights` of a quadrature on (0, 1); `coordinates` of the system.
  ForcingLook(std::span<const double> nodes, std::span<const double> weights, std::size_t coordinates)
      : nodes_(nodes.begin(), nodes.end()),
        weights_(weights.begin(), weights.end()),
        coarse_(coordinates),
        fine_(coordinates),
        speeds_(coordinates),
        least_speeds_(coordinates) {}

  /// Returns the longest of h, h/2, h/4 … from `time` on in which forces are resolved to a tolerance. Errors are
  /// relative to the largest of the rates v, of what forces make of them, and of a speed whose effect is below
  /// rounding: `sizes`, how far each coordinate goes while the motion changes, times `pace`, the inverse of that time.
  /// accelerations(times, found) writes those of the fixed state, (times, coordinates). Pulses shorter than a hundredth
  /// of 1/pace, and of h/8, may be missed.
  template <class Rates, class Sizes, class Accelerations>
  double resolved(double time, double h, double pace, double tolerance, const Rates& v, const Sizes& sizes,
                  Accelerations&& accelerations) {
    h = std::min(h, most_parts * static_cast<double>(nodes_.size()) / (looks * pace));
    const double least = std::max(smallest * std::max(std::abs(time), h), finest / pace);
    for (std::size_t k = 0; k < speeds_.size(); ++k) {
      least_speeds_[k] = rounding * pace * at(sizes, k);
      speeds_[k] = std::max(std::abs(at(v, k)), least_speeds_[k]);
    }
    while (h > least && !is_seen(time, h, pace, tolerance, accelerations)) h /= 2;
    return h;
  }

  /// Factor on the tolerance for a step in which the motion advances by `moved`, a fraction of the time in which it
  /// changes.
  template <class Number>
  static Number share_of(const Number& moved) {
    using std::max, std::min;
    return min(max(moved, Number(shortest)), Number(1.0));
  }

  static constexpr double looks = 100;  ///< samples in the time in which the motion changes
  /// Shortest step, as a fraction of the time in which the motion changes; what is shorter is left to the error
  /// estimate of the step. Forces that are not smooth on that scale jump, or are mere differences of large numbers,
  /// such as 1 + tanh(t) long before t = 0.
  static constexpr double finest = 1e-3;
  static constexpr int least_parts = 8;      ///< a step is divided into at least so many
  static constexpr double invisible = 1e-3;  ///< fraction of a rounding error: forces are rounded by as much themselves
  static constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();  ///< relative, of sums and times
  static constexpr double negligible = 1e-280;  ///< speed; smaller numbers lose digits

 private:
  // Integrals of the accelerations over a step.
  struct Sums {
    explicit Sums(std::size_t coordinates)
        : push(coordinates), size(coordinates), change(coordinates), last(coordinates) {}
    std::vector<double> push, size;    // ∫ a dt, ∫ |a| dt
    std::vector<double> change, last;  // total variation of a, and its last value

    void clear() {
      for (std::vector<double>* sums : {&push, &size, &change}) std::fill(sums->begin(), sums->end(), 0.0);
    }
  };

  template <class Numbers>
  static double at(const Numbers& numbers, std::size_t k) {
    return numbers.data()[k];
  }

  template <class Accelerations>
  bool is_seen(double time, double h, double pace, double tolerance, Accelerations& accelerations) {
    sum(time, h, 1, accelerations, coarse_);
    const double share = share_of(h * pace);
    const double parts = std::ceil(
        std::clamp(looks * h * pace / static_cast<double>(nodes_.size()), double(least_parts), double(most_parts)));
    sum(time, h, static_cast<int>(parts), accelerations, fine_);
    for (std::size_t k = 0; k < fine_.push.size(); ++k) {
      const double size = std::max({speeds_[k], fine_.size[k], negligible});
      const double of_times = (std::abs(time) + h) * fine_.change[k];
      const double unknown = invisible * least_speeds_[k] + rounding * (of_times + fine_.size[k]);
      if (std::abs(coarse_.push[k] - fine_.push[k]) > tolerance * share * size + unknown) return false;
    }
    return true;
  }

  template <class Accelerations>
  void sum(double time, double h, int parts, Accelerations& accelerations, Sums& sums) {
    const double part = h / parts;
    times_.clear();
    for (int p = 0; p < parts; ++p) {
      for (const double node : nodes_) times_.push_back(time + (p + node) * part);
    }
    const std::size_t count = sums.push.size();
    found_.resize(times_.size() * count);
    accelerations(std::span<const double>(times_), found_.data());
    sums.clear();
    for (std::size_t i = 0; i < times_.size(); ++i) {
      const double weight = weights_[i % weights_.size()] * part;
      for (std::size_t k = 0; k < count; ++k) {
        const double a = found_[i * count + k];
        sums.push[k] += weight * a;
        sums.size[k] += weight * std::abs(a);
        if (i > 0) sums.change[k] += std::abs(a - sums.last[k]);
        sums.last[k] = a;
      }
    }
  }

  static constexpr double most_parts = 4096;
  static constexpr double smallest = 1e-13;  // step, relative to the time so far
  static constexpr double shortest = 1e-3;   // least share_of: no step resolves a jump of the forces

  std::vector<double> nodes_, weights_;
  Sums coarse_, fine_;
  std::vector<double> speeds_, least_speeds_;  // errors are relative to these speeds; lower bounds of them
  std::vector<double> times_, found_;
};

}  // namespace pendula
