#pragma once

#include <Eigen/Core>
#include <cmath>
#include <iterator>
#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/plain_chain.hpp>
#include <pendula/numeric/directions.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/no_kernel.hpp>
#include <pendula/run/step_view.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/stop_sign.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pendula {

/// The choices that were made where the options left them open.
struct Description {
  std::string solver;     ///< "dense" or "chain"; empty for explicit methods
  std::string iteration;  ///< "newton" or "fixed-point"; empty for explicit methods
  std::string kernel;     ///< the fixed-n kernel in use, or empty
};

/// Any method on any system, chosen at run time.
class Integrator : public StepView {
 public:
  /// `coordinates` is the number of coordinates; `system` is what messages call the system.
  Integrator(std::unique_ptr<PlainIntegrator> integrator, Eigen::Index coordinates, std::string_view system)
      : integrator_(std::move(integrator)), coordinates_(coordinates), system_(system) {}

  /// Starts a run. Fails where the method's coordinates do (at a pole). Throws std::invalid_argument for a wrong number
  /// of coordinates.
  Outcome start(const Motion& motion) {
    require_size("coordinates", motion.q.size());
    require_size("rates", motion.v.size());
    return integrator_->start(motion.time, motion.q.data(), motion.v.data());
  }

  /// Advances by `h`; an adaptive method takes one accepted step of its own size, at most `h`. On failure the state is
  /// unchanged.
  Outcome step(double h) { return integrator_->step(h); }

  double time() const override { return integrator_->time(); }

  /// Whether the limit `h` of the next step, or of an earlier one, may affect more than the last step of a run. If so,
  /// a longer run has other states on the way.
  bool depends_on_end(double h) const { return integrator_->depends_on_end(h); }

  void read_state(Motion& motion) const override {
    make_room(time(), motion);
    integrator_->read_state(motion.q.data(), motion.v.data());
  }

  /// Whether to remember steps from now on, so that at and at_full_order can go back into the last one; this costs a
  /// copy of the state per step.
  void remember_steps(bool wanted) { integrator_->remember_steps(wanted); }

  using StepView::at;
  void at(double time, Motion& motion) override {
    make_room(time, motion);
    integrator_->at(time, motion.q.data(), motion.v.data());
  }

  bool bound_excursions(Motion& farthest) const override {
    return integrator_->bound_excursions(farthest.q.data(), farthest.v.data());
  }

  /// As StepView says. The integrator is unchanged.
  Outcome at_full_order(double time, Motion& motion) override {
    double work = 0;
    return at_full_order(time, motion, work);
  }

  /// Also sets `work` to the work of loads up to `time`  [J].
  Outcome at_full_order(double time, Motion& motion, double& work) {
    make_room(time, motion);
    return integrator_->at_full_order(time, motion.q.data(), motion.v.data(), work);
  }

  /// From now on, long steps, and those of at_full_order, end with Status::interrupted when `stop` says so. Replaces
  /// and returns the sign used before.
  StopSign set_stop_sign(StopSign stop) {
    integrator_->set_stop_sign(stop);
    return std::exchange(stop_, stop);
  }

  const Statistics& statistics() const { return integrator_->statistics(); }

  /// A copy of everything that the next steps depend on.
  Member member() const { return member_of(*integrator_); }

  /// Continues from `member`, a copy of another integrator's, to the last bit; replaces `start`. The caller must ensure
  /// that the system and the options are the same: std::invalid_argument is thrown only for a wrong number of numbers.
  void resume(const Member& member) { become(*integrator_, member); }

  /// From now on every step keeps its derivative, for `push`. Returns the number of rows of a tangent. Throws
  /// std::invalid_argument for methods without a derivative: explicit ones but Taylor series of kernels, and the
  /// velocity form.
  int linearize() {
    rows_ = integrator_->linearize();
    if (rows_ > 0) return rows_;
    throw std::invalid_argument(
        "tangents: expected method = gauss or radau in momentum form, or taylor of a model or of a chain with a "
        "kernel, up to "
        "ten coordinates; other steps have no derivative");
  }

  /// How many coordinates and rates of the state follow from others by constraints.
  int conditions() const { return integrator_->conditions(); }

  /// The largest z for which a step multiplies a tangent that decays as e^(−z) correctly to `error` in z; valid after
  /// linearize().
  double resolved_decay(double error) const { return integrator_->resolved_decay(error); }

  /// Replaces tangents at the start of the last step, (rows x any), by those at its end, using the exact derivative of
  /// the step. Tangents are in the integrator's own coordinates: for a chain those of chain_tangent.hpp, for a
  /// generated kernel (δq, δp).
  void push(Directions<>& tangents) {
    require("tangents", tangents, rows_, tangents.cols());
    integrator_->push(tangents.data(), static_cast<int>(tangents.cols()), nullptr);
  }

