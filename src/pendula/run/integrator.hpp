#pragma once

#include <Eigen/Core>
#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/run/library.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pendula {

/// What really runs, where the options left it open.
struct Description {
  std::string solver;     ///< "dense" or "chain"; empty for explicit methods
  std::string iteration;  ///< "newton" or "fixed-point"; empty for explicit methods
  std::string kernel;     ///< the fixed-n kernel in use, or empty
};

/// Any method on any system, chosen at run time.
class Integrator {
 public:
  /// `coordinates` is how many the system has; `system` how messages call it.
  Integrator(std::unique_ptr<PlainIntegrator> integrator, Eigen::Index coordinates, std::string_view system)
      : integrator_(std::move(integrator)), coordinates_(coordinates), system_(system) {}

  /// Starts a run. Fails where the method's coordinates do (at a pole). Throws std::invalid_argument on another number
  /// of coordinates.
  Outcome start(const Motion& motion) {
    require_size("coordinates", motion.q.size());
    require_size("rates", motion.v.size());
    return integrator_->start(motion.time, motion.q.data(), motion.v.data());
  }

  /// Advances by `h`; an adaptive method takes one accepted step of its own size, at most `h`. On failure the state
  /// stays what it was.
  Outcome step(double h) { return integrator_->step(h); }

  double time() const { return integrator_->time(); }

  Motion state() const {
    Motion motion(time(), Eigen::VectorXd(coordinates_), Eigen::VectorXd(coordinates_));
    integrator_->read_state(motion.q.data(), motion.v.data());
    return motion;
  }

  const Statistics& statistics() const { return integrator_->statistics(); }

  /// A copy of all that the next steps depend on.
  Member member() const { return member_of(*integrator_); }

  /// Goes on where the integrator was that `member` is a copy of, to the last bit; instead of `start`. That the system
  /// and the options are the same is the caller's to know: refused, by std::invalid_argument, is only another number of
  /// numbers.
  void resume(const Member& member) { become(*integrator_, member); }

  Description describe() const {
    const auto [solver, iteration, kernel] = integrator_->describe();
    return {std::string(solver), std::string(iteration), std::string(kernel)};
  }

 private:
  void require_size(const char* what, Eigen::Index got) const {
    if (got == coordinates_) return;
    throw std::invalid_argument(std::string("state: ") + what + ": expected " + std::to_string(coordinates_) +
                                " numbers for this " + system_ + ", got " + std::to_string(got));
  }

  std::unique_ptr<PlainIntegrator> integrator_;
  Eigen::Index coordinates_;
  std::string system_;
};

/// Thrown where a run needs a fixed-n kernel that this build does not have.
class NoKernel : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The integrator of the method that `options` ask for (Integrator::step is told its size), of the compiled library for
/// this processor. Throws NoKernel, naming the PENDULA_KERNELS to configure, where a dense kernel is needed and not
/// built in; std::invalid_argument for options that make no sense, and for a PENDULA_ARCH as library() does.
template <class Space>
std::unique_ptr<Integrator> make_integrator(const Chain<Space>& chain, const RunOptions& options) {
  const std::vector<PlainChain::Drive> drives = plain_drives(chain);
  return std::make_unique<Integrator>(library_of<Space>().make_integrator(plain(chain, drives), options),
                                      Space::dof * chain.links(), "chain");
}

/// The fixed-n kernels in this build, by space and number of links.
inline std::vector<KernelInfo> built_in_kernels() {
  std::vector<KernelInfo> kernels;
  for (const KernelEntry& entry : library().planar.kernels) kernels.push_back(entry.info);
  for (const KernelEntry& entry : library().spatial.kernels) kernels.push_back(entry.info);
  return kernels;
}

}  // namespace pendula
