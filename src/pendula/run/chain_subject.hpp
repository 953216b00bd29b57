#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/end_force.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/subject.hpp>

namespace pendula {

/// A chain as the subject of a run.
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
    return {bob_positions(chain_, motion).reshaped(), found.kinetic, found.total(), end_force(chain_, motion)};
  }

  std::optional<double> energy_scale() const override { return pendula::energy_scale(chain_); }
  bool loaded() const override { return chain_.exchanges_energy(); }
  bool damped() const override { return chain_.damped(); }

  /// Warns of damping too strong for Gauss steps to follow: Gauss methods are A-stable, but not L-stable. The decay
  /// rate is that of a single link, λ/l² (1/m_i + 1/m_{i−1}).
  std::vector<std::string> expected_trouble(const RunOptions& options) const override {
    if (options.method != Method::gauss) return {};
    static constexpr double followed = 5;  // decay exponent of one step; e^{−5} is 0.7 %
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
  std::vector<Quantity> motion_quantities() const override {
    constexpr std::array<std::array<std::string_view, 2>, 2> angles = {
        {{"theta", "angle of the rod from the downward vertical"}, {"phi", "angle of the rod around the vertical"}}};
    const auto links = static_cast<std::size_t>(chain_.links());
    std::vector<Quantity> quantities{{"t", "s", Role::time, "time"}};
    std::size_t first = 1;
    for (std::size_t a = 0; a < Space::dof; ++a) {
      quantities.push_back({std::string(angles[a][0]), "rad", Role::coordinate, std::string(angles[a][1]), first++,
                            links, 2 * Space::dof});
    }
    for (std::size_t a = 0; a < Space::dof; ++a) {
      const std::string angle(angles[a][0]);
      quantities.push_back({rate_name(angle), "rad/s", Role::rate, "rate of " + angle, first++, links, 2 * Space::dof});
    }
    first = 1 + 2 * Space::dof * links;
    for (const std::string_view axis : axes()) {
      quantities.push_back({std::string(axis), "m", Role::point, std::string(axis).append(" of the bob"), first++,
                            links, Space::dimension});
    }
    std::size_t last = 1 + (2 * Space::dof + Space::dimension) * links;
    if (chain_.is_held()) {
      for (const std::string_view axis : axes()) {
        quantities.push_back({"force_end_" + std::string(axis), "N", Role::force,
                              std::string(axis) + " of the force that holds the last bob", last++});
      }
    }
    quantities.push_back({"energy", "J", Role::energy, "energy T + U", last});
    return quantities;
  }

  /// Masses, lengths, gravity, damping and the constant part of torques; without drives.
  std::vector<Constant> constants() const override {
    const auto numbers = [](const auto& vector) { return std::vector<double>(vector.begin(), vector.end()); };
    std::vector<Constant> constants{{"masses", "kg", "mass of the bob", numbers(chain_.masses()), true},
                                    {"lengths", "m", "length of the rod", numbers(chain_.lengths()), true},
                                    {"gravity", "m/s^2", "acceleration of gravity", {chain_.gravity()}},
                                    {"damping", "N m s/rad", "what the angular velocity of the link is damped by",
                                     numbers(chain_.damping()), true}};
    for (std::size_t k = 0; k < Space::torque_components; ++k) {
      const std::string of = Space::torque_components == 1 ? "" : std::string("_").append(axes()[k]);
      constants.push_back({"torque" + of, "N m", "constant torque on the link, without drives",
                           numbers(chain_.constant_torque().row(static_cast<Eigen::Index>(k))), true});
    }
    return constants;
  }

  std::shared_ptr<Subject> copy() const override { return std::make_shared<ChainSubject>(chain_); }
  std::shared_ptr<const Subject> with_inputs(std::span<const double> inputs,
                                             std::span<const InputSine> added) const override {
    ChainParameters<Space> parameters{chain_.masses(), chain_.lengths(), chain_.gravity(), chain_.damping()};
    parameters.torque.resize(Space::torque_components, chain_.links());
    std::ranges::copy(inputs, parameters.torque.data());
    parameters.drives = chain_.drives();
    parameters.end = chain_.end();
    for (const InputSine& sine : added) {
      Drive<Space> drive;
      drive.link = sine.input / Space::torque_components;
      drive.frequency = sine.frequency;
      drive.phase = sine.phase;
      drive.amplitude.setZero();
      drive.amplitude[sine.input % Space::torque_components] = sine.amplitude;
      parameters.drives.push_back(drive);
    }
    return std::make_shared<ChainSubject>(Chain<Space>(std::move(parameters)));
  }

  void append_motion_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    const int links = chain_.links();
    row.push_back(motion.time);
    for (int link = 0; link < links; ++link) {
      for (int a = 0; a < Space::dof; ++a) row.push_back(motion.q[a * links + link]);
      for (int a = 0; a < Space::dof; ++a) row.push_back(motion.v[a * links + link]);
    }
    row.insert(row.end(), seen.points.begin(), seen.points.end());
    row.insert(row.end(), seen.forces.begin(), seen.forces.end());
    row.push_back(seen.energy);
  }

  std::span<const std::string_view> coordinates() const override { return {}; }

  /// Columns of the last bob.
  std::pair<std::size_t, std::size_t> shown_columns() const override {
    constexpr std::size_t dimension = Space::dimension;
    const auto links = static_cast<std::size_t>(chain_.links());
    return {1 + 2 * Space::dof * links + dimension * (links - 1), dimension};
  }

  using Subject::distance;
  /// The sum of two numbers. The first is the larger of the distance of bobs, relative to the length of the chain, and
  /// that of angles  [rad]; in space of directions, because several pairs of angles stand for one direction. The second
  /// is the larger relative distance of rates: of bobs to the fastest bob of `a`, of rods to its fastest rod, but at
  /// least to a tenth of the chain's swing frequency and a hundredth of the fastest theta in the motion.
  double distance(const Motion& a, const Motion& b, const Motion& size) const override {
    const auto furthest = [](const auto& x) { return x.colwise().norm().maxCoeff(); };
    const auto of = [](double off, double whole) { return off == 0 ? 0 : off / whole; };
    const double length = chain_.lengths().sum();
    const double slowest =
        std::max(0.1 * std::sqrt(std::abs(chain_.gravity()) / length), 0.01 * size.v.head(chain_.links()).maxCoeff());
    const auto velocities = bob_velocities(chain_, a);
    const double bobs = furthest(bob_positions(chain_, a) - bob_positions(chain_, b)) / length;
    const double rates = furthest(velocities - bob_velocities(chain_, b));
    const Turned turned = turned_between(a, b);
    return std::max(bobs, turned.angle) + std::max(of(rates, std::max(furthest(velocities), slowest * length)),
                                                   of(turned.rate, std::max(turned.fastest, slowest)));
  }

 private:
  static std::span<const std::string_view> axes() {
    static constexpr std::array<std::string_view, 3> all = {"x", "y", "z"};
    return std::span(all).first(Space::dimension);
  }

  /// Largest differences of rods' angles and rates, and the fastest rod of the first state.
  struct Turned {
    double angle = 0, rate = 0, fastest = 0;
  };

  Turned turned_between(const Motion& a, const Motion& b) const {
    const int links = chain_.links();
    Turned turned;
    const auto keep = [](double& largest, double value) { largest = std::max(largest, std::abs(value)); };
    for (int i = 0; i < links; ++i) {
      const detail::LinkMotion<Space, double> one(a, links, i), other(b, links, i);
      keep(turned.rate, (one.rate - other.rate).norm());
      keep(turned.fastest, one.rate.norm());
      keep(turned.angle, Space::dof == 2 ? (one.direction - other.direction).norm() : a.q[i] - b.q[i]);
    }
    return turned;
  }

  Chain<Space> chain_;
};

}  // namespace pendula
