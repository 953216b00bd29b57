#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/explicit/error_size.hpp>
#include <pendula/kernels/gauss_tableaux.hpp>
#include <pendula/numeric/lane_pack.hpp>
#include <pendula/numeric/lanes.hpp>
#include <pendula/numeric/numeric.hpp>
#include <pendula/numeric/pack_rows.hpp>
#include <pendula/numeric/tangent_numbers.hpp>
#include <pendula/numeric/width.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/system/moving_part.hpp>
#include <pendula/system/system_tangents.hpp>
#include <type_traits>
#include <vector>

namespace pendula {

/// Forward dynamics of a system, or of several at once, one in each lane, by the accelerations of its kernel.
///
/// With a tangent, every number carries its derivative along one tangent of each member's motion.
template <class Num = LanePack<MemberRegister>, bool with_tangent = false>
class SystemAccelerations {
 public:
  using SpaceType = CoordinateSpace;
  using L = Num;
  using Mask = MaskOf<L>;
  using Number = std::conditional_t<with_tangent, Dual<L>, L>;
  using Subject = MemberSystems<L>&;
  static constexpr int links_known = Eigen::Dynamic;
  static constexpr bool has_tangent = with_tangent;
  static constexpr bool limits_turns = is_batch<L>;  ///< whether steps are limited to less than half a turn
  static constexpr std::size_t D = 1;
  using Part = MovingPart<Number, D>;  ///< q, q̇ of a coordinate
  using Parts = detail::PerLink<Part, links_known>;

  /// `dynamics` must outlive this object.
  explicit SystemAccelerations(MemberSystems<L>& dynamics)
      : dynamics_(dynamics), rows_(static_cast<std::size_t>(kinds * parts()) + 1), tangent_(dynamics) {}
  SystemAccelerations(const SystemAccelerations&) = delete;
  SystemAccelerations& operator=(const SystemAccelerations&) = delete;

  int parts() const { return dynamics_.coordinates(); }
  template <class Body>
  [[gnu::always_inline]] void for_parts(Body body) const {
    for (int i = 0; i < parts(); ++i) body(i);
  }
  template <class All>
  static auto& at(All& of, int part) {
    return of[part];
  }
  static Part resting() { return Part::zero(); }

  /// Starts a member in a lane, with its parameters and inputs, at q and v at `time`; `low` is set to zero.
  template <class... Low>
  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v, Parts& parts,
             Low&... low) {
    for (int i = 0; i < this->parts(); ++i) ((low[i] = Part::zero()), ...);
    dynamics_.take(lane, system);
    for (int i = 0; i < this->parts(); ++i) {
      detail::set_value(lane, q[i], parts[i].place[0]);
      detail::set_value(lane, v[i], parts[i].rate[0]);
    }
    find_accelerations(L(time), parts);
    double squared = 0;
    for (int i = 0; i < this->parts(); ++i) {
      const double size = std::max(1.0, std::abs(q[i]));
      const double fast = v[i] / size, push = std::abs(numbers(2, i)[lane]) / size;
      squared = std::max(squared, fast * fast + push);
    }
    set(pace_squared_, lane, squared);
    if constexpr (has_tangent) start_tangent(lane, time, q, v, parts);
  }

  /// T + U  [J].
  L energy(const L& time, const Parts& parts) {
    write(time, parts);
    alignas(pack_alignment) double kinetic[width_of<L>], total[width_of<L>];
    dynamics_.call(times(), &SystemFunctions::energies, numbers(0, 0), numbers(1, 0), kinetic, total);
    const L T = from_row<L>(kinetic), energy = from_row<L>(total);
    energy_sum_ = abs(T) + abs(energy - T);
    return energy;
  }
  /// |T| + |U| at the last call of energy()  [J].
  const L& energy_sum() const { return energy_sum_; }

  /// The initial rate of change of a member, squared, but at least the square of the fastest angle's rate; NaN if the
  /// state is not finite  [1/s²].
  L pace_squared(const Parts& parts) const {
    L largest = pace_squared_, none(0.0);
    for_parts([&](int i) {
      const L &q = value(parts[i].place[0]), &v = value(parts[i].rate[0]);
      none = none + ((q - q) + (v - v));
      if (dynamics_.is_angle(i)) largest = max(largest, v * v);
    });
    return largest + none;
  }

