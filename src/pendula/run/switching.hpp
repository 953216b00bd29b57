#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <utility>
#include <vector>

namespace pendula {

/// The side of each switching function, +1 or −1. Sides say which pieces of its functions a system moves by.
using Sides = std::vector<int>;

/// A system with functions of several pieces. Between the zeros of its switching functions g the system is smooth: the
/// sides of g stand among its parameters.
class SwitchingSystem {
 public:
  /// The table must outlive it.
  SwitchingSystem(const SystemTable& table, SystemNumbers numbers) : table_(&table), numbers_(std::move(numbers)) {}

  const SystemTable& table() const { return *table_; }
  std::size_t switches() const { return table_->info.switches.size(); }

  /// The numbers of the system on these sides.
  SystemNumbers numbers(const Sides& sides) const;

  /// The values of g on these sides: a switching function may have pieces itself.
  std::vector<double> values(const Sides& sides, const Motion& motion) const;

  /// The arguments of the functions that may change fast, without bases of powers (field_look.hpp).
  std::vector<double> fast_arguments(const Sides& sides, const Motion& motion) const;

  /// The sides on which a motion goes on. At zeros of g they depend on where the motion goes. If all sides drive it
  /// back to a zero, it cannot leave: stuck_at.
  struct Way {
    Sides sides;
    std::optional<std::size_t> stuck_at;
  };
  Way way(const Motion& motion) const;

  /// A switching function that is zero at a motion, and drives it away on both sides: the equations do not tell where
  /// it goes.
  std::optional<std::size_t> fork(const Motion& motion) const;

  /// The time scale of the motion, speed over acceleration  [s].
  double pace(const Sides& sides, const Motion& motion) const;

  /// All combinations of sides, or 64 of them where there are more.
  std::vector<Sides> all_sides() const;

 private:
  template <class Function>
  std::vector<double> at(Function function, std::size_t count, const Sides& sides, const Motion& motion) const;
  Sides sides_at(const Motion& motion) const;
  std::vector<std::size_t> zeros(const Sides& sides, const Motion& motion) const;
  int drift(std::size_t k, const Sides& sides, const Motion& motion) const;
  Motion ahead(const Sides& sides, const Motion& motion, double time) const;
  std::vector<double> accelerations(const Sides& sides, const Motion& motion) const;

  const SystemTable* table_;
  SystemNumbers numbers_;
};

inline SystemNumbers SwitchingSystem::numbers(const Sides& sides) const {
  SystemNumbers numbers = numbers_;
  double* indicator = numbers.parameters.data() + numbers.parameters.size() - 2 * switches();
  for (const int side : sides) {
    *indicator++ = side > 0 ? 1 : 0;
    *indicator++ = side > 0 ? 0 : 1;
  }
  return numbers;
}

/// The `count` numbers that a function of the kernel writes at a motion.
template <class Function>
std::vector<double> SwitchingSystem::at(Function function, std::size_t count, const Sides& sides,
                                        const Motion& motion) const {
  SystemNumbers numbers = this->numbers(sides);
  for (const InputSine& sine : numbers.sines) {
    numbers.inputs[static_cast<std::size_t>(sine.input)] +=
        sine.amplitude * std::sin(sine.frequency * motion.time + sine.phase);
  }
  std::vector<double> found(count);
  function({table_->context, numbers.parameters.data(), &motion.time, numbers.inputs.data()}, motion.q.data(),
           motion.v.data(), found.data());
  return found;
}

inline std::vector<double> SwitchingSystem::values(const Sides& sides, const Motion& motion) const {
  return at(table_->plain.switches, switches(), sides, motion);
}

inline std::vector<double> SwitchingSystem::fast_arguments(const Sides& sides, const Motion& motion) const {
  const std::span<const bool> is_base = table_->info.argument_is_base;
  if (is_base.empty()) return {};
  const std::vector<double> all = at(table_->of_1.call_arguments, is_base.size(), sides, motion);
  std::vector<double> found;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!is_base[k]) found.push_back(all[k]);
  }
  return found;
}

/// The sides that the values at a motion have.
inline Sides SwitchingSystem::sides_at(const Motion& motion) const {
  Sides sides(switches(), 1);
  for (std::size_t pass = 0; pass <= sides.size(); ++pass) {  // one may depend on another
    const std::vector<double> found = values(sides, motion);
    for (std::size_t k = 0; k < sides.size(); ++k) sides[k] = found[k] < 0 ? -1 : 1;
  }
  return sides;
}

