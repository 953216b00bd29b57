#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/explicit/forward_dynamics.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <vector>

namespace pendula {

/// What a step of an explicit method does not see of the field between its stages.
class FieldSteps {
 public:
  /// For a method that is as good as a quadrature of so many nodes.
  FieldSteps(int nodes, const ForwardDynamics& dynamics, std::size_t coordinates)
      : look_(nodes, dynamics.arguments()),
        arguments_(dynamics.arguments().size()),
        path_(coordinates),
        place_(coordinates),
        rate_(coordinates),
        sums_(coordinates),
        missed_(coordinates) {}

  bool has_to_look() const { return look_.has_to_look(); }

  /// Along each coordinate k, relative to size(k); the largest. The path from x = (q, q̇) to `end` is the quintic
  /// through both, their rates and accelerations.
  template <class Size>
  Unseen unseen(ForwardDynamics& dynamics, double time, double h, const std::vector<double>& x,
                const std::vector<double>& rate, const std::vector<double>& end, const std::vector<double>& end_rate,
                Size&& size) {
    lay_path(h, x, rate, end, end_rate);
    const auto arguments = [&](std::span<const double> shares, double* found) {
      for (std::size_t i = 0; i < shares.size(); ++i) {
        go_to(shares[i], h);
        dynamics.find_arguments(time + shares[i] * h, place_.data(), rate_.data(), found + i * arguments_);
      }
    };
    if (!look_.finds(arguments)) return {};
    const auto accelerations = [&](std::span<const double> shares, double* found) {
      for (std::size_t i = 0; i < shares.size(); ++i) {
        go_to(shares[i], h);
        dynamics.acceleration(time + shares[i] * h, place_.data(), rate_.data(), found + i * path_.size());
      }
    };
    look_.sum(accelerations, sums_, missed_);
    Unseen most;
    const auto raise = [](double& largest, double number) {
      if (!(number <= largest)) largest = number;
    };
    for (std::size_t k = 0; k < path_.size(); ++k) {
      const double gained = end[path_.size() + k] - x[path_.size() + k], impulse = h * missed_[k] / size(k);
      raise(most.impulse, impulse);
      raise(most.effect, std::abs(h * sums_[k] - gained) / size(k) + Unseen::of_impulse(impulse));
    }
    return most;
  }

 private:
  void lay_path(double h, const std::vector<double>& x, const std::vector<double>& rate, const std::vector<double>& end,
                const std::vector<double>& end_rate) {
    const std::size_t count = path_.size();
    for (std::size_t k = 0; k < count; ++k) {
      const double v = h * x[count + k], a = h * h * rate[count + k];
      const double moved = end[k] - x[k] - v - a / 2, gained = h * end[count + k] - v - a;
      const double turned = h * h * end_rate[count + k] - a;
      path_[k] = {x[k],
                  v,
                  a / 2,
                  10 * moved - 4 * gained + turned / 2,
                  -15 * moved + 7 * gained - turned,
                  6 * moved - 3 * gained + turned / 2};
    }
  }

  void go_to(double share, double h) {
    for (std::size_t k = 0; k < path_.size(); ++k) {
      const auto& c = path_[k];
      place_[k] = c[0] + share * (c[1] + share * (c[2] + share * (c[3] + share * (c[4] + share * c[5]))));
      rate_[k] = (c[1] + share * (2 * c[2] + share * (3 * c[3] + share * (4 * c[4] + share * 5 * c[5])))) / h;
    }
  }

  FieldLook look_;
  std::size_t arguments_;
  std::vector<std::array<double, 6>> path_;  // coefficients of powers of the share
  std::vector<double> place_, rate_, sums_, missed_;
};

}  // namespace pendula
