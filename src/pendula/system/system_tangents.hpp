#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/member_systems.hpp>
#include <random>
#include <vector>

namespace pendula {

/// Initial tangents of systems in lanes, and their norm: Σ (δq/size)² + (δq̇/(size ω))². The size is 1 for angles, for
/// other coordinates the largest initial one of the same unit; ω is the initial rate of change of the motion.
template <class L>
class SystemTangents {
 public:
  /// `dynamics` must outlive this object.
  explicit SystemTangents(MemberSystems<L>& dynamics)
      : dynamics_(dynamics),
        rows_(static_cast<std::size_t>(kinds * count()) + 1),
        inverse_sizes_(static_cast<std::size_t>(count()), L(1.0)) {}

  /// δq and δq̇ of one lane.
  struct Tangent {
    std::vector<double> place, rate;
  };

  /// A tangent of length 1 for the member at q and v in a lane, from the same random numbers for all members. For a
  /// member at rest ω follows from the accelerations along the tangent: a frequency, or a rate of damping.
  Tangent start(int lane, double time, const double* q, const double* v) {
    std::vector<double> sizes, drawn;
    std::mt19937 random(1);
    for (int i = 0; i < count(); ++i) sizes.push_back(size_at(i, q));
    for (int i = 0; i < 2 * count(); ++i) {
      drawn.push_back(static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5);
    }
    const auto tangent = [&](double place, double rate) {
      Tangent found;
      for (std::size_t k = 0; k < sizes.size(); ++k) {
        found.place.push_back(place * sizes[k] * drawn[k]);
        found.rate.push_back(rate * sizes[k] * drawn[k + sizes.size()]);
      }
      return found;
    };
    const auto largest = [&](const std::vector<double>& of) {
      double found = 0;
      for (std::size_t k = 0; k < sizes.size(); ++k) found = std::max(found, std::abs(of[k]) / sizes[k]);
      return found;
    };
    const double turning = largest(std::vector<double>(v, v + count()));
    const Tangent moved = tangent(1, 0), sped = tangent(0, 1);
    const double swing = largest(pushed(lane, time, q, v, moved)) / largest(moved.place);
    const double loss = largest(pushed(lane, time, q, v, sped)) / largest(sped.rate);
    double squared = std::max({turning * turning, swing, loss * loss});
    if (!(squared > 0) || !std::isfinite(squared)) squared = 1;
    inverse_pace_squared_.set(lane, 1 / squared);
    double length = 0;
    for (std::size_t k = 0; k < sizes.size(); ++k) {
      inverse_sizes_[k].set(lane, 1 / sizes[k]);
      length += drawn[k] * drawn[k] + drawn[k + sizes.size()] * drawn[k + sizes.size()];
    }
    length = std::sqrt(length);
    return tangent(1 / length, std::sqrt(squared) / length);
  }

  /// Squared norm of a tangent; place(i) = δq_i, rate(i) = δq̇_i.
  template <class Place, class Rate>
  L squared(Place place, Rate rate) const {
    L squared(0.0);
    for (int i = 0; i < count(); ++i) {
      const L along = inverse_size(i) * place(i), across = inverse_size(i) * rate(i);
      squared = fma(along, along, fma(inverse_pace_squared_ * across, across, squared));
    }
    return squared;
  }

  const L& inverse_size(int i) const { return inverse_sizes_[static_cast<std::size_t>(i)]; }
  const L& inverse_pace_squared() const { return inverse_pace_squared_; }  ///< 1/ω²

 private:
  // Kinds of rows: q, q̇, δq, δq̇, q̈, δq̈; one row more for times.
  static constexpr int kinds = 6;

  int count() const { return dynamics_.coordinates(); }
  double* numbers(int which, int i) { return rows_[which * count() + i]; }

  double size_at(int i, const double* q) const {
    if (dynamics_.is_angle(i)) return 1;
    double size = 0;
    for (int j = 0; j < count(); ++j) {
      if (dynamics_.of_one_unit(i, j)) size = std::max(size, std::abs(q[j]));
    }
    return size > 0 ? size : 1;
  }

  // δq̈ along a tangent.
  std::vector<double> pushed(int lane, double time, const double* q, const double* v, const Tangent& tangent) {
    double* const times = numbers(kinds, 0);
    L(time).store(times);
    for (int i = 0; i < count(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      L(q[i]).store(numbers(0, i));
      L(v[i]).store(numbers(1, i));
      L(tangent.place[k]).store(numbers(2, i));
      L(tangent.rate[k]).store(numbers(3, i));
    }
    dynamics_.call(times, &SystemFunctions::acceleration_along, numbers(0, 0), numbers(1, 0), numbers(2, 0),
                   numbers(3, 0), numbers(4, 0), numbers(5, 0));
    std::vector<double> found(tangent.rate.size());
    for (int i = 0; i < count(); ++i) found[static_cast<std::size_t>(i)] = numbers(5, i)[lane];
    return found;
  }

  MemberSystems<L>& dynamics_;
  PackRows<L::width> rows_;
  std::vector<L> inverse_sizes_;
  L inverse_pace_squared_{1.0};
};

}  // namespace pendula
