#pragma once

#include <cmath>
#include <cstddef>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Inputs of several systems, one in each lane: constants and sines of time.
template <class L>
class MemberInputs {
 public:
  explicit MemberInputs(std::size_t count) : constant_(count, L(0.0)) {}

  /// Sets the inputs of a lane; `constant`: (count).
  void take(int lane, const double* constant, std::span<const InputSine> sines) {
    for (L& input : constant_) set(input, lane, *constant++);
    for (Sine& sine : sines_) set(sine.amplitude, lane, 0);
    std::vector<bool> taken(sines_.size());
    for (const InputSine& from : sines) {
      std::size_t k = 0;
      while (k < sines_.size() && (taken[k] || sines_[k].input != from.input)) ++k;
      if (k == sines_.size()) {
        sines_.push_back({from.input});
        taken.push_back(false);
      }
      taken[k] = true;
      set(sines_[k].amplitude, lane, from.amplitude);
      set(sines_[k].frequency, lane, from.frequency);
      set(sines_[k].phase, lane, from.phase);
    }
  }

  /// Highest driving frequency of each member  [rad/s]; 0 without drives.
  L fastest() const {
    L fastest(0.0);
    for (const Sine& sine : sines_) {
      fastest = max(fastest, select(abs(sine.amplitude) > L(0.0), abs(sine.frequency), L(0.0)));
    }
    return fastest;
  }

  /// Writes the inputs at `time`, a row each.
  void at(const L& time, PackRows<width_of<L>>& inputs) const {
    using std::sin;
    for (std::size_t k = 0; k < constant_.size(); ++k) to_row(constant_[k], inputs[k]);
    for (const Sine& sine : sines_) {
      double* const input = inputs[static_cast<std::size_t>(sine.input)];
      to_row(fma(sine.amplitude, sin(fma(sine.frequency, time, sine.phase)), from_row<L>(input)), input);
    }
  }

  /// Writes the coefficients of their Taylor series in (t - time)/unit, order by order: a row of each input.
  void series(const L& time, const L& unit, int order, PackRows<width_of<L>>& coefficients) const {
    using std::sin, std::cos;
    const std::size_t count = constant_.size();
    for (std::size_t k = 0; k < count; ++k) to_row(constant_[k], coefficients[k]);
    for (std::size_t k = count; k < count * static_cast<std::size_t>(order + 1); ++k) to_row(L(0.0), coefficients[k]);
    for (const Sine& sine : sines_) {
      const L angle = fma(sine.frequency, time, sine.phase), turn = sine.frequency * unit;
      L up = sine.amplitude * sin(angle), ahead = sine.amplitude * cos(angle);
      for (int k = 0; k <= order; ++k) {
        double* const input = coefficients[static_cast<std::size_t>(k) * count + static_cast<std::size_t>(sine.input)];
        to_row(from_row<L>(input) + up, input);
        const L share = L(1.0 / (k + 1)) * turn, before = up;
        up = share * ahead;
        ahead = L(0.0) - share * before;
      }
    }
  }

 private:
  // A sine that members add to an input. A member with fewer sines than others has zero amplitudes.
  struct Sine {
    int input;
    L amplitude{0.0}, frequency{0.0}, phase{0.0};
  };

  std::vector<L> constant_;
  std::vector<Sine> sines_;
};

}  // namespace pendula
