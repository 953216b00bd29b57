#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <pendula/chain/chain_end.hpp>
#include <pendula/chain/space.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// A torque amplitude · sin(frequency t + phase) on one link, added to the constant torque.
template <class Space>
struct Drive {
  int link = 0;                                                  ///< 0-based
  Eigen::Matrix<double, Space::torque_components, 1> amplitude;  ///< N m
  double frequency = 0;                                          ///< rad/s
  double phase = 0;                                              ///< rad
};

/// The parameters of a chain; `Chain` checks them.
template <class Space, int N = Eigen::Dynamic>
struct ChainParameters {
  LinkVector<N> masses;   ///< bobs, (n)  kg
  LinkVector<N> lengths;  ///< rods, (n)  m
  double gravity = 9.81;  ///< m/s²
  /// λ, (n) or empty for none  N m s
  LinkVector<N> damping = LinkVector<N>::Zero(at_first);
  /// Constant torque, or empty for none  N m
  Torque<Space, N> torque = Torque<Space, N>::Zero(Space::torque_components, at_first);
  std::vector<Drive<Space>> drives = {};  ///< sinusoidal torques
  /// What holds the last bob; nothing for one that hangs free.
  std::optional<ChainEnd> end = {};  // NOLINT(readability-redundant-member-init): GCC warns where it is left out

 private:
  static constexpr Eigen::Index at_first = N == Eigen::Dynamic ? 0 : N;
};

/// A chain of pendulums: immutable, and valid once built.
///
/// N is the number of links where it is known at compile time; with Eigen::Dynamic it follows from the parameters.
template <class Space, int N = Eigen::Dynamic>
class Chain {
 public:
  /// Throws std::invalid_argument, naming the parameter and link, for sizes that differ, masses or lengths that are not
  /// positive, negative damping, drives on links that do not exist, and numbers that are not finite.
  explicit Chain(ChainParameters<Space, N> parameters) : parameters_(fill(std::move(parameters))) {
    validate();
    mass_below_.resize(links());
    double sum = 0;
    for (int i = links(); i-- > 0;) mass_below_[i] = sum += masses()[i];
    for (int i = 0; i < links(); ++i) loaded_ = loaded_ || damping()[i] != 0 || !torque_is_zero(i);
    loaded_ = loaded_ || driven();
  }

  int links() const { return static_cast<int>(parameters_.masses.size()); }
  const LinkVector<N>& masses() const { return parameters_.masses; }
  const LinkVector<N>& lengths() const { return parameters_.lengths; }
  const LinkVector<N>& damping() const { return parameters_.damping; }
  double gravity() const { return parameters_.gravity; }
  const std::vector<Drive<Space>>& drives() const { return parameters_.drives; }

  /// M_d = Σ_{i≥d} m_i, the mass that rod d carries (paper eq. 7).
  const LinkVector<N>& mass_below() const { return mass_below_; }

  /// Whether the torque depends on time.
  bool driven() const { return !parameters_.drives.empty(); }

  /// Highest frequency of a drive or of the end; 0 where there is none  [rad/s].
  double fastest_drive() const {
    double fastest = 0;
    for (const Drive<Space>& drive : drives()) {
      if (drive.amplitude.any()) fastest = std::max(fastest, std::abs(drive.frequency));
    }
    return end() ? std::max(fastest, end()->fastest()) : fastest;
  }

  /// Whether anything but gravity acts on links: damping, torque or a drive.
  bool loaded() const { return loaded_; }

  /// What holds the last bob; nothing where it hangs free.
  const std::optional<ChainEnd>& end() const { return parameters_.end; }
  bool is_held() const { return end().has_value(); }
  /// Whether energy is not conserved: by loads, or by an end that moves.
  bool exchanges_energy() const { return loaded_ || (end() && end()->moves()); }
  /// Coordinates less the constraints by the end.
  int degrees_of_freedom() const { return Space::dof * links() - (is_held() ? Space::dimension : 0); }

  /// Whether damping acts.
  bool damped() const { return (damping().array() != 0).any(); }

  /// Constant torque without the drives, (torque_components x n)  [N m].
  const Torque<Space, N>& constant_torque() const { return parameters_.torque; }

  /// Torque on every link at `time`, (torque_components x n)  [N m], into a matrix of fixed or run-time size.
  template <class Derived>
  void torque(double time, Eigen::PlainObjectBase<Derived>& torque) const {
    torque = parameters_.torque;
    for (const Drive<Space>& drive : drives()) {
      torque.col(drive.link) += std::sin(drive.frequency * time + drive.phase) * drive.amplitude;
    }
  }

 private:
  static ChainParameters<Space, N> fill(ChainParameters<Space, N> parameters) {
    const auto links = parameters.masses.size();
    if constexpr (N == Eigen::Dynamic) {
      if (parameters.damping.size() == 0) parameters.damping.setZero(links);
      if (parameters.torque.cols() == 0) parameters.torque.setZero(Space::torque_components, links);
    }
    return parameters;
  }

  bool torque_is_zero(int link) const { return (parameters_.torque.col(link).array() == 0).all(); }

  [[noreturn]] static void reject(const std::string& what) { throw std::invalid_argument("chain: " + what); }

  static void require_size(const char* name, Eigen::Index got, Eigen::Index links) {
    if (got == links) return;
    reject(std::string(name) + ": expected one entry for each of the " + std::to_string(links) + " links, got " +
           std::to_string(got));
  }

  template <class Accept>
  static void require(const char* name, const LinkVector<N>& values, const char* expected, Accept accept) {
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      if (accept(values[i])) continue;
      reject(std::string(name) + " of link " + std::to_string(i + 1) + ": expected " + expected + ", got " +
             std::to_string(values[i]));
    }
  }

  void validate() const {
    if (links() < 1) reject("masses: expected at least one link, got none");
    require_size("lengths", lengths().size(), links());
    require_size("damping", damping().size(), links());
    require_size("torque", parameters_.torque.cols(), links());
    const auto positive = [](double x) { return std::isfinite(x) && x > 0; };
    require("masses", masses(), "a positive finite number", positive);
    require("lengths", lengths(), "a positive finite number", positive);
    require("damping", damping(), "a finite number, not negative", [](double x) { return std::isfinite(x) && x >= 0; });
    if (!std::isfinite(gravity())) reject("gravity: expected a finite number");
    if (!parameters_.torque.allFinite()) reject("torque: expected finite numbers");
    for (const Drive<Space>& drive : drives()) validate(drive);
    if (end()) validate(*end());
  }

  void validate(const ChainEnd& end) const {
    if (links() < 2) reject("end: expected two links at least where the last bob is held, got one");
    for (const auto* numbers : {&end.at, &end.amplitude, &end.frequency, &end.phase}) {
      if (!std::ranges::all_of(*numbers, [](double x) { return std::isfinite(x); })) {
        reject("end: expected finite numbers");
      }
    }
  }

  void validate(const Drive<Space>& drive) const {
    if (drive.link < 0 || drive.link >= links()) {
      reject("drive: expected a link from 1 to " + std::to_string(links()) + ", got " + std::to_string(drive.link + 1));
    }
    if (!drive.amplitude.allFinite() || !std::isfinite(drive.frequency) || !std::isfinite(drive.phase)) {
      reject("drive on link " + std::to_string(drive.link + 1) + ": expected finite numbers");
    }
  }

  ChainParameters<Space, N> parameters_;
  LinkVector<N> mass_below_;
  bool loaded_ = false;
};

}  // namespace pendula