  /// Number of rows of a variation of the parameters; valid after linearize(). The rows are masses, lengths … of a
  /// chain as chain_tangent.hpp numbers them; for a generated kernel its parameters, then its inputs.
  int parameters() { return integrator_->parameters(); }

  /// Also varies the parameters, (parameters x as many).
  void push(Directions<>& tangents, const Directions<>& parameters) {
    require("tangents", tangents, rows_, tangents.cols());
    require("parameters", parameters, this->parameters(), tangents.cols());
    integrator_->push(tangents.data(), static_cast<int>(tangents.cols()), parameters.data());
  }

  /// The transpose of push: replaces gradients with respect to the end of the last step, (rows x any), by those with
  /// respect to its start.
  void pull(Directions<>& gradients) {
    require("gradients", gradients, rows_, gradients.cols());
    integrator_->pull(gradients.data(), static_cast<int>(gradients.cols()), nullptr);
  }

  /// Also adds the gradients with respect to the parameters to `parameters`, (parameters x as many).
  void pull(Directions<>& gradients, Directions<>& parameters) {
    require("gradients", gradients, rows_, gradients.cols());
    require("parameters", parameters, this->parameters(), gradients.cols());
    integrator_->pull(gradients.data(), static_cast<int>(gradients.cols()), parameters.data());
  }

  Description describe() const {
    const auto [solver, iteration, kernel] = integrator_->describe();
    return {std::string(solver), std::string(iteration), std::string(kernel)};
  }

 private:
  void make_room(double time, Motion& motion) const {
    motion.time = time;
    motion.q.resize(coordinates_);
    motion.v.resize(coordinates_);
    const std::span<const double> held = integrator_->held(time);
    motion.held = Eigen::Map<const Eigen::VectorXd>(held.data(), std::ssize(held));
  }

  void require_size(const char* what, Eigen::Index got) const {
    if (got == coordinates_) return;
    throw std::invalid_argument(std::string("state: ") + what + ": expected " + std::to_string(coordinates_) +
                                " numbers for this " + system_ + ", got " + std::to_string(got));
  }

  static void require(const char* what, const Directions<>& got, Eigen::Index rows, Eigen::Index columns) {
    if (got.rows() == rows && got.cols() == columns) return;
    const auto size = [](Eigen::Index of, Eigen::Index by) { return std::to_string(of) + " x " + std::to_string(by); };
    throw std::invalid_argument(std::string(what) + ": expected " + size(rows, columns) + " numbers, got " +
                                size(got.rows(), got.cols()));
  }

  std::unique_ptr<PlainIntegrator> integrator_;
  Eigen::Index coordinates_;
  int rows_ = 0;  // of tangents; 0 before linearize()
  std::string system_;
  StopSign stop_;
};

/// Sets a stop sign of an integrator for a scope.
class ScopedStopSign {
 public:
  ScopedStopSign(Integrator& integrator, StopSign stop)
      : integrator_(integrator), before_(integrator.set_stop_sign(stop)) {}
  ~ScopedStopSign() { integrator_.set_stop_sign(before_); }
  ScopedStopSign(const ScopedStopSign&) = delete;
  ScopedStopSign& operator=(const ScopedStopSign&) = delete;

 private:
  Integrator& integrator_;
  StopSign before_;
};

/// The integrator for `options` from the compiled library for this processor. The step size is given to its step().
/// Throws NoKernel, naming the PENDULA_KERNELS to configure, if a dense kernel is needed that is not built in;
/// std::invalid_argument for options that make no sense, and for a PENDULA_ARCH as library() does.
template <class Space>
std::unique_ptr<Integrator> make_integrator(const Chain<Space>& chain, const RunOptions& options) {
  const std::vector<PlainChain::Drive> drives = plain_drives(chain);
  return std::make_unique<Integrator>(library<ChainMaker<Space>>().make_integrator(plain(chain, drives), options),
                                      Space::dof * chain.links(), "chain");
}

/// A fixed-n kernel of a chain.
struct KernelInfo {
  std::string_view name;   ///< "planar_2"
  std::string_view space;  ///< "planar" or "spatial"
  int links = 0;
};

/// The kernels in this build, by space and number of links.
inline std::vector<KernelInfo> built_in_kernels() {
  std::vector<KernelInfo> kernels;
  for (const auto& tables : {library<KernelList<Planar>>().tables, library<KernelList<Spatial>>().tables}) {
    for (const SystemTable* table : tables) kernels.push_back({table->info.name, table->info.model, table->info.links});
  }
  return kernels;
}

}  // namespace pendula
