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

/// Quantities of a state besides its coordinates and rates.
struct Observation {
  Eigen::VectorXd points;  ///< components of all points, point after point  [m]
  double kinetic = 0;      ///< T  [J]
  double energy = 0;       ///< T + U; for a system h = v·∂L/∂v − L  [J]

  double potential() const { return energy - kinetic; }
};

/// What a run moves: a chain or any other system with its parameters. Immutable.
class Subject {
 public:
  Subject() = default;
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  virtual ~Subject() = default;

  /// As make_integrator for chains. Throws std::invalid_argument for options that make no sense, and NoKernel.
  virtual std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const = 0;

  virtual Observation observe(const Motion& motion) const = 0;

  /// Scale of energy errors  [J]; nothing if it is known only from the motion.
  virtual std::optional<double> energy_scale() const = 0;
  /// Whether the energy may change by loads or inputs, and whether damping may take some.
  virtual bool loaded() const = 0;
  virtual bool damped() const = 0;
  /// Whether the energy is known at all times: it is conserved, or all work is summed.
  virtual bool balances(Method method) const { return !loaded() || !is_explicit(method); }

  /// Problems of a run with these options that are known in advance, one sentence each.
  virtual std::vector<std::string> expected_trouble(const RunOptions& options) const = 0;
  /// Whether the coordinates of the dense solver are singular somewhere.
  virtual bool has_poles() const = 0;

  /// The quantities of a trajectory: time, coordinates, rates, inputs, points, energy; and the numbers of one row.
  virtual std::vector<Quantity> quantities() const = 0;
  virtual void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const = 0;

  /// The columns of inputs that feedback adds to.
  virtual std::vector<std::size_t> fed_columns() const { return {}; }

  /// Masses, lengths and other parameters, in SI units.
  virtual std::vector<Constant> constants() const = 0;

  /// Names of the columns of a row.
  std::vector<std::string> columns() const { return columns_of(quantities()); }

  /// Names of the coordinates; empty for a chain, for which messages name links.
  virtual std::span<const std::string_view> coordinates() const = 0;

  /// Switching functions of a system with functions of several pieces.
  virtual std::span<const std::string_view> switches() const { return {}; }
  /// The one that drives a motion away on both sides where it starts.
  virtual std::optional<std::size_t> fork(const Motion& /*start*/) const { return {}; }

  /// The columns of a short table: index of the first, and how many.
  virtual std::pair<std::size_t, std::size_t> shown_columns() const = 0;

  /// Distance of two states relative to the size and speed of the motion; full turns of angles count. `size` has the
  /// largest absolute value of each coordinate and rate along the motion.
  virtual double distance(const Motion& a, const Motion& b, const Motion& size) const = 0;

  /// The same if only the two states are known.
  double distance(const Motion& a, const Motion& b) const {
    return distance(a, b, {b.time, a.q.cwiseAbs().cwiseMax(b.q.cwiseAbs()), a.v.cwiseAbs().cwiseMax(b.v.cwiseAbs())});
  }
};

}  // namespace pendula
