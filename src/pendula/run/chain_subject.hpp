#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/subject.hpp>

namespace pendula {

/// A chain as what a run moves.
template <class Space>
class ChainSubject : public Subject {
 public:
  explicit ChainSubject(const Chain<Space>& chain) : chain_(chain) {}

  const Chain<Space>& chain() const { return chain_; }

  std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
    return pendula::make_integrator(chain_, options);
  }

  Observation observe(const Motion& motion) const override {
    const Energies<double> found = energies(chain_, motion);
    return {bob_positions(chain_, motion).reshaped(), found.kinetic, found.total()};
  }

  std::optional<double> energy_scale() const override { return pendula::energy_scale(chain_); }
  bool loaded() const override { return chain_.loaded(); }
  bool damped() const override { return chain_.damped(); }

  /// Damping so strong that a Gauss step does not follow it: Gauss methods are A-stable, but do not damp what they do
  /// not resolve. The rate is that of a link alone, λ/l² (1/m_i + 1/m_{i−1}).
  std::vector<std::string> expected_trouble(const RunOptions& options) const override {
    if (options.method != Method::gauss) return {};
    static constexpr double followed = 5;  // of one step, where e^{-x} is 0.7 %
    for (int i = 0; i < chain_.links(); ++i) {
      const double inverse_mass = 1 / chain_.masses()[i] + (i == 0 ? 0 : 1 / chain_.masses()[i - 1]);
      const double rate = chain_.damping()[i] * inverse_mass / (chain_.lengths()[i] * chain_.lengths()[i]);
      if (rate * options.step <= followed) continue;
      return {"damping stops link " + std::to_string(i + 1) + " within " + shortest(1 / rate) +
              " s, far less than run.step: its velocities may be wrong; run.method = \"radau\" is made for that"};
    }
    return {};
  }

  bool has_poles() const override { return Space::dof == 2; }

  /// `t`, per link `theta_i` (`phi_i`) `theta_dot_i` (`phi_dot_i`), bobs `x_i` `y_i` (`z_i`), `energy`.
  std::vector<Quantity> quantities() const override {
    constexpr std::array<std::string_view, 2> angles = {"theta", "phi"};
    constexpr std::array<std::string_view, 3> axes = {"x", "y", "z"};
    const auto links = static_cast<std::size_t>(chain_.links());
    std::vector<Quantity> quantities{{"t", "s"}};
    std::size_t first = 1;
    for (std::size_t a = 0; a < Space::dof; ++a) {
      quantities.push_back({std::string(angles[a]), "rad", first++, links, 2 * Space::dof});
    }
    for (std::size_t a = 0; a < Space::dof; ++a) {
      quantities.push_back({std::string(angles[a]) + "_dot", "rad/s", first++, links, 2 * Space::dof});
    }
    first = 1 + 2 * Space::dof * links;
    for (std::size_t axis = 0; axis < Space::dimension; ++axis) {
      quantities.push_back({std::string(axes[axis]), "m", first++, links, Space::dimension});
    }
    quantities.push_back({"energy", "J", 1 + (2 * Space::dof + Space::dimension) * links});
    return quantities;
  }

  void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    const int links = chain_.links();
    row.push_back(motion.time);
    for (int link = 0; link < links; ++link) {
      for (int a = 0; a < Space::dof; ++a) row.push_back(motion.q[a * links + link]);
      for (int a = 0; a < Space::dof; ++a) row.push_back(motion.v[a * links + link]);
    }
    row.insert(row.end(), seen.points.begin(), seen.points.end());
    row.push_back(seen.energy);
  }

  std::span<const std::string_view> coordinates() const override { return {}; }

  /// The last bob.
  std::pair<std::size_t, std::size_t> shown_columns() const override {
    constexpr std::size_t dimension = Space::dimension;
    const auto links = static_cast<std::size_t>(chain_.links());
    return {1 + 2 * Space::dof * links + dimension * (links - 1), dimension};
  }

  /// Of bobs relative to the length of the chain, and of their velocities to the fastest.
  double distance(const Motion& a, const Motion& b) const override {
    const auto furthest = [](const auto& x) { return x.colwise().norm().maxCoeff(); };
    const auto v = bob_velocities(chain_, a);
    const double position = furthest(bob_positions(chain_, a) - bob_positions(chain_, b)) / chain_.lengths().sum();
    const double natural = std::sqrt(std::abs(chain_.gravity()) * chain_.lengths().sum());
    const double speed = std::max(furthest(v), 0.1 * natural);
    const double velocity = furthest(v - bob_velocities(chain_, b));
    return position + (velocity == 0 ? 0 : velocity / speed);
  }

 private:
  Chain<Space> chain_;
};

}  // namespace pendula
