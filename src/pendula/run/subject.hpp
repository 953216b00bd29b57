#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

/// What one state shows.
struct Observation {
  Eigen::VectorXd points;  ///< components of all points, one after the other  [m]
  double kinetic = 0;      ///< T  [J]
  double energy = 0;       ///< T + U; of a system h = v·∂L/∂v − L  [J]

  double potential() const { return energy - kinetic; }
};

/// What a run moves: a chain, or any other system, with its numbers. Immutable.
class Subject {
 public:
  Subject() = default;
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  virtual ~Subject() = default;

  /// As the make_integrator of chains. Throws std::invalid_argument on options that make no sense, NoKernel.
  virtual std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const = 0;

  virtual Observation observe(const Motion& motion) const = 0;

  /// What energies are compared with [J]; nothing where that is only known when the motion is.
  virtual std::optional<double> energy_scale() const = 0;
  /// Whether energy may come from outside or go there, and whether it may go by damping.
  virtual bool loaded() const = 0;
  virtual bool damped() const = 0;
  /// Whether the energy at every time is known: it is kept, or all that comes and goes is added up.
  virtual bool balances(Method method) const { return !loaded() || !is_explicit(method); }

  /// Why a run with these options would be wrong, known beforehand: one sentence each.
  virtual std::vector<std::string> expected_trouble(const RunOptions& options) const = 0;
  /// Whether the dense solver's coordinates fail somewhere.
  virtual bool has_poles() const = 0;

  /// What a trajectory has: time, coordinates, rates, inputs, points, energy; and the numbers of one row.
  virtual std::vector<Quantity> quantities() const = 0;
  virtual void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const = 0;

  /// Masses, lengths and the like, in SI as quantities are.
  virtual std::vector<Constant> constants() const = 0;

  /// Names of the numbers of a row.
  std::vector<std::string> columns() const { return columns_of(quantities()); }

  /// Coordinates by name; none of a chain, whose links are what messages name.
  virtual std::span<const std::string_view> coordinates() const = 0;

  /// Of all columns, those that a short table shows: index of the first, and how many.
  virtual std::pair<std::size_t, std::size_t> shown_columns() const = 0;

  /// Distance of two states relative to the size and the speed of the motion, whole turns of angles included; `size`
  /// has the largest of each coordinate and rate, where the motion is known.
  virtual double distance(const Motion& a, const Motion& b, const Motion& size) const = 0;

  /// The same where nothing is known but the two.
  double distance(const Motion& a, const Motion& b) const {
    return distance(a, b, {b.time, a.q.cwiseAbs().cwiseMax(b.q.cwiseAbs()), a.v.cwiseAbs().cwiseMax(b.v.cwiseAbs())});
  }
};

}  // namespace pendula