/// The switching functions that are zero to rounding: 1e-10 of the time scale changes them by more than their value.
inline std::vector<std::size_t> SwitchingSystem::zeros(const Sides& sides, const Motion& motion) const {
  constexpr std::size_t most_at_once = 8;
  constexpr double moment = 1e-10;
  const double soon = moment * pace(sides, motion);
  const std::vector<double> found = values(sides, motion);
  const std::vector<double> later = values(sides, ahead(sides, motion, soon));
  const std::vector<double> before = values(sides, ahead(sides, motion, -soon));
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < found.size() && open.size() < most_at_once; ++k) {
    const double change = std::max(std::abs(later[k] - found[k]), std::abs(before[k] - found[k]));
    if (std::abs(found[k]) <= change || found[k] == 0) open.push_back(k);
  }
  return open;
}

inline SwitchingSystem::Way SwitchingSystem::way(const Motion& motion) const {
  Sides sides = sides_at(motion);
  const std::vector<std::size_t> open = zeros(sides, motion);
  if (open.empty()) return {sides, {}};
  const Sides first = sides;
  std::optional<std::size_t> stuck;
  for (unsigned turned = 0; turned < 1U << open.size(); ++turned) {
    sides = first;
    for (std::size_t n = 0; n < open.size(); ++n) {
      if ((turned >> n & 1U) != 0) sides[open[n]] *= -1;
    }
    const auto leaves = [&](std::size_t k) { return drift(k, sides, motion) * sides[k] >= 0; };
    const auto back = std::ranges::find(open, false, leaves);
    if (back == open.end()) return {sides, {}};
    if (!stuck) stuck = *back;
  }
  return {first, stuck};
}

inline std::optional<std::size_t> SwitchingSystem::fork(const Motion& motion) const {
  const Sides sides = sides_at(motion);
  for (const std::size_t k : zeros(sides, motion)) {
    Sides other = sides;
    other[k] *= -1;
    if (drift(k, sides, motion) * sides[k] > 0 && drift(k, other, motion) * other[k] > 0) return k;
  }
  return {};
}

/// The sign of the change of g soon after; 0 if it does not change.
inline int SwitchingSystem::drift(std::size_t k, const Sides& sides, const Motion& motion) const {
  constexpr std::array<double, 7> moments{1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4};
  const double whole = pace(sides, motion), now = values(sides, motion)[k];
  for (const double moment : moments) {
    const auto change = [&](double share) {
      return values(sides, ahead(sides, motion, share * moment * whole))[k] - now;
    };
    const double half = change(0.5), all = change(1);
    // The change is smooth, not mere rounding.
    if (half * all > 0 && std::abs(all) > 1.5 * std::abs(half) && std::abs(all) < 5 * std::abs(half)) {
      return (all > 0 ? 1 : -1);
    }
  }
  return 0;
}

inline Motion SwitchingSystem::ahead(const Sides& sides, const Motion& motion, double time) const {
  const std::vector<double> a = accelerations(sides, motion);
  const Eigen::Map<const Eigen::VectorXd> rate(a.data(), motion.v.size());
  return {motion.time + time, motion.q + time * (motion.v + time / 2 * rate), motion.v + time * rate};
}

inline std::vector<double> SwitchingSystem::accelerations(const Sides& sides, const Motion& motion) const {
  const auto n = static_cast<std::size_t>(motion.v.size());
  if (table_->info.constraints.empty()) return at(table_->of_1.acceleration, n, sides, motion);
  std::vector<double> found(n);
  find_accelerations({*table_, numbers(sides).plain()}, motion.time, motion.q.data(), motion.v.data(), found.data());
  return found;
}

inline double SwitchingSystem::pace(const Sides& sides, const Motion& motion) const {
  const std::vector<double> a = accelerations(sides, motion);
  double force = 0;
  for (const double each : a) force = std::max(force, std::abs(each));
  const double speed = motion.v.size() > 0 ? motion.v.cwiseAbs().maxCoeff() : 0;
  return speed > 0 && force > 0 && std::isfinite(force) ? std::clamp(speed / force, 1e-3, 1e3) : 1;
}

inline std::vector<Sides> SwitchingSystem::all_sides() const {
  constexpr std::size_t most = 6;
  std::vector<Sides> all;
  for (unsigned turned = 0; turned < 1U << std::min(switches(), most); ++turned) {
    Sides sides(switches(), 1);
    for (std::size_t k = 0; k < sides.size(); ++k) sides[k] = (turned >> (k % most) & 1U) != 0 ? -1 : 1;
    all.push_back(std::move(sides));
  }
  return all;
}

/// Steps of a system with functions of several pieces: a step ends where one of its switching functions is zero, to
/// rounding, and from there on a new integrator goes by other pieces. Where the motion cannot leave a zero, the next
/// step fails.
std::unique_ptr<PlainIntegrator> make_switching_integrator(SwitchingSystem system, const RunOptions& options);

}  // namespace pendula
