#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <pendula/run/library.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/switching.hpp>
#include <pendula/system/constraint_forces.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_model.hpp>
#include <pendula/system/system_table.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {

/// Continuous feedback. It is part of the forces of a kernel; rows add its value to the input.
struct InputFunction {
  std::size_t input;
  std::function<double(const Motion&)> value;
};

/// A system other than a chain as the subject of a run.
class SystemSubject : public Subject {
 public:
  /// Shares ownership of `table` and of what it was loaded from. Throws std::invalid_argument for a wrong number of
  /// parameters or inputs, and for sines on inputs that do not exist. Parameters that tell pieces may be left out.
  /// `feedback` is what the kernel adds to its inputs.
  SystemSubject(std::shared_ptr<const SystemTable> table, SystemNumbers numbers,
                std::vector<InputFunction> feedback = {})
      : table_(std::move(table)), numbers_(std::move(numbers)), feedback_(std::move(feedback)) {
    const auto& sizes = info().parameter_sizes;
    const auto all = static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), 0));
    if (numbers_.parameters.size() == all - 2 * switches().size()) {
      for (std::size_t k = 0; k < switches().size(); ++k) {
        for (const double indicator : {1.0, 0.0}) numbers_.parameters.push_back(indicator);
      }
    }
    require_size("parameters", numbers_.parameters.size(), all);
    require_size("inputs", numbers_.inputs.size(), info().inputs.size());
    for (const InputSine& sine : numbers_.sines) {
      if (sine.input >= 0 && static_cast<std::size_t>(sine.input) < info().inputs.size()) continue;
      throw std::invalid_argument("sines: expected an input from 0 to before " + std::to_string(info().inputs.size()) +
                                  ", got " + std::to_string(sine.input));
    }
    loaded_ = !feedback_.empty() || SystemModel(*table_, numbers_.plain()).loaded();
    if (switches().empty()) return;
    for (const Sides& sides : switching().all_sides()) {
      const SystemNumbers there = switching().numbers(sides);
      loaded_ = loaded_ || SystemModel(*table_, there.plain()).loaded();
    }
  }

  const SystemTable& table() const { return *table_; }
  const SystemInfo& info() const { return table_->info; }
  const SystemNumbers& numbers() const { return numbers_; }
  const std::vector<InputFunction>& feedback() const { return feedback_; }

  std::span<const std::string_view> switches() const override { return info().switches; }
  std::optional<std::size_t> fork(const Motion& start) const override {
    return switches().empty() ? std::nullopt : switching().fork(start);
  }

  /// The numbers of the system, on the pieces that a motion takes.
  SystemNumbers numbers_at(const Motion& motion) const {
    return switches().empty() ? numbers_ : switching().numbers(switching().way(motion).sides);
  }

  std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
    if (options.solver == Solver::chain) {
      throw std::invalid_argument("solver: the chain solver is for chains, got chain; dense is for any system");
    }
    if (!switches().empty()) {
      return std::make_unique<Integrator>(make_switching_integrator(switching(), options),
                                          static_cast<Eigen::Index>(info().coordinates.size()), "system");
    }
    return std::make_unique<Integrator>(library<SystemMaker>().make_integrator(*table_, numbers_.plain(), options, 0),
                                        static_cast<Eigen::Index>(info().coordinates.size()), "system");
  }

  Observation observe(const Motion& motion) const override {
    Observation seen;
    seen.points.resize(point_components());
    std::optional<SystemNumbers> there;
    const SystemNumbers& numbers = switches().empty() ? numbers_ : there.emplace(numbers_at(motion));
    const Conditions at = conditions(motion.time, numbers);
    table_->of_1.energies(at, motion.q.data(), motion.v.data(), &seen.kinetic, &seen.energy);
    if (seen.points.size() > 0) table_->plain.positions(at, motion.q.data(), seen.points.data());
    if (!info().constraints.empty()) seen.forces = constraint_forces(motion, numbers);
    return seen;
  }

  /// Whether forces may change rapidly by functions other than powers and logarithms (field_look.hpp).
  bool may_be_narrow() const { return !std::ranges::all_of(info().argument_is_base, std::identity()); }

  /// Rates that belong to momenta; not finite if the mass matrix is singular.
  Eigen::VectorXd rates(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& p) const {
    Eigen::VectorXd v(q.size());
    const SystemNumbers numbers = numbers_at(Motion(time, q, Eigen::VectorXd::Zero(q.size())));
    table_->of_1.velocity_from_momentum(conditions(time, numbers), q.data(), p.data(), v.data());
    return v;
  }

  /// Whether the mass matrix is regular at time 0.
  bool has_inertia(const Eigen::VectorXd& q) const { return rates(0, q, Eigen::VectorXd::Ones(q.size())).allFinite(); }

  std::optional<double> energy_scale() const override { return std::nullopt; }
  bool loaded() const override { return loaded_; }
  bool damped() const override { return loaded_; }
  /// Forces that depend on time may exchange energy many times within one step of the motion.
  bool balances(Method method) const override { return !info().depends_on_time && Subject::balances(method); }
  std::vector<std::string> expected_trouble(const RunOptions& /*options*/) const override { return {}; }
  bool has_poles() const override { return false; }

  /// `t`, coordinates, their rates, inputs, components of the points, `energy`.
  std::vector<Quantity> motion_quantities() const override {
    constexpr std::string_view axes = "xyz";
    std::vector<Quantity> quantities{{"t", "s", Role::time, "time"}};
    const auto add = [&](std::string name, std::string unit, Role role, std::string meaning) {
      quantities.push_back({std::move(name), std::move(unit), role, std::move(meaning), quantities.size()});
    };
    const std::size_t count = info().coordinates.size();
    for (std::size_t k = 0; k < count; ++k) {
      const std::string name(info().coordinates[k]);
      add(name, std::string(info().coordinate_units[k]), Role::coordinate, "coordinate " + name);
    }
    for (std::size_t k = 0; k < count; ++k) {
      const std::string name(info().coordinates[k]);
      add(rate_name(name), rate_unit(info().coordinate_units[k]), Role::rate, "rate of " + name);
    }
    for (std::size_t k = 0; k < info().inputs.size(); ++k) {
      const std::string name(info().inputs[k]);
      add(name, std::string(info().input_units[k]), Role::input, "input " + name);
    }
    for (std::size_t k = 0; k < info().points.size(); ++k) {
      const std::string point(info().points[k]);
      for (int axis = 0; axis < info().point_sizes[k]; ++axis) {
        const std::string name(1, axes[static_cast<std::size_t>(axis)]);
        add(std::string(point).append("_").append(name), "m", Role::point,
            std::string(name).append(" of the point ").append(point));
      }
    }
    for (std::size_t k = 0; k < info().constraints.size(); ++k) {
      const std::string name(info().constraints[k]), unit(info().constraint_units[k]);
      const bool is_one = unit.find_first_of(" */") == std::string::npos;  // m, m^2
      const std::string over = unit == "1" || unit.empty() ? "" : is_one ? "/" + unit : "/(" + unit + ")";
      add("force_" + name, (info().constraint_is_of_rates[k] ? "W" : "J") + over, Role::force,
          "force of the constraint " + name);
    }
    add("energy", "J", Role::energy, "energy v dL/dv - L");
    return quantities;
  }

  std::shared_ptr<Subject> copy() const override {
    return std::make_shared<SystemSubject>(table_, numbers_, feedback_);
  }
  std::shared_ptr<const Subject> with_inputs(std::span<const double> inputs,
                                             std::span<const InputSine> added) const override {
    SystemNumbers numbers = numbers_;
    numbers.inputs.assign(inputs.begin(), inputs.end());
    numbers.sines.insert(numbers.sines.end(), added.begin(), added.end());
    return std::make_shared<SystemSubject>(table_, std::move(numbers), feedback_);
  }

  void append_motion_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    row.push_back(motion.time);
    row.insert(row.end(), motion.q.begin(), motion.q.end());
    row.insert(row.end(), motion.v.begin(), motion.v.end());
    append_inputs(motion, row);
    row.insert(row.end(), seen.points.begin(), seen.points.end());
    row.insert(row.end(), seen.forces.begin(), seen.forces.end());
    row.push_back(seen.energy);
  }

  void close(Motion& state) const override;  // in assembly.cpp

  std::vector<std::size_t> fed_columns() const override {
    std::vector<std::size_t> columns;
    columns.reserve(feedback_.size());
    for (const InputFunction& one : feedback_) columns.push_back(1 + 2 * info().coordinates.size() + one.input);
    return columns;
  }

  /// The parameters of the model.
  std::vector<Constant> constants() const override {
    std::vector<Constant> constants;
    auto next = numbers_.parameters.begin();
    for (std::size_t k = 0; k < info().own_parameters(); ++k) {
      const std::string name(info().parameters[k]);
      const auto end = next + info().parameter_sizes[k];
      constants.push_back(
          {name, std::string(info().parameter_units[k]), "parameter " + name, {next, end}, info().is_per_link[k]});
      next = end;
    }
    return constants;
  }

  std::span<const std::string_view> coordinates() const override { return info().coordinates; }

  /// The last point, or the first coordinates of a system without points.
  std::pair<std::size_t, std::size_t> shown_columns() const override {
    const std::size_t count = info().coordinates.size();
    if (info().points.empty()) return {1, std::min<std::size_t>(count, 3)};
    const auto last = static_cast<std::size_t>(info().point_sizes.back());
    const std::size_t before = 1 + 2 * count + info().inputs.size();
    return {before + static_cast<std::size_t>(point_components()) - last, last};
  }

  using Subject::distance;
  /// The largest difference of coordinates and of rates. Coordinates are relative to the largest of their unit, angles
  /// at least to one radian. Rates are relative to the fastest of their unit, at least to one that moves a coordinate
  /// by a hundredth of its scale until the end, since rates at rest are mere rounding.
  double distance(const Motion& a, const Motion& b, const Motion& size) const override {
    double furthest = 0;
    const auto compare = [&](double x, double y, double scale) {
      if (x != y) furthest = std::max(furthest, std::abs(x - y) / scale);
    };
    for (std::size_t k = 0; k < info().coordinates.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const std::string_view unit = info().coordinate_units[k];
      const double whole = std::max(info().is_angle[k] ? 1.0 : 0.0, largest(size.q, unit));
      compare(a.q[i], b.q[i], whole);
      compare(a.v[i], b.v[i], std::max(size.time > 0 ? 0.01 * whole / size.time : 0, largest(size.v, unit)));
    }
    return furthest;
  }

 private:
  void require_size(const char* what, std::size_t got, std::size_t expected) const {
    if (got == expected) return;
    throw std::invalid_argument(std::string(what) + ": expected " + std::to_string(expected) + " numbers for " +
                                std::string(info().name) + ", got " + std::to_string(got));
  }

  // λ of a state, by which it stays on the constraints.
  Eigen::VectorXd constraint_forces(const Motion& motion, const SystemNumbers& numbers) const {
    SystemAt<1> here(SystemModel(*table_, numbers.plain()));
    here.set_time(motion.time);
    ConstraintForces constraints(info());
    Eigen::VectorXd a(motion.q.size()), lambda(std::ssize(info().constraints));
    here(&SystemFunctions::acceleration, motion.q.data(), motion.v.data(), a.data());
    constraints.look(here, motion.q.data());
    constraints.find(here, motion.q.data(), motion.v.data(), a.data(), lambda.data());
    return lambda;
  }

  // For functions that do not depend on inputs; both must outlive the result.
  Conditions conditions(const double& time, const SystemNumbers& numbers) const {
    return {table_->context, numbers.parameters.data(), &time, numbers.inputs.data()};
  }

  SwitchingSystem switching() const { return {*table_, numbers_}; }

  void append_inputs(const Motion& motion, std::vector<double>& row) const {
    const std::size_t first = row.size();
    row.insert(row.end(), numbers_.inputs.begin(), numbers_.inputs.end());
    for (const InputSine& sine : numbers_.sines) {
      row[first + static_cast<std::size_t>(sine.input)] +=
          sine.amplitude * std::sin(sine.frequency * motion.time + sine.phase);
    }
    for (const InputFunction& one : feedback_) row[first + one.input] += one.value(motion);
  }

  int point_components() const { return std::accumulate(info().point_sizes.begin(), info().point_sizes.end(), 0); }

  // The largest entry among coordinates of one unit.
  double largest(const Eigen::VectorXd& sizes, std::string_view unit) const {
    double largest = 0;
    for (std::size_t k = 0; k < info().coordinates.size(); ++k) {
      if (info().coordinate_units[k] == unit) largest = std::max(largest, sizes[static_cast<Eigen::Index>(k)]);
    }
    return largest;
  }

  std::shared_ptr<const SystemTable> table_;
  SystemNumbers numbers_;
  std::vector<InputFunction> feedback_;
  bool loaded_ = false;
};

}  // namespace pendula
