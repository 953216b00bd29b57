#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <pendula/chain/chain_links.hpp>
#include <pendula/lanes/lane_dynamics.hpp>
#include <pendula/lanes/lane_pack.hpp>
#include <pendula/lanes/lane_part.hpp>
#include <pendula/numeric/lanes.hpp>
#include <type_traits>
#include <vector>

namespace pendula {

/// Where coordinates lie that are numbers and nothing else.
struct CoordinateSpace {
  static constexpr int dof = 1;
  static constexpr std::size_t dimension = 1;
};

/// The forward dynamics of several systems at once, one in each lane, by whatever tells their accelerations.
template <class Register = MemberRegister>
class LaneSystem {
 public:
  using SpaceType = CoordinateSpace;
  using L = LanePack<Register>;
  using Mask = typename L::Mask;
  using Number = L;
  using Subject = LaneDynamics&;
  static constexpr int links_known = Eigen::Dynamic;
  static constexpr bool has_tangent = false;
  static constexpr std::size_t D = 1;
  using Part = LanePart<L, D>;  ///< q, q̇ of a coordinate
  using Parts = detail::PerLink<Part, links_known>;

  /// `dynamics` must outlive it.
  explicit LaneSystem(LaneDynamics& dynamics) : dynamics_(dynamics), buffer_(doubles_for(dynamics.coordinates())) {
    void* first = buffer_.data();
    std::size_t room = buffer_.size() * sizeof(double);
    first_ = static_cast<double*>(std::align(pack_alignment, sizeof(double), first, room));
  }
  LaneSystem(const LaneSystem&) = delete;
  LaneSystem& operator=(const LaneSystem&) = delete;

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

  /// A member comes into a lane, with its numbers, at q and v at `time`.
  void start(int lane, double time, const PlainSystem& system, const double* q, const double* v, Parts& parts) {
    dynamics_.take(lane, system);
    for (int i = 0; i < this->parts(); ++i) {
      parts[i].place[0].set(lane, q[i]);
      parts[i].rate[0].set(lane, v[i]);
    }
    find_accelerations(L(time), parts);
    double squared = 0;
    for (int i = 0; i < this->parts(); ++i) {
      const double size = std::max(1.0, std::abs(q[i]));
      const double fast = v[i] / size, push = std::abs(numbers(2, i)[lane]) / size;
      squared = std::max(squared, fast * fast + push);
    }
    pace_squared_.set(lane, squared);
  }

  /// T + U  [J].
  L energy(const L& time, const Parts& parts) {
    write(time, parts);
    alignas(pack_alignment) double kinetic[L::width], total[L::width];
    dynamics_.energies(times(), numbers(0, 0), numbers(1, 0), kinetic, total);
    const L T = L::load(kinetic), energy = L::load(total);
    energy_sum_ = abs(T) + abs(energy - T);
    return energy;
  }
  /// |T| + |U| where the energy was asked for last  [J].
  const L& energy_sum() const { return energy_sum_; }

  /// How fast a member swung when it began, squared, and no less than coordinates that are angles turn; not a number
  /// where anything is none  [1/s²].
  L pace_squared(const Parts& parts) const {
    L largest = pace_squared_, none(0.0);
    for_parts([&](int i) {
      const L &q = parts[i].place[0], &v = parts[i].rate[0];
      none = none + ((q - q) + (v - v));
      if (dynamics_.is_angle(i)) largest = max(largest, v * v);
    });
    return largest + none;
  }

  /// What a step of `h` errs by, squared, from the errors of coordinates and rates that it is made of: of angles
  /// relative to a radian, of others to the largest coordinate of the same unit; of rates to the fastest, and to what
  /// they come to where they fall that far.
  L error_squared(const L& h, const Parts& errors, const Parts& before, const Parts& slopes, const Parts& after,
                  const L& /*pace_squared*/) const {
    L largest(0.0);
    const L size = abs(h);
    for_parts([&](int i) {
      const bool is_angle = dynamics_.is_angle(i);
      L place(is_angle ? 1.0 : 0.0), rate(0.0), push(0.0);
      for_parts([&](int j) {
        if (!dynamics_.of_one_unit(i, j)) return;
        push = max(push, abs(slopes[j].rate[0]));
        rate = max(rate, max(abs(before[j].rate[0]), abs(after[j].rate[0])));
        if (!is_angle) place = max(place, max(abs(before[j].place[0]), abs(after[j].place[0])));
      });
      rate = max(rate, size * push);
      if (!is_angle) place = max(place, size * rate);
      const L fallen = max(rate * rate, push * place);
      const L squared = relative(errors[i].place[0], place * place) + relative(errors[i].rate[0], fallen);
      largest = max(largest, (h * h) * squared);
    });
    return largest;
  }

  /// q̇ and q̈ at `time`.
  void slopes(const L& time, const Parts& parts, Parts& found) {
    find_accelerations(time, parts);
    for_parts([&](int i) { found[i] = {parts[i].rate, {L::load(numbers(2, i))}}; });
  }

  void restore(Parts& /*parts*/) const {}

 private:
  // What has no size errs by nothing: it rests.
  static L relative(const L& error, const L& squared) { return (error * error) / max(squared, L(1e-300)); }

  // q, q̇, q̈ and a time, of as many lanes as there are, from a place on that is aligned.
  static std::size_t doubles_for(int coordinates) {
    return (3 * static_cast<std::size_t>(coordinates) + 1) * L::width + pack_alignment / sizeof(double);
  }
  double* registers(int count) { return first_ + static_cast<std::ptrdiff_t>(count) * L::size; }
  double* times() { return registers(3 * parts()); }
  // Those of coordinate i, of which = 0, 1, 2: q, q̇, q̈.
  double* numbers(int which, int i) { return registers(which * parts() + i); }

  void write(const L& time, const Parts& parts) {
    time.store(times());
    for_parts([&](int i) {
      parts[i].place[0].store(numbers(0, i));
      parts[i].rate[0].store(numbers(1, i));
    });
  }

  void find_accelerations(const L& time, const Parts& parts) {
    write(time, parts);
    dynamics_.accelerations(times(), numbers(0, 0), numbers(1, 0), numbers(2, 0));
  }

  LaneDynamics& dynamics_;
  std::vector<double> buffer_;
  double* first_ = nullptr;
  L pace_squared_{1.0}, energy_sum_{0.0};
};

}  // namespace pendula
