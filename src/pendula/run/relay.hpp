#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <memory>
#include <pendula/run/integrator.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <utility>

namespace pendula {

/// Steps by one integrator after another: each continues where the last one ended, for another system.
class Relay : public PlainIntegrator {
 public:
  double time() const override { return now_->time(); }

  void read_state(double* q, double* v) const override { write(now_->state(), q, v); }

  void remember_steps(bool wanted) override {
    remembers_ = wanted;
    now_->remember_steps(wanted);
  }
  void at(double time, double* q, double* v) override { write(of(time).at(time), q, v); }
  bool bound_excursions(double* q, double* v) const override {
    Motion farthest = now_->state();
    if (!(before_ ? *before_ : *now_).bound_excursions(farthest)) return false;
    write(farthest, q, v);
    return true;
  }
  Outcome at_full_order(double time, double* q, double* v, double& work) override {
    const double done = &of(time) == before_.get() ? before_work_ : done_.load_work;
    Motion motion;
    const Outcome looked = of(time).at_full_order(time, motion, work);
    work += done;
    if (looked) write(motion, q, v);
    return looked;
  }

  void set_stop_sign(StopSign stop) override {
    stop_ = stop;
    now_->set_stop_sign(stop);
    if (before_) before_->set_stop_sign(stop);
  }

  const Statistics& statistics() const override { return all_; }

  Description describe() const override {
    described_ = now_->describe();
    return {described_.solver, described_.iteration, described_.kernel};
  }

 protected:
  static void write(const Motion& motion, double* q, double* v) {
    std::ranges::copy(motion.q, q);
    std::ranges::copy(motion.v, v);
  }

  Motion motion_of(double time, const double* q, const double* v) const {
    const Eigen::Index size = now_->state().q.size();
    return {time, Eigen::Map<const Eigen::VectorXd>(q, size), Eigen::Map<const Eigen::VectorXd>(v, size)};
  }

  Integrator& now() { return *now_; }
  const Integrator& now() const { return *now_; }
  bool has_before() const { return before_ != nullptr; }
  bool remembers() const { return remembers_; }

  /// From now on the integrator of the last step is kept until the next step, even if steps are not remembered.
  void keep_last() { keeps_last_ = true; }
  Integrator& last() { return before_ ? *before_ : *now_; }

  /// Replaces the integrator by another that is not started.
  void use(std::unique_ptr<Integrator> integrator) {
    now_ = std::move(integrator);
    now_->remember_steps(remembers_);
    now_->set_stop_sign(stop_);
  }

  Outcome begin(const Motion& motion) {
    done_ = all_ = {};
    before_.reset();
    return now_->start(motion);
  }

  /// Call before a step.
  void forget() { before_.reset(); }
  /// Call after a step, to sum the statistics.
  void count() {
    all_ = done_;
    all_ += now_->statistics();
  }

  /// Continues with the integrator `next` from `motion`. The last one is kept where rows or events may look into its
  /// step.
  Outcome hand_over(std::unique_ptr<Integrator> next, const Motion& motion) {
    before_work_ = done_.load_work;
    done_ = all_;
    if (remembers_ || keeps_last_) before_ = std::move(now_);
    use(std::move(next));
    return now_->start(motion);
  }

  /// Visits the numbers of the present integrator. Call last: others decide which integrator that is.
  void own_member(MemberNumbers& numbers) {
    const Member before = now_->member();
    Member own = before;
    numbers(own.numbers);
    if (own != before) now_->resume(own);
  }

  Statistics done_, all_;  // of earlier integrators; of all

 private:
  /// The integrator whose last step a time lies in: the one before, where the next one has just begun.
  Integrator& of(double time) const { return before_ && time < now_->time() ? *before_ : *now_; }

  std::unique_ptr<Integrator> now_, before_;
  double before_work_ = 0;
  bool remembers_ = false, keeps_last_ = false;
  StopSign stop_;
  mutable pendula::Description described_;
};

}  // namespace pendula
