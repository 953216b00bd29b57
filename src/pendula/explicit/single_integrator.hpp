#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/outcome.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/stop_sign.hpp>
#include <utility>
#include <vector>

namespace pendula {

/// An explicit method behind the run-time interface: one motion, by the text that moves members of ensembles. `Steps`
/// takes them, of plain numbers; `Subject` knows the coordinates that users see, and looks for what steps do not:
///   Steps(subject.subject());  coordinates();  Outcome start(time, q, v, steps);  void follow(steps): a step was taken
///   void read(steps, q, v);  void read_within(steps, share, q, v): when a share of the last step was done
///   void read_near(i, place, rate, q, v): of a part, whose q is known nearly
///   double followed(steps, time, h): the longest step up to h in which it sees what depends on time
///   bool has_to_look();  Unseen unseen(from, to, time, h, tolerance): what a step does not see
///   tolerance_share: of the user's tolerance, what the steps are given
///   void move_on();  void member(numbers);  kernel()
template <class Steps, class Subject>
class SingleIntegrator final : public PlainIntegrator {
 public:
  SingleIntegrator(Subject subject, double tolerance, typename Steps::Options options = {})
      : subject_(std::move(subject)),
        steps_(subject_.subject(), options),
        controller_(Subject::tolerance_share * tolerance),
        kept_(steps_.place()),
        end_(kept_),
        tolerance_(tolerance) {
    // Members of others are resumed without a start: numbers of the subject come into the steps here.
    const std::vector<double> zero(subject_.coordinates());
    start(0, zero.data(), zero.data());
  }

