#pragma once

#include <array>
#include <memory>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/plain_system.hpp>
#include <string_view>

namespace pendula {

struct PlainChain;
class ForwardDynamics;
class LaneDynamics;

/// Makes a kernel's accelerations of several members at once (lane_dynamics.hpp).
using MakeLaneDynamics = std::unique_ptr<LaneDynamics>();

/// Every function of a system's kernel at one point (kernel_values.hpp).
using EvaluateKernel = void(const PlainSystem&, double time, const double* q, const double* v, const double* a,
                            double* values);

/// What a check of a generated kernel measured.
struct KernelCheck {
  /// One statement about the kernel, the largest error found in it, and what that may be.
  struct Line {
    std::string_view what;
    double error = 0;
    double limit = 0;
  };

  std::array<Line, 10> lines;
  int count = 0;
};

/// A fixed-n kernel of a chain.
struct KernelInfo {
  std::string_view name;   ///< "planar_2"
  std::string_view space;  ///< "planar" or "spatial"
  int links = 0;
};

/// A fixed-n kernel, and what was compiled from it.
struct KernelEntry {
  KernelInfo info;
  std::unique_ptr<PlainIntegrator> (*make)(const PlainChain&, const RunOptions&);
  KernelCheck (*check)(unsigned seed);
};

/// Energies of a system in one state  [J].
struct SystemEnergies {
  double kinetic = 0;  ///< T = ½ vᵀ M v
  double total = 0;    ///< h = v·∂L/∂v − L
};

/// The kernel of any other system, and what was compiled from it.
struct SystemEntry {
  SystemInfo info;
  std::unique_ptr<PlainIntegrator> (*make)(const PlainSystem&, const RunOptions&);  ///< of implicit methods
  std::unique_ptr<ForwardDynamics> (*dynamics)(const PlainSystem&);
  EvaluateKernel* evaluate;
  /// Energies in one state, and the components of its points, one after the other.
  SystemEnergies (*observe)(const PlainSystem&, double time, const double* q, const double* v, double* points);
  /// Rates that go with momenta p; not finite where the mass matrix is singular.
  void (*rates)(const PlainSystem&, double time, const double* q, const double* p, double* v);
  /// Whether energy may come from outside, or go there.
  bool (*loaded)(const PlainSystem&);
  MakeLaneDynamics* lanes;
};

/// Layout of what crosses to a kernel that was compiled by itself: SystemEntry and all that it leads to.
inline constexpr int system_interface = 9;

}  // namespace pendula
