#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <pendula/run/integrator.hpp>
#include <pendula/run/quantity.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_system.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pendula {

/// Quantities of a state besides its coordinates and rates.
struct Observation {
  Eigen::VectorXd points;  ///< components of all points, point after point  [m]
  double kinetic = 0;      ///< T  [J]
  double energy = 0;       ///< T + U; for a system h = v·∂L/∂v − L  [J]
  /// Of constraints  [J over the unit of each].
  Eigen::VectorXd forces = {};  // NOLINT(readability-redundant-member-init)

  double potential() const { return energy - kinetic; }
};

/// A column that the user defines.
struct OwnColumn {
  std::string name, meaning;
  /// A function of the columns that a row has without own ones; several threads may call it.
  std::function<double(std::span<const double> row)> value;
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
  /// Whether loads or inputs may change the energy; whether damping may.
  virtual bool loaded() const = 0;
  virtual bool damped() const = 0;
  /// Whether the energy is known at all times: it is conserved, or all work is summed.
  virtual bool balances(Method method) const { return !loaded() || !is_explicit(method); }

  /// Problems of a run with these options that are known in advance, one sentence each.
  virtual std::vector<std::string> expected_trouble(const RunOptions& options) const = 0;
  /// Whether the coordinates of the dense solver are singular somewhere.
  virtual bool has_poles() const = 0;

  /// The quantities of a trajectory: time, coordinates, rates, inputs, points, energy, own columns.
  std::vector<Quantity> quantities() const {
    std::vector<Quantity> quantities = motion_quantities();
    std::size_t column = own_.empty() ? 0 : columns_of(quantities).size();
    for (const OwnColumn& own : own_) quantities.push_back({own.name, "1", Role::own, own.meaning, column++});
    return quantities;
  }

  /// Appends the numbers of one row. If the observation is empty, points, energy and own columns are left out.
  void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const {
    const std::size_t first = row.size();
    append_motion_row(motion, seen, row);
    const std::size_t count = row.size() - first;
    if (own_.empty() || count < motion_columns_) return;
    for (const OwnColumn& own : own_) row.push_back(own.value(std::span(row).subspan(first, count)));
  }

  /// The same without own columns.
  virtual std::vector<Quantity> motion_quantities() const = 0;
  virtual void append_motion_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const = 0;

  virtual std::shared_ptr<Subject> copy() const = 0;
  /// with_inputs of inputs.hpp, of as many numbers as there are inputs; null where feedback or signals hold them.
  virtual std::shared_ptr<const Subject> with_inputs(std::span<const double> /*inputs*/,
                                                     std::span<const InputSine> /*added*/) const {
    return nullptr;
  }

  /// A subject without signals whose equations are those of this one around a time, where signals add lines to inputs.
  /// Null if this one has no signals, and for sampled feedback.
  virtual std::shared_ptr<const Subject> part_at(double /*time*/) const { return nullptr; }

  /// Brings a state that is near its constraints onto them.
  virtual void close(Motion& /*state*/) const {}

  /// The columns of inputs that feedback or signals add to.
  virtual std::vector<std::size_t> fed_columns() const { return {}; }

  /// Masses, lengths and other parameters, in SI units.
  virtual std::vector<Constant> constants() const = 0;

  /// Names of the columns of a row.
  std::vector<std::string> columns() const { return columns_of(quantities()); }

  /// Names of the coordinates; empty for a chain, for which messages name links.
  virtual std::span<const std::string_view> coordinates() const = 0;

  /// Switching functions of a system with functions of several pieces.
  virtual std::span<const std::string_view> switches() const { return {}; }
  /// A switching function that is zero at the start and drives the motion away on both sides, if there is one: then the
  /// equations do not tell which way it goes.
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

 private:
  friend std::shared_ptr<const Subject> with_columns(const std::shared_ptr<const Subject>& subject,
                                                     std::vector<OwnColumn> own);

  std::vector<OwnColumn> own_;
  std::size_t motion_columns_ = 0;
};

/// The same subject with these own columns in place of its present ones.
inline std::shared_ptr<const Subject> with_columns(const std::shared_ptr<const Subject>& subject,
                                                   std::vector<OwnColumn> own) {
  if (own.empty()) return subject;
  const std::shared_ptr<Subject> made = subject->copy();
  made->own_ = std::move(own);
  made->motion_columns_ = columns_of(made->motion_quantities()).size();
  return made;
}

}  // namespace pendula
