#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace pendula {

/// How far a sine may turn in a step for a quadrature to sum it up. Of n nodes, its error is a constant times a power
/// of the turn: n!⁴/((2n + 1) (2n)!³) and 2n of Gauss's, n (n − 1)!⁴/(2 (2n − 1)!³) and 2n − 1 of Radau's.
class SineTurn {
 public:
  /// Of a quadrature of this order, 2n or 2n − 1.
  SineTurn(int nodes, int order) : nodes_(nodes), order_(order), constant_(error_constant(nodes, order)) {}

  /// The most that its error is within the tolerance by, but no more than a radian a node  [rad].
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

/// How far a step may go so that its nodes see what forces do that depend on time: a pulse between them, or what turns
/// many times in the step, no error estimate shows.
///
/// Accelerations of a state that stands still are summed over the step by the nodes of a quadrature, and again by the
/// same nodes in many parts of it. Steps are halved until both agree. Nothing of Eigen, because explicit methods, which
/// are compiled for any processor, and programs that are not, have the same.
class ForcingLook {
 public:
  /// By a quadrature of these nodes and weights on (0, 1), of a system of so many coordinates.
  ForcingLook(std::span<const double> nodes, std::span<const double> weights, std::size_t coordinates)
      : nodes_(nodes.begin(), nodes.end()),
        weights_(weights.begin(), weights.end()),
        coarse_(coordinates),
        fine_(coordinates),
        speeds_(coordinates),
        least_speeds_(coordinates) {}

  /// The longest of h, h/2, h/4 … from `time` on in which forces are seen to a tolerance, relative to rates v, to what
  /// forces make of them, and to what would round a coordinate by that goes `sizes` in the time in which the motion
  /// changes, 1/pace; accelerations(times, found) are those of the state, (times, coordinates).
  /// What lasts for less than a hundredth of that time, and of h/8, may be missed.
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

  /// Of a tolerance, for a step in which the motion goes on by so much.
  template <class Number>
  static Number share_of(const Number& moved) {
    using std::max, std::min;
    return min(max(moved, Number(shortest)), Number(1.0));
  }

  static constexpr double looks = 100;  ///< in the time in which motion changes
  /// In that time: shorter steps than this are left to the error of the step. What does not look smooth then jumps, or
  /// is nothing but differences of large numbers, as 1 + tanh(t) is long before 0.
  static constexpr double finest = 1e-3;
  static constexpr int least_parts = 8;      ///< of a step
  static constexpr double invisible = 1e-3;  ///< of a rounding error: what forces are rounded by themselves
  static constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();  ///< of sums, and of times
  static constexpr double negligible = 1e-280;  ///< speed: smaller numbers lose digits

 private:
  // What accelerations are summed to.
  struct Sums {
    explicit Sums(std::size_t coordinates)
        : push(coordinates), size(coordinates), change(coordinates), last(coordinates) {}
    std::vector<double> push, size;    // ∫ a dt, ∫ |a| dt
    std::vector<double> change, last;  // by how much they went up and down, and where from

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
  static constexpr double smallest = 1e-13;  // step, of the time so far
  static constexpr double shortest = 1e-3;   // where forces jump, no step is short enough to see that they do

  std::vector<double> nodes_, weights_;
  Sums coarse_, fine_;
  std::vector<double> speeds_, least_speeds_;  // that errors are compared with, at least
  std::vector<double> times_, found_;
};

}  // namespace pendula