  /// Squared error of a step of `h`, from the error sums of coordinates and rates. Angles are relative to a radian,
  /// other coordinates to the largest one of the same unit; rates to the fastest one, or to the speed reached by
  /// falling that far.
  L error_squared(const L& h, const Parts& errors, const Parts& before, const Parts& slopes, const Parts& after,
                  const L& /*pace_squared*/) const {
    if constexpr (!is_batch<L>) return error_squared_of_one(h, errors, before, slopes, after);
    L largest(0.0);
    const L size = abs(h);
    for_parts([&](int i) {
      const bool is_angle = dynamics_.is_angle(i);
      L place(is_angle ? 1.0 : 0.0), rate(0.0), push(0.0);
      for_parts([&](int j) {
        if (!dynamics_.of_one_unit(i, j)) return;
        const auto larger = [](const Number& a, const Number& b) { return max(abs(value(a)), abs(value(b))); };
        push = max(push, abs(value(slopes[j].rate[0])));
        rate = max(rate, larger(before[j].rate[0], after[j].rate[0]));
        if (!is_angle) place = max(place, larger(before[j].place[0], after[j].place[0]));
      });
      rate = max(rate, size * push);
      if (!is_angle) place = max(place, size * rate);
      const L fallen = max(rate * rate, push * place);
      const L squared = relative(value(errors[i].place[0]), place * place) + relative(value(errors[i].rate[0]), fallen);
      largest = max(largest, (h * h) * squared);
    });
    return largest;
  }

  /// Computes q̇ and q̈ at `time`.
  void slopes(const L& time, const Parts& parts, Parts& found) {
    find_accelerations(time, parts);
    for_parts([&](int i) { found[i] = {parts[i].rate, {acceleration(i)}}; });
  }

  template <class... Low>
  void restore(Parts& /*parts*/, Low&... /*low*/) const {}

  /// The longest step in which drives turn by at most `turn`  [rad], and in which unseen_forcing_squared samples as
  /// densely as ForcingLook. `nodes`: those of a Gauss quadrature as accurate as the method.
  template <int nodes>
  L longest_step(double turn) const {
    const L longest = L(turn) / dynamics_.fastest_drives();
    if (!is_batch<L> || !depends_on_time()) return longest;
    const double looks = ForcingLook::least_parts * nodes / ForcingLook::looks;
    return min(longest, L(looks) / natural_pace());
  }

  /// Whether accelerations depend on time other than through drives.
  bool depends_on_time() const { return dynamics_.depends_on_time(); }

  /// Difference between integrals over the step of the accelerations of a fixed state: by one quadrature with `nodes`
  /// nodes, and by one in each of several parts. Relative to rates and their changes, squared (ForcingLook).
  template <int nodes>
  L unseen_forcing_squared(const L& time, const L& h, const Parts& parts) {
    write(time, parts);
    for (Sums* sums : {&coarse_, &fine_})
      sum_forcing<nodes>(time, h, sums == &coarse_ ? 1 : ForcingLook::least_parts, *sums);
    const L share = ForcingLook::share_of(abs(h) * natural_pace());
    L largest(0.0);
    for (std::size_t k = 0; k < coarse_.push.size(); ++k) {
      const Part& part = parts[static_cast<int>(k)];
      const L place = max(abs(value(part.place[0])), L(dynamics_.is_angle(static_cast<int>(k)) ? 1.0 : 0.0));
      const L least = max(L(ForcingLook::rounding) * (natural_pace() * place), L(ForcingLook::negligible));
      const L size = max(max(abs(value(part.rate[0])), fine_.size[k]), least);
      const L unknown = L(ForcingLook::invisible) * least +
                        L(ForcingLook::rounding) * fma(abs(time) + abs(h), fine_.change[k], fine_.size[k]);
      const L off = max(abs(coarse_.push[k] - fine_.push[k]) - unknown, L(0.0));
      const L missed = off / (size * share);
      largest = max(largest, missed * missed);
    }
    return select(abs(h) * natural_pace() > L(ForcingLook::finest), largest, L(0.0));
  }

  /// SystemTangents::squared.
  L tangent_squared(const Parts& parts) const requires with_tangent {
    return tangent_.squared([&](int i) -> const L& { return parts[i].place[0].slope; },
                            [&](int i) -> const L& { return parts[i].rate[0].slope; });
  }

 private:
  // Integrals of the accelerations over a step: ∫ a dt, ∫ |a| dt, and the total variation of a.
  struct Sums {
    std::vector<L> push, size, change, last;
  };

  template <int nodes>
  void sum_forcing(const L& time, const L& h, int count, Sums& sums) {
    using Gauss = kernels::GaussTableau<nodes>;
    for (std::vector<L>* each : {&sums.push, &sums.size, &sums.change, &sums.last}) {
      each->assign(static_cast<std::size_t>(parts()), L(0.0));
    }
    const L part = L(1.0 / count) * h;
    for (int p = 0; p < count; ++p) {
      for (std::size_t i = 0; i < nodes; ++i) {
        to_row(fma(L(p + Gauss::c[i]), part, time), times());
        dynamics_.call(times(), &SystemFunctions::acceleration, numbers(0, 0), numbers(1, 0), numbers(2, 0));
        const L weight = L(Gauss::b[i]) * part;
        for (std::size_t k = 0; k < sums.push.size(); ++k) {
          const L a = from_row<L>(numbers(2, static_cast<int>(k)));
          sums.push[k] = fma(weight, a, sums.push[k]);
          sums.size[k] = fma(abs(weight), abs(a), sums.size[k]);
          if (p > 0 || i > 0) sums.change[k] = sums.change[k] + abs(a - sums.last[k]);
          sums.last[k] = a;
        }
      }
    }
  }

