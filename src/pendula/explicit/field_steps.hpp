#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/explicit/system_forward_dynamics.hpp>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/system/field_look.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Measures what a step of an explicit method misses of the forces between its stages.
class FieldSteps {
 public:
  /// `nodes`: those of a Gauss quadrature as accurate as the method. `is_blind`: the error estimate of the method
  /// misses forces that only one stage meets.
  FieldSteps(int nodes, const SystemForwardDynamics& dynamics, std::size_t coordinates, bool is_blind = false)
      : look_(nodes, few_samples, dynamics.arguments()),
        is_blind_(is_blind),
        path_(coordinates),
        begin_(2 * coordinates),
        end_(2 * coordinates),
        place_(coordinates),
        rate_(coordinates),
        sums_(coordinates),
        moments_(coordinates),
        missed_(coordinates),
        times_(1),
        places_(coordinates),
        rates_(coordinates),
        arguments_(dynamics.arguments().size()) {}

  /// The speed of a coordinate counts as at least this fraction of the fastest.
  static constexpr double beside = 1e-3;

  bool has_to_look() const { return look_.has_to_look(); }

  /// forget(): the next step begins at an unknown state. move_on(): it begins where the last examined step ended.
  void forget() { begin_is_known_ = false; }
  void move_on() {
    begin_.swap(end_);
    begin_is_known_ = end_is_known_;
  }

  /// What a step misses, the largest over the coordinates k, relative to size_of(rate at x)(k). The path from x = (q,
  /// q̇) to `end` is the quintic through both states with their accelerations.
  template <class SizeOf>
  Unseen unseen(SystemForwardDynamics& dynamics, double time, double h, const std::vector<double>& x,
                const std::vector<double>& end, SizeOf&& size_of) {
    const auto arguments = [&](std::span<const double> shares, double* found) {
      find_arguments(dynamics, time, h, shares, found);
    };
    fit_cubic(h, x, end);
    const bool may_find = look_.may_find(arguments);
    if (!may_find && !is_blind_) {
      end_is_known_ = false;
      return {};
    }
    fit_quintic(dynamics, time, h, x, end);
    const auto size = size_of(begin_);
    const auto accelerations = [&](std::span<const double> shares, double* found) {
      for (std::size_t i = 0; i < shares.size(); ++i) {
        go_to(shares[i], h);
        dynamics.acceleration(time + shares[i] * h, place_.data(), rate_.data(), found + i * path_.size());
      }
    };
    if (may_find && look_.finds(arguments)) {
      look_.sum(accelerations, {sums_, moments_, missed_});
    } else if (is_blind_) {
      sum_by_few_nodes(accelerations);
    } else {
      return {};
    }
    Unseen most;
    const auto raise = [](double& largest, double number) {
      if (!(number <= largest)) largest = number;
    };
    for (std::size_t k = 0; k < path_.size(); ++k) {
      const double before = x[path_.size() + k], after = end[path_.size() + k],
                   here = std::max(std::abs(before), std::abs(after));
      const double lacks = std::abs(h * sums_[k] - (after - before)) / size(k), missed = h * missed_[k];
      raise(most.impulse, is_blind_ ? std::max(missed / size(k), lacks / path_error) : missed / size(k));
      raise(most.effect, lacks + (missed > 0 ? Unseen::of_wall(missed / std::max(here, beside * size(k))) : 0));
    }
    return most;
  }

 private:
  // Path by the cubic through both ends.
  void fit_cubic(double h, const std::vector<double>& x, const std::vector<double>& end) {
    const std::size_t count = path_.size();
    for (std::size_t k = 0; k < count; ++k) {
      const double v = h * x[count + k], after = h * end[count + k], moved = end[k] - x[k];
      path_[k] = {x[k], v, 3 * moved - 2 * v - after, v + after - 2 * moved, 0, 0};
    }
  }