  Outcome start(double time, const double* q, const double* v) override {
    time_.assign(time);
    statistics_ = {};
    step_ = 0;
    parts_of_last_ = 1;
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

  /// Where the last step began is known until the next one.
  void remember_steps(bool /*wanted*/) override {}

  void glance(double time, double* q, double* v) override {
    if (step_ == 0 || time == this->time()) return read_state(q, v);
    subject_.read_within(steps_, (time - begin_) / step_, q, v);
  }

  Outcome look(double time, double* q, double* v, double& work) override {
    work = statistics_.load_work;
    if (step_ == 0 || time == this->time()) {
      read_state(q, v);
    } else if (parts_of_last_ == 1) {
      const double share = (time - begin_) / step_;
      subject_.read_within(steps_, share, q, v);
      steps_.for_each_look(
          share, [&](int i, const auto& place, const auto& rate) { subject_.read_near(i, place, rate, q, v); });
    } else {
      look_in_parts(time, q, v);
    }
    if (is_stopped()) return interrupted(time - begin_);
    return {.status = Status::ok, .time = time, .step = time - begin_};
  }

  void heed(StopSign stop) override {
    constexpr int quick = 1000;  // parts whose steps take less than it takes to ask
    stop_ = steps_.links() > quick ? stop : StopSign{};
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", subject_.kernel()}; }

  void member(MemberNumbers& numbers) override { numbers(time_, statistics_, controller_, steps_, subject_); }

 private:
  static constexpr int most_attempts = 100;
  static constexpr int most_parts = 1024;

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

  // --- Steps as they are asked for ---

  // A step that ends nowhere, or turns too far, is taken in ever smaller parts.
  Outcome fixed_step(double h) {
    for (int parts = 1; parts <= most_parts; parts *= 2) {
      const bool is_good = parts == 1 ? steps_.solve(time(), h, true) : goes_in(parts, time(), h);
      if (is_stopped()) return interrupted(h);
      if (is_good) {
        if (subject_.has_to_look()) count_unseen(parts, h);
        parts_of_last_ = parts;
        parts == 1 ? steps_.accept(true) : steps_.set_step(kept_, time(), h);
        return accept(h);
      }
      ++statistics_.rejected_steps;
    }
    --statistics_.rejected_steps;
    return failure(Status::not_finite, h / most_parts);
  }

  void count_unseen(int parts, double h) {
    const Unseen unseen = parts == 1 ? subject_.unseen(steps_.parts(), steps_.tried(), time(), h, 0)
                                     : subject_.unseen(kept_.parts, steps_.parts(), time(), h, 0);
    statistics_.step_over(time(), unseen.effect, 0);
    subject_.move_on();
  }

  // From where it is, which is kept; where that fails it is there again.
  bool goes_in(int parts, double time, double h) {
    kept_ = steps_.place();
    const double size = h / parts;
    for (int part = 0; part < parts; ++part) {
      if (is_stopped() || !steps_.solve(time + part * size, size, true)) {
        steps_.go_to(kept_);
        return false;
      }
      steps_.accept(true);
    }
    return true;
  }

  void look_in_parts(double time, double* q, double* v) {
    subject_.read_within(steps_, (time - begin_) / step_, q, v);
    end_ = steps_.place();
    steps_.go_to(steps_.begin());
    goes_in(parts_of_last_, begin_, time - begin_);
    for (int i = 0; i < steps_.links(); ++i) {
      subject_.read_near(i, steps_.exact_place(i), steps_.exact_rate(i), q, v);
    }
    steps_.go_to(end_);
    steps_.set_step(kept_, begin_, step_);
  }

  // --- Steps of its own choice, h being an upper bound ---

  /// What steps that were tried have come to.
  struct Trial {
    double size = 0;  // of the last one
    int rejected = 0;
    bool is_accepted = false;
    double unseen = 0;  // impulse between its stages
  };

  // What depends on time is looked at as if nothing cut the step, and one that is cut and fails is found as if nothing
  // cut it: so a run that goes on takes the steps of one that was not cut.
  Outcome chosen_step(double h) {
    const double longest = subject_.followed(steps_, time(), controller_.step(steps_));
    const auto before = controller_;
    bool is_cut = longest > h;
    Trial trial = is_cut ? find_step(h, 1) : find_step(longest);
    if (is_cut && !trial.is_accepted) {
      controller_ = before;
      trial = find_step(longest);
      is_cut = !trial.is_accepted || trial.size >= h;
      if (is_cut) {
        controller_ = before;
        trial = find_step(h);
      }
    }
    if (is_stopped()) return interrupted(trial.size);
    statistics_.rejected_steps += trial.rejected;
    if (!trial.is_accepted) return failure(Status::tolerance_not_met, controller_.step(steps_));
    controller_.move_on(true, trial.size, steps_);
    // Else this one does not tell how long the next one is to be.
    const bool tells = !is_cut || controller_.step(steps_) < trial.size;
    if (!tells) controller_ = before;
    if (!is_cut) statistics_.count_chosen(trial.size);
    statistics_.step_over(time(), trial.unseen, tolerance_);
    subject_.move_on();
    steps_.accept(true);
    return accept(trial.size);
  }

  /// Tries steps, shorter and shorter from this one on.
  Trial find_step(double longest, int tries = most_attempts) {
    Trial trial;
    double size = longest;
    for (int attempt = 0; attempt < tries && size > smallest_step() && !is_stopped(); ++attempt) {
      trial.size = size;
      trial.is_accepted = is_good(trial);
      if (trial.is_accepted) break;
      ++trial.rejected;
      size = std::min(longest, controller_.step(steps_));
    }
    return trial;
  }

  bool is_good(Trial& trial) {
    const double h = trial.size;
    if (!steps_.solve(time(), h, true)) {
      controller_.shrink(true, h, 0.5);
      return false;
    }
    if (!controller_.accepts(true, h, steps_)) return false;
    if (!subject_.has_to_look()) return true;
    trial.unseen = subject_.unseen(steps_.parts(), steps_.tried(), time(), h, tolerance_).impulse;
    if (!statistics_.has_to_see(trial.unseen, h, tolerance_)) return true;
    controller_.shrink(true, h, 0.5);
    return false;
  }

  double smallest_step() const { return 1e-14 * std::max(1.0, std::abs(time())); }

  Subject subject_;
  Steps steps_;
  typename Steps::Controller controller_;
  typename Steps::Place kept_, end_;  // of steps that are taken in parts
  double tolerance_;
  Statistics statistics_;
  Compensated<double> time_{};
  double begin_ = 0, step_ = 0;  // of the last step; 0: there was none
  int parts_of_last_ = 1;
  StopSign stop_;
};

}  // namespace pendula