  // The rate of change of the motion; 1/s if nothing moves or pushes yet.
  L natural_pace() const { return sqrt(select(pace_squared_ > L(0.0), pace_squared_, L(1.0))); }

  // For one motion. Errors are relative to each coordinate or rate itself, plus 1 rad or 1/s, or the size of the whole
  // motion if that is smaller, so that oscillations of 1e-9 rad are resolved like any other. The state at the end of
  // the step counts, too: forces may begin at zero.
  double error_squared_of_one(double h, const Parts& errors, const Parts& before, const Parts& slopes,
                              const Parts& after) const {
    const auto larger = [](const auto& a, const auto& b) { return std::max(std::abs(a[0]), std::abs(b[0])); };
    double q = 0, v = 0, a = 0;
    for_parts([&](int i) {
      q = std::max(q, larger(before[i].place, after[i].place));
      v = std::max(v, larger(before[i].rate, after[i].rate));
      a = std::max(a, std::abs(slopes[i].rate[0]));
    });
    const double place = std::clamp(std::max(q, h * v), ErrorSize::nothing, 1.0),
                 rate = std::clamp(std::max(v, h * a), ErrorSize::nothing, 1.0);
    const double rounding = ErrorSize::rounding * q / h;  // may change rates where nothing moves: not counted as error
    double largest = 0;
    for_parts([&](int i) {
      const double speed = std::abs(before[i].rate[0]), push = std::abs(slopes[i].rate[0]);
      const double off = std::max(0.0, h * std::abs(errors[i].rate[0]) - rounding) / (rate + speed + h * push);
      const double moved = h * std::abs(errors[i].place[0]) / (place + std::abs(before[i].place[0]) + h * speed);
      largest = std::max({largest, moved, off});
    });
    return largest * largest;
  }

  // If both are zero the result is zero: the part rests.
  static L relative(const L& error, const L& squared) { return (error * error) / max(squared, L(detail::almost_zero)); }

  static const L& value(const Number& number) { return detail::value_of(number); }

  // --- Rows of numbers passed to the kernel ---

  // Kinds of rows: q, q̇, q̈, then their derivatives; one row more for times.
  static constexpr int kinds = with_tangent ? 6 : 3;
  // Row of coordinate i; which = 0, 1, 2: q, q̇, q̈; 3, 4, 5: their derivatives.
  double* numbers(int which, int i) { return rows_[which * parts() + i]; }
  double* times() { return numbers(kinds, 0); }

  void write(const L& time, const Parts& parts) {
    to_row(time, times());
    for_parts([&](int i) {
      to_row(value(parts[i].place[0]), numbers(0, i));
      to_row(value(parts[i].rate[0]), numbers(1, i));
      if constexpr (with_tangent) {
        to_row(parts[i].place[0].slope, numbers(3, i));
        to_row(parts[i].rate[0].slope, numbers(4, i));
      }
    });
  }

  void find_accelerations(const L& time, const Parts& parts) {
    write(time, parts);
    if constexpr (with_tangent) {
      dynamics_.call(times(), &SystemFunctions::acceleration_along, numbers(0, 0), numbers(1, 0), numbers(3, 0),
                     numbers(4, 0), numbers(2, 0), numbers(5, 0));
    } else {
      dynamics_.call(times(), &SystemFunctions::acceleration, numbers(0, 0), numbers(1, 0), numbers(2, 0));
    }
  }
  Number acceleration(int i) {
    if constexpr (with_tangent) {
      return {from_row<L>(numbers(2, i)), from_row<L>(numbers(5, i))};
    } else {
      return from_row<L>(numbers(2, i));
    }
  }

  void start_tangent(int lane, double time, const double* q, const double* v, Parts& parts) {
    const auto tangent = tangent_.start(lane, time, q, v);
    for (int i = 0; i < this->parts(); ++i) {
      set(parts[i].place[0].slope, lane, tangent.place[static_cast<std::size_t>(i)]);
      set(parts[i].rate[0].slope, lane, tangent.rate[static_cast<std::size_t>(i)]);
    }
  }

  struct NoTangent {
    explicit NoTangent(MemberSystems<L>& /*dynamics*/) {}
  };

  MemberSystems<L>& dynamics_;
  PackRows<width_of<L>> rows_;
  L pace_squared_{1.0}, energy_sum_{0.0};
  Sums coarse_, fine_;
  [[no_unique_address]] std::conditional_t<with_tangent, SystemTangents<L>, NoTangent> tangent_;
};

}  // namespace pendula
