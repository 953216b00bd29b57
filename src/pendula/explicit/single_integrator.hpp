#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/step_rules.hpp>
#include <pendula/system/stop_sign.hpp>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {

/// One motion with an explicit method, behind the run-time interface; it uses the same code as members of ensembles.
/// `Steps` is the method for plain numbers. `Subject` converts between the coordinates of users and those of the
/// method, and checks what steps miss:
///   Steps(subject.subject());  coordinates();  Outcome start(time, q, v, steps)
///   void follow(steps): called after every step
///   void read(steps, q, v): the state;  void read_within(steps, share, q, v): at a fraction of the last step
///   void read_near(i, place, rate, q, v): converts one part, near known angles
///   double followed(steps, time, h): the longest step up to h that resolves forces that depend on time
///   bool has_to_look();  Unseen unseen(from, to, time, h, tolerance): what a step misses between its stages
///   tolerance_share: tolerance of the method as a fraction of the user's
///   void move_on(): called when an examined step is taken;  void member(numbers);  kernel()
template <class Steps, class Subject>
class SingleIntegrator final : public PlainIntegrator {
 public:
  SingleIntegrator(Subject subject, double tolerance, typename Steps::Options options = {})
      : subject_(std::move(subject)),
        steps_(subject_.subject(), options),
        controller_(Subject::tolerance_share * tolerance),
        parts_(steps_),
        tolerance_(tolerance) {
    // An integrator may be resumed without a start, so the subject's numbers must come into the steps here.
    const std::vector<double> zero(subject_.coordinates());
    start(0, zero.data(), zero.data());
  }

  Outcome start(double time, const double* q, const double* v) override {
    time_.assign(time);
    statistics_ = {};
    step_ = 0;
    parts_.of_last = 1;
    const Outcome outcome = subject_.start(time, q, v, steps_);
    if constexpr (Steps::can_choose) {
      if (outcome) controller_.start(true, steps_);
    }
    return outcome;
  }

  Outcome step(double h) override {
    if constexpr (Steps::can_choose) {
      return chosen_step(h);
    } else {
      return fixed_step(h);
    }
  }

  double time() const override { return time_.value; }
  void read_state(double* q, double* v) const override { subject_.read(steps_, q, v); }

  /// Nothing to do: the start of the last step is always kept.
  void remember_steps(bool /*wanted*/) override {}

  void at(double time, double* q, double* v) override {
    if (step_ == 0 || time == this->time()) return read_state(q, v);
    subject_.read_within(steps_, (time - begin_) / step_, q, v);
  }

  bool bound_excursions(double* q, double* v) const override {
    if constexpr (requires { steps_.excursion(0); }) {
      if (step_ == 0 || parts_.of_last != 1) return false;
      for (int i = 0; i < steps_.count(); ++i) {
        const auto farthest = steps_.excursion(i);
        q[i] = farthest.place[0];
        v[i] = farthest.rate[0];
      }
      return true;
    } else {
      return false;
    }
  }

  Outcome at_full_order(double time, double* q, double* v, double& work) override {
    work = statistics_.load_work;
    if (step_ == 0 || time == this->time()) {
      read_state(q, v);
    } else {
      const double share = (time - begin_) / step_;
      subject_.read_within(steps_, share, q, v);
      look(time, share, [&](int i, const auto& place, const auto& rate) { subject_.read_near(i, place, rate, q, v); });
    }
    if (is_stopped()) return interrupted(time - begin_);
    return {.status = Status::ok, .time = time, .step = time - begin_};
  }

  void set_stop_sign(StopSign stop) override { stop_ = steps_.count() > quick_parts ? stop : StopSign{}; }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", subject_.kernel()}; }

  int linearize() override {
    if constexpr (has_tangents) {
      if (const auto& tangent = steps_.linearize(subject_.model())) return static_cast<int>(tangent->size());
    }
    return 0;
  }
  double resolved_decay([[maybe_unused]] double error) const override {
    if constexpr (has_tangents) return steps_.resolved_decay(error);
    return 0;
  }
  int parameters() override {
    if constexpr (has_tangents) return static_cast<int>(steps_.tangent()->parameters());
    return 0;
  }
  void push([[maybe_unused]] double* tangents, [[maybe_unused]] int count,
            [[maybe_unused]] const double* varied) override {
    if constexpr (has_tangents) steps_.tangent()->push(tangents, count, varied);
  }
  void pull([[maybe_unused]] double* gradients, [[maybe_unused]] int count, [[maybe_unused]] double* varied) override {
    if constexpr (has_tangents) steps_.tangent()->pull(gradients, count, varied);
  }

  void member(MemberNumbers& numbers) override { numbers(time_, statistics_, controller_, steps_, subject_); }

 private:
  static constexpr bool has_tangents = requires(Steps steps) { steps.tangent(); };
  static constexpr int most_parts = 1024;

  // Number of parts in which the last step was taken, and states for that. Only steps of a given size are divided.
  struct NoParts {
    explicit NoParts(const Steps& /*steps*/) {}
    int of_last = 1;
  };
  template <class Stepper>
  struct SomeParts {
    explicit SomeParts(const Stepper& steps) : kept(steps.place()), end(kept) {}
    int of_last = 1;
    typename Stepper::FullState kept, end;
  };
  using StepParts = std::conditional_t<Steps::can_choose, NoParts, SomeParts<Steps>>;

