#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Which pieces of its functions a system moves by: of each switching function its side, +1 or −1.
using Sides = std::vector<int>;

/// A system with functions of several pieces: between the zeros of its switching functions g it is smooth, and moves by
/// the parameters that belong to their sides.
class SwitchingSystem {
 public:
  /// The table must outlive it.
  SwitchingSystem(const SystemTable& table, SystemNumbers numbers) : table_(&table), numbers_(std::move(numbers)) {}

  const SystemTable& table() const { return *table_; }
  std::size_t switches() const { return table_->info.switches.size(); }

  /// Its numbers where these pieces are taken.
  SystemNumbers numbers(const Sides& sides) const;

  /// g by these pieces, on which one may depend itself.
  std::vector<double> values(const Sides& sides, const Motion& motion) const;

  /// The sides on which a motion goes on, which at zeros of g depends on where it goes. Both may drive it back to one
  /// of the zeros: it cannot leave it.
  struct Way {
    Sides sides;
    std::optional<std::size_t> stuck_at;
  };
  Way way(const Motion& motion) const;

  /// All ways to choose sides, or many of them.
  std::vector<Sides> all_sides() const;

 private:
  int drift(std::size_t k, const Sides& sides, const Motion& motion) const;
  Motion ahead(const Sides& sides, const Motion& motion, double time) const;
  std::vector<double> accelerations(const Sides& sides, const Motion& motion) const;
  double pace(const Sides& sides, const Motion& motion) const;

  const SystemTable* table_;
  SystemNumbers numbers_;
};

/// Steps of such a system: a step ends where one of its switching functions is zero, to rounding, and from there on a
/// new integrator goes by other pieces. Where the motion cannot leave a zero, the next step fails.
std::unique_ptr<PlainIntegrator> make_switching_integrator(const SwitchingSystem& system, const RunOptions& options);

inline constexpr const char* pieces_have_no_derivatives =
    "derivatives: expected a model whose functions are of one piece, got one that switches between pieces: derivatives "
    "of its motion jump there, and are not told";

}  // namespace pendula
