#pragma once

#include <memory>
#include <pendula/chain.hpp>
#include <pendula/kernel_registry.hpp>
#include <pendula/options.hpp>
#include <pendula/outcome.hpp>
#include <pendula/state.hpp>
#include <stdexcept>
#include <string>
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
  virtual ~Integrator() = default;

  /// Starts a run. Fails where the method's coordinates do (at a pole).
  virtual Outcome start(const State<Space>& state) = 0;

  /// Advances by `h`; an adaptive method takes one accepted step of its own size, at most `h`. On failure the state
  /// stays what it was.
  virtual Outcome step(double h) = 0;

  virtual double time() const = 0;
  virtual State<Space> state() const = 0;
  virtual const Statistics& statistics() const = 0;
  virtual Description describe() const = 0;
};

/// Thrown where a run needs a fixed-n kernel that this build does not have.
class NoKernel : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The integrator that `options` ask for. Throws NoKernel, naming the PENDULA_KERNELS to configure, where a dense
/// kernel is needed and not built in; std::invalid_argument for options that make no sense.
template <class Space>
std::unique_ptr<Integrator<Space>> make_integrator(const Chain<Space>& chain, const RunOptions& options);

extern template std::unique_ptr<Integrator<Planar>> make_integrator(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<Integrator<Spatial>> make_integrator(const Chain<Spatial>&, const RunOptions&);

/// The fixed-n kernels in this build, by space and number of links.
std::vector<KernelInfo> built_in_kernels();

}  // namespace pendula