  Outcome ok(double h) const { return {.status = Status::ok, .time = time(), .step = h}; }
  Outcome interrupted(double h) const { return {.status = Status::interrupted, .time = time(), .step = h}; }
  Outcome failure(Status status, double h) {
    ++statistics_.rejected_steps;
    return {.status = status, .time = time(), .step = h, .part = steps_.part_not_finite()};
  }
  bool is_stopped() const { return stop_(); }

  Outcome accept(double h) {
    begin_ = time();
    step_ = h;
    subject_.follow(steps_);
    time_.add(h);
    ++statistics_.steps;
    return ok(h);
  }

  // Visits the state at the fraction `share` of the last step, at the full order of the method.
  template <class Visit>
  void look(double time, double share, Visit visit) {
    if constexpr (!Steps::can_choose) {
      if (parts_.of_last != 1) return look_in_parts(time, visit);
    }
    steps_.for_each_at_full_order(share, visit);
  }

  // --- Steps of a given size ---

  // A step that fails or turns too far is divided into ever more parts.
  Outcome fixed_step(double h) {
    for (int parts = 1; parts <= most_parts; parts *= 2) {
      const bool is_good = parts == 1 ? steps_.solve(time(), h, true) : goes_in(parts, time(), h);
      if (is_stopped()) return interrupted(h);
      if (is_good) {
        if (subject_.has_to_look()) count_unseen(parts, h);
        parts_.of_last = parts;
        parts == 1 ? steps_.accept(true) : steps_.set_step(parts_.kept, time(), h);
        return accept(h);
      }
      ++statistics_.rejected_steps;
    }
    --statistics_.rejected_steps;
    return failure(Status::not_finite, h / most_parts);
  }

  void count_unseen(int parts, double h) {
    const Unseen unseen = parts == 1 ? subject_.unseen(steps_.parts(), steps_.tried(), time(), h, 0)
                                     : subject_.unseen(parts_.kept.parts, steps_.parts(), time(), h, 0);
    statistics_.step_over(time(), unseen.effect, 0);
    subject_.move_on();
  }

  template <class Visit>
  void look_in_parts(double time, Visit visit) {
    parts_.end = steps_.place();
    steps_.go_to(steps_.begin());
    goes_in(parts_.of_last, begin_, time - begin_);
    for (int i = 0; i < steps_.count(); ++i) visit(i, steps_.exact_place(i), steps_.exact_rate(i));
    steps_.go_to(parts_.end);
    steps_.set_step(parts_.kept, begin_, step_);
  }

  // Takes h in `parts` steps from the current state, which is kept. On failure returns to it.
  bool goes_in(int parts, double time, double h) {
    parts_.kept = steps_.place();
    const double size = h / parts;
    for (int part = 0; part < parts; ++part) {
      if (is_stopped() || !steps_.solve(time + part * size, size, true)) {
        steps_.go_to(parts_.kept);
        return false;
      }
      steps_.accept(true);
    }
    return true;
  }

  // --- A step of the controller's choice ---

  template <class Method>
  friend Outcome detail::find_step(Method&, double, int);
  template <class Method>
  friend Outcome detail::take_chosen_step(Method&, double);

  /// Forces that depend on time are looked at as if nothing cut the step short.
  Outcome chosen_step(double h) {
    longest_ = subject_.followed(steps_, time(), controller_.step(steps_));
    before_ = controller_;
    return detail::take_chosen_step(*this, h);
  }

  double wanted() { return std::min(longest_, controller_.step(steps_)); }
  void keep() { rejected_before_ = statistics_.rejected_steps; }
  void restore() {
    controller_ = before_;
    statistics_.rejected_steps = rejected_before_;
  }

  Outcome try_step(double h, bool /*is_first*/) {
    unseen_ = 0;
    const bool is_solved = steps_.solve(time(), h, true);
    if (is_stopped()) return interrupted(h);
    if (!is_solved) {
      controller_.shrink(true, h, 0.5);
    } else if (controller_.accepts(true, h, steps_)) {
      if (!subject_.has_to_look()) return ok(h);
      unseen_ = subject_.unseen(steps_.parts(), steps_.tried(), time(), h, tolerance_).impulse;
      if (!statistics_.has_to_see(unseen_, h, tolerance_)) return ok(h);
      controller_.shrink(true, h, 0.5);
    }
    return failure(Status::tolerance_not_met, h);
  }

  // A step that is cut short says nothing about the size of the next one, unless it should have been shorter.
  Outcome take(const Outcome& found, bool is_cut) {
    controller_.move_on(true, found.step, steps_);
    if (is_cut && controller_.step(steps_) >= found.step) controller_ = before_;
    if (!is_cut) statistics_.count_chosen(found.step);
    statistics_.step_over(time(), unseen_, tolerance_);
    subject_.move_on();
    steps_.accept(true);
    return accept(found.step);
  }

  Subject subject_;
  Steps steps_;
  typename Steps::Controller controller_;
  StepParts parts_;
  double tolerance_;
  typename Steps::Controller before_{controller_};  // where the last search for a step began
  std::int64_t rejected_before_ = 0;
  double longest_ = 0;  // step that forces which depend on time allow
  double unseen_ = 0;   // impulse between the stages of the step that was tried
  Statistics statistics_;
  Compensated<double> time_{};
  double begin_ = 0, step_ = 0;  // start and size of the last step; 0: there was none
  StopSign stop_;
};

}  // namespace pendula
