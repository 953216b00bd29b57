#pragma once

#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/library.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {

/// What really runs, where the options left it open.
struct Description {
  std::string solver;     ///< "dense" or "chain"; empty for explicit methods
  std::string iteration;  ///< "newton" or "fixed-point"; empty for explicit methods
  std::string kernel;     ///< the fixed-n kernel in use, or empty
};

/// Any method on any chain of a space, the number of links chosen at run time.
template <class Space>
class Integrator {
 public:
  Integrator(std::unique_ptr<PlainIntegrator> integrator, int links)
      : integrator_(std::move(integrator)), coordinates_(Space::dof * links) {}

  /// Starts a run. Fails where the method's coordinates do (at a pole). Throws std::invalid_argument on a state of
  /// another number of links.
  Outcome start(const State<Space>& state) {
    require_size("angles", state.q.size());
    require_size("rates", state.v.size());
    return integrator_->start(state.time, state.q.data(), state.v.data());
  }

  /// Advances by `h`; an adaptive method takes one accepted step of its own size, at most `h`. On failure the state
  /// stays what it was.
  Outcome step(double h) { return integrator_->step(h); }

  double time() const { return integrator_->time(); }

  State<Space> state() const {
    State<Space> state;
    state.time = time();
    state.q.resize(coordinates_);
    state.v.resize(coordinates_);
    integrator_->read_state(state.q.data(), state.v.data());
    return state;
  }

  const Statistics& statistics() const { return integrator_->statistics(); }

  Description describe() const {
    const auto [solver, iteration, kernel] = integrator_->describe();
    return {std::string(solver), std::string(iteration), std::string(kernel)};
  }

 private:
  void require_size(const char* what, Eigen::Index got) const {
    if (got == coordinates_) return;
    throw std::invalid_argument(std::string("state: ") + what + ": expected " + std::to_string(coordinates_) +
                                " numbers for this chain, got " + std::to_string(got));
  }

  std::unique_ptr<PlainIntegrator> integrator_;
  Eigen::Index coordinates_;
};

/// Thrown where a run needs a fixed-n kernel that this build does not have.
class NoKernel : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The integrator that `options` ask for, of the compiled library for this processor. Throws NoKernel, naming the
/// PENDULA_KERNELS to configure, where a dense kernel is needed and not built in; std::invalid_argument for options
/// that make no sense, and for a PENDULA_ARCH as library() does.
template <class Space>
std::unique_ptr<Integrator<Space>> make_integrator(const Chain<Space>& chain, const RunOptions& options) {
  const std::vector<PlainChain::Drive> drives = plain_drives(chain);
  return std::make_unique<Integrator<Space>>(library_of<Space>().make_integrator(plain(chain, drives), options),
                                             chain.links());
}

/// The fixed-n kernels in this build, by space and number of links.
inline std::vector<KernelInfo> built_in_kernels() {
  std::vector<KernelInfo> kernels;
  for (const KernelEntry& entry : library().planar.kernels) kernels.push_back(entry.info);
  for (const KernelEntry& entry : library().spatial.kernels) kernels.push_back(entry.info);
  return kernels;
}

}  // namespace pendula
