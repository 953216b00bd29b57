#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <pendula/explicit/explicit_integrator.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/kernel_registry.hpp>
#include <pendula/system/plain_system.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {

/// The numbers of a system that is no chain.
struct SystemNumbers {
  std::vector<double> parameters, inputs;  ///< in the order of SystemInfo; inputs are their constant part
  std::vector<InputSine> sines;

  /// Lives as long as this.
  PlainSystem plain() const { return {parameters.data(), inputs.data(), sines}; }
};

/// A system of any other kind as what a run moves.
class SystemSubject : public Subject {
 public:
  /// `entry` is kept, with whatever it was loaded from.
  SystemSubject(std::shared_ptr<const SystemEntry> entry, SystemNumbers numbers)
      : entry_(std::move(entry)), numbers_(std::move(numbers)) {}

  const SystemEntry& entry() const { return *entry_; }
  const SystemInfo& info() const { return entry_->info; }
  const SystemNumbers& numbers() const { return numbers_; }

  std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
    const int count = static_cast<int>(info().coordinates.size());
    if (options.solver == Solver::chain) {
      throw std::invalid_argument("solver: the chain solver is for chains, got chain; dense is for any system");
    }
    std::unique_ptr<PlainIntegrator> integrator =
        is_explicit(options.method)
            ? make_explicit_integrator(entry_->dynamics(numbers_.plain()), count, count, options, info().name)
            : entry_->make(numbers_.plain(), options);
    return std::make_unique<Integrator>(std::move(integrator), count, "system");
  }

  Observation observe(const Motion& motion) const override {
    Observation seen;
    seen.points.resize(point_components());
    const SystemEnergies energies =
        entry_->observe(numbers_.plain(), motion.time, motion.q.data(), motion.v.data(), seen.points.data());
    seen.kinetic = energies.kinetic;
    seen.energy = energies.total;
    return seen;
  }

  /// Rates that go with momenta; not finite where the mass matrix is singular.
  Eigen::VectorXd rates(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& p) const {
    Eigen::VectorXd v(q.size());
    entry_->rates(numbers_.plain(), time, q.data(), p.data(), v.data());
    return v;
  }

  std::optional<double> energy_scale() const override { return std::nullopt; }
  bool loaded() const override { return entry_->loaded(numbers_.plain()); }
  bool damped() const override { return loaded(); }
  std::vector<std::string> expected_trouble(const RunOptions& /*options*/) const override { return {}; }
  bool has_poles() const override { return false; }

  /// `t`, coordinates, their rates, components of the points, `energy`.
  std::vector<Quantity> quantities() const override {
    constexpr std::string_view axes = "xyz";
    std::vector<Quantity> quantities{{"t", "s"}};
    const auto add = [&](std::string name, std::string unit) {
      quantities.push_back({std::move(name), std::move(unit), quantities.size()});
    };
    const std::size_t count = info().coordinates.size();
    for (std::size_t k = 0; k < count; ++k) {
      add(std::string(info().coordinates[k]), std::string(info().coordinate_units[k]));
    }
    for (std::size_t k = 0; k < count; ++k) {
      add(std::string(info().coordinates[k]) + "_dot", std::string(info().coordinate_units[k]) + "/s");
    }
    for (std::size_t k = 0; k < info().points.size(); ++k) {
      for (int axis = 0; axis < info().point_sizes[k]; ++axis) {
        add(std::string(info().points[k]) + "_" + axes[static_cast<std::size_t>(axis)], "m");
      }
    }
    add("energy", "J");
    return quantities;
  }

  void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    row.push_back(motion.time);
    row.insert(row.end(), motion.q.begin(), motion.q.end());
    row.insert(row.end(), motion.v.begin(), motion.v.end());
    row.insert(row.end(), seen.points.begin(), seen.points.end());
    row.push_back(seen.energy);
  }

  std::span<const std::string_view> coordinates() const override { return info().coordinates; }

  /// The last point; of a system without points its first coordinates.
  std::pair<std::size_t, std::size_t> shown_columns() const override {
    const std::size_t count = info().coordinates.size();
    if (info().points.empty()) return {1, std::min<std::size_t>(count, 3)};
    const auto last = static_cast<std::size_t>(info().point_sizes.back());
    return {1 + 2 * count + static_cast<std::size_t>(point_components()) - last, last};
  }

  /// Of coordinates relative to the largest, angles at least to one radian, and of rates to the fastest, each in its
  /// own unit.
  double distance(const Motion& a, const Motion& b) const override {
    double furthest = 0;
    const auto compare = [&](double x, double y, double size) {
      if (x != y) furthest = std::max(furthest, std::abs(x - y) / size);
    };
    for (std::size_t k = 0; k < info().coordinates.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      compare(a.q[i], b.q[i], std::max(info().is_angle[k] ? 1.0 : 0.0, largest(a.q, b.q, info().coordinate_units[k])));
      compare(a.v[i], b.v[i], largest(a.v, b.v, info().coordinate_units[k]));
    }
    return furthest;
  }

 private:
  int point_components() const { return std::accumulate(info().point_sizes.begin(), info().point_sizes.end(), 0); }

  // Among the coordinates of one unit.
  double largest(const Eigen::VectorXd& a, const Eigen::VectorXd& b, std::string_view unit) const {
    double largest = 0;
    for (std::size_t k = 0; k < info().coordinates.size(); ++k) {
      if (info().coordinate_units[k] != unit) continue;
      const auto i = static_cast<Eigen::Index>(k);
      largest = std::max({largest, std::abs(a[i]), std::abs(b[i])});
    }
    return largest;
  }

  std::shared_ptr<const SystemEntry> entry_;
  SystemNumbers numbers_;
};

}  // namespace pendula