  void fit_quintic(SystemForwardDynamics& dynamics, double time, double h, const std::vector<double>& x,
                   const std::vector<double>& end) {
    const std::size_t count = path_.size();
    if (!begin_is_known_) dynamics.acceleration(time, x.data(), x.data() + count, begin_.data() + count);
    begin_is_known_ = end_is_known_ = true;
    dynamics.acceleration(time + h, end.data(), end.data() + count, end_.data() + count);
    for (std::size_t k = 0; k < count; ++k) {
      const double v = h * x[count + k], a = h * h * begin_[count + k];
      const double moved = end[k] - x[k] - v - a / 2, gained = h * end[count + k] - v - a;
      const double turned = h * h * end_[count + k] - a;
      path_[k] = {x[k],
                  v,
                  a / 2,
                  10 * moved - 4 * gained + turned / 2,
                  -15 * moved + 7 * gained - turned,
                  6 * moved - 3 * gained + turned / 2};
    }
  }

  using Powers = std::array<double, 6>;
  template <class Share>
  static Share place_at(const Powers& c, const Share& share) {
    Share sum(c[5]);
    for (std::size_t power = 5; power-- > 0;) sum = sum * share + Share(c[power]);
    return sum;
  }
  template <class Share>
  static Share rate_at(const Powers& c, const Share& share) {
    Share sum(5 * c[5]);
    for (std::size_t power = 5; power-- > 1;) sum = sum * share + Share(static_cast<double>(power) * c[power]);
    return sum;
  }

  void go_to(double share, double h) {
    for (std::size_t k = 0; k < path_.size(); ++k) {
      place_[k] = place_at(path_[k], share);
      rate_[k] = rate_at(path_[k], share) / h;
    }
  }

  // Lanes beyond the last share repeat it.
  void find_arguments(SystemForwardDynamics& dynamics, double time, double h, std::span<const double> shares,
                      double* found) {
    const std::size_t count = path_.size(), arguments = dynamics.arguments().size();
    for (std::size_t first = 0; first < shares.size(); first += width) {
      const std::size_t here = std::min(width, shares.size() - first);
      for (std::size_t lane = 0; lane < width; ++lane) times_[0][lane] = shares[first + std::min(lane, here - 1)];
      const Lanes share = Lanes::load(times_[0]);
      for (std::size_t k = 0; k < count; ++k) {
        place_at(path_[k], share).store(places_[k]);
        (rate_at(path_[k], share) / Lanes(h)).store(rates_[k]);
      }
      fma(share, Lanes(h), Lanes(time)).store(times_[0]);
      dynamics.find_arguments(times_[0], places_[0], rates_[0], arguments_[0]);
      for (std::size_t lane = 0; lane < here; ++lane) {
        for (std::size_t a = 0; a < arguments; ++a) found[(first + lane) * arguments + a] = arguments_[a][lane];
      }
    }
  }

  template <class Accelerations>
  void sum_by_few_nodes(Accelerations& accelerations) {
    using Gauss = kernels::GaussTableau<3>;
    found_.resize(Gauss::stages * path_.size());
    accelerations(std::span<const double>(Gauss::c), found_.data());
    std::fill(sums_.begin(), sums_.end(), 0.0);
    std::fill(missed_.begin(), missed_.end(), 0.0);
    for (std::size_t j = 0; j < Gauss::b.size(); ++j) {
      for (std::size_t k = 0; k < path_.size(); ++k) sums_[k] += Gauss::b[j] * found_[j * path_.size() + k];
    }
  }

  static constexpr double path_error = 100;  // error of the quintic over that of the step, roughly
  static constexpr std::size_t width = 8;
  static constexpr int few_samples = width;
  using Lanes = Pack<8, RegisterFor<8>>;

  FieldLook look_;
  bool is_blind_, begin_is_known_ = false, end_is_known_ = false;
  std::vector<Powers> path_;         // coefficients of the powers of share
  std::vector<double> begin_, end_;  // accelerations, in the second half only
  std::vector<double> place_, rate_, sums_, moments_, missed_, found_;
  PackRows<width> times_, places_, rates_, arguments_;  // of eight states
};

}  // namespace pendula
