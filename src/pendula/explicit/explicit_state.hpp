#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <type_traits>

namespace pendula {

/// The state of explicit methods, for one motion or for several members, one in each lane: parts, their rates and the
/// time, with or without a tangent of each member. For one motion, sums are kept in twice the digits, so that many
/// small steps do not add up rounding errors. `Dynamics` is ChainAccelerations or SystemAccelerations.
template <class Dynamics>
class ExplicitState {
 public:
  using SpaceType = typename Dynamics::SpaceType;
  using L = typename Dynamics::L;
  using Mask = MaskOf<L>;
  static constexpr int links_known = Dynamics::links_known;
  static constexpr bool is_implicit = false, has_tangent = Dynamics::has_tangent, is_twofold = !is_batch<L>;
  static constexpr std::size_t D = Dynamics::D;
  using Vector = std::array<L, D>;

  /// Number of parts: links of a chain, coordinates of a system.
  int count() const { return dynamics_.parts(); }
  const auto& parts() const { return parts_; }

  auto heading(int lane, int i) const { return dynamics_.heading(lane, i, parts_); }
  /// Position and rate of a part, with their low parts.
  auto exact_place(int i) const requires is_twofold { return exact(parts_[i].place, low_[i].place); }
  auto exact_rate(int i) const requires is_twofold { return exact(parts_[i].rate, low_[i].rate); }
  void find_rates() const {}
  decltype(auto) along(int i) const { return detail::values_of(parts_[i].place); }

  /// Calls visit(i, ξ̇_i, …) for all rods.
  template <class Visit>
  void for_each_rate(Visit visit) const {
    for (int i = 0; i < count(); ++i) visit(i, detail::values_of(parts_[i].rate), L(0.0));
  }

  L energy() { return dynamics_.energy(now_, parts_); }
  const L& energy_sum() const requires requires(const Dynamics& dynamics) { dynamics.energy_sum(); }
  { return dynamics_.energy_sum(); }
  L pace_squared() const { return dynamics_.pace_squared(parts_); }

 protected:
  using Number = typename Dynamics::Number;
  using Part = typename Dynamics::Part;
  using Parts = typename Dynamics::Parts;

  static constexpr double largest_turn = 3;  // per step  [rad]

  explicit ExplicitState(typename Dynamics::Subject subject)
      : dynamics_(subject), parts_(dynamics_.parts()), low_(parts_) {
    for (int i = 0; i < count(); ++i) parts_[i] = Dynamics::resting();
    if constexpr (is_twofold) {
      for (int i = 0; i < count(); ++i) low_[i] = Part::zero();
    }
  }

  /// Starts a member in a lane: ChainAccelerations::start.
  template <class... Start>
  void seat(int lane, double time, const Start&... start) {
    if constexpr (is_twofold) {
      dynamics_.start(lane, time, start..., parts_, low_);
    } else {
      dynamics_.start(lane, time, start..., parts_);
    }
    set(now_, lane, time);
  }

  template <class Links>
  static auto& at(Links& of, int link) {
    return Dynamics::at(of, link);
  }

  /// Low parts of members: none.
  struct NoParts {
    explicit NoParts(const Parts& /*parts*/) {}
  };
  using LowParts = std::conditional_t<is_twofold, Parts, NoParts>;

  /// Moves all parts from the state by h moved(i), and restores the lengths of rods.
  template <class Moved>
  [[gnu::always_inline]] void arrive(const L& h, Moved moved, Parts& there, LowParts& low) {
    dynamics_.for_parts([&](auto i) PENDULA_WRITTEN_OUT {
      const Part by = moved(i), &from = at(parts_, i);
      Part& to = at(there, i);
      for (std::size_t k = 0; k < D; ++k) {
        if constexpr (is_twofold) {
          const Part& rest = at(low_, i);
          const Twofold<L> place = exact_sum(from.place[k], fma(h, by.place[k], rest.place[k]));
          const Twofold<L> rate = exact_sum(from.rate[k], fma(h, by.rate[k], rest.rate[k]));
          to.place[k] = place.value;
          to.rate[k] = rate.value;
          at(low, i).place[k] = place.low;
          at(low, i).rate[k] = rate.low;
        } else {
          to.place[k] = fma(h, by.place[k], from.place[k]);
          to.rate[k] = fma(h, by.rate[k], from.rate[k]);
        }
      }
    });
    if constexpr (is_twofold) {
      dynamics_.restore(there, low);
    } else {
      dynamics_.restore(there);
    }
  }

  static void assign(const Mask& which, const Part& from, Part& to) {
    for (std::size_t k = 0; k < D; ++k) {
      to.place[k] = select(which, from.place[k], to.place[k]);
      to.rate[k] = select(which, from.rate[k], to.rate[k]);
    }
  }

  /// The first part of one motion that is not finite; −1: none.
  int not_finite(const Parts& parts) const requires is_twofold {
    for (int i = 0; i < count(); ++i) {
      for (std::size_t k = 0; k < D; ++k) {
        if (!std::isfinite(parts[i].place[k]) || !std::isfinite(parts[i].rate[k])) return i;
      }
    }
    return -1;
  }

  /// Factor that scales the tangents of these members to length 1; 1 for the others.
  static L to_unit_length(const Mask& which, const L& squared) { return select(which, L(1.0) / sqrt(squared), L(1.0)); }
  static void scale_tangent(const L& factor, Part& part) {
    for (std::size_t k = 0; k < D; ++k) {
      part.place[k].slope = factor * part.place[k].slope;
      part.rate[k].slope = factor * part.rate[k].slope;
    }
  }

  Dynamics dynamics_;
  L now_{0.0};
  Parts parts_;
  [[no_unique_address]] LowParts low_;  // rounding errors of parts

 private:
  static auto exact(const Vector& value, const Vector& low) {
    std::array<LongReal, D> sum;
    for (std::size_t k = 0; k < D; ++k) sum[k] = static_cast<LongReal>(value[k]) + low[k];
    return sum;
  }
};

}  // namespace pendula
