#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/run/event.hpp>
#include <pendula/run/event_watch.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/observer.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/viewer.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
#include <span>
#include <vector>

namespace pendula {

/// The states where steps began, and where the last one ended.
class StepHistory {
 public:
  void add(const Motion& motion) {
    times_.push_back(motion.time);
    numbers_.insert(numbers_.end(), motion.q.begin(), motion.q.end());
    numbers_.insert(numbers_.end(), motion.v.begin(), motion.v.end());
  }

  /// Sets the time at which the last step ended, which may be rounded differently.
  void end_at(double time) { times_.back() = time; }

  /// Forgets all steps: the run went on from another state.
  void clear() {
    times_.clear();
    numbers_.clear();
  }

  bool covers(double time) const { return !times_.empty() && time >= times_.front() && time <= times_.back(); }

  /// The last state that is not after a time; the history must cover that time.
  Motion before(double time) const {
    const auto after = std::ranges::upper_bound(times_, time);
    const std::size_t place = static_cast<std::size_t>(std::distance(times_.begin(), after)) - 1;
    const std::size_t size = numbers_.size() / times_.size();
    const auto half = static_cast<Eigen::Index>(size / 2);
    const Eigen::Map<const Eigen::VectorXd> both(numbers_.data() + place * size, 2 * half);
    return {times_[place], both.head(half), both.tail(half)};
  }

 private:
  std::vector<double> times_, numbers_;  // q and v of each
};

/// The result of an advance.
struct Advance {
  Outcome outcome;  ///< of the last step
  bool stopped = false;
  std::optional<std::size_t> event = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// Moves a subject through time as far as it is asked to: what simulations are made of. A copy goes on as the original
/// does, to the last bit, without its rows.
class Mover {
 public:
  /// Called when an event has happened; true stops the run there.
  using Happened = std::function<bool(bool up, const Motion& motion)>;

  /// Throws std::invalid_argument and NoKernel as make_integrator does.
  Mover(std::shared_ptr<const Subject> subject, const RunOptions& options, bool remembers);
  Mover(const Mover& other);
  Mover& operator=(const Mover&) = delete;
  ~Mover();

  /// Begins, or goes on, from a motion.
  Outcome start(const Motion& motion);

  /// The subject with the inputs that are held.
  const Subject& subject() const { return *subject_; }
  const Motion& motion() const { return motion_; }
  std::size_t steps() const { return steps_; }
  std::optional<std::size_t> stopped_by() const { return stopped_by_; }

  const std::vector<double>& inputs() const { return held_.back().inputs; }
  /// Holds these as the constant parts of inputs from now on. Throws std::invalid_argument as with_inputs does.
  Outcome hold(std::span<const double> inputs);

  /// Advances to `time`, where a step ends. Throws std::invalid_argument if that is past, and what callbacks throw.
  Advance advance_to(double time);

  /// Takes one step of the method's own size. Throws what callbacks throw.
  Advance step();

  /// The motion at a time since the start, at the full order of the method: by a step from the start of the step that
  /// contains the time, or within the last step if step() took it. Throws std::invalid_argument if no step contains it.
  Outcome at(double time, Motion& motion);

  /// `stop` is asked after every step, and within long ones.
  void set_stop(std::function<bool()> stop) { stop_ = std::move(stop); }
  void on(Event event, Happened happened);
  /// Replaces the callbacks; their number must not change.
  void replace(std::vector<Event> events, std::vector<Happened> happened);
  /// Gives rows to an observer from now on.
  void add(std::unique_ptr<Observer> observer, const RowTimes& times);
  /// Ends the rows; throws what observers throw.
  void finish();

  /// A copy of all that the next steps depend on.
  Member save();
  void resume(const Member& saved);

  /// Visits the numbers of the state besides those of the integrator.
  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(held_.back().inputs, motion_.time, motion_.q, motion_.v, origin_, watch_);
  }

 private:
  /// Inputs, and the time since which they are held.
  struct Held {
    double since;
    std::vector<double> inputs;
  };

  void move_by(std::shared_ptr<const Subject> subject, std::unique_ptr<Integrator> integrator);
  const Held& held_at(double time) const;
  void require_rest(const char* what) const;
  std::optional<Motion> after_step();
  void stop_where_stopped();
  void restart_after(const Occurrence& happened);

  static constexpr double never = std::numeric_limits<double>::infinity();

  std::shared_ptr<const Subject> model_, subject_;  // as given; with the inputs that are held
  RunOptions options_;
  std::unique_ptr<Integrator> integrator_;
  std::vector<Held> held_;             // the present inputs last, before them those of steps in the history
  std::unique_ptr<Integrator> again_;  // takes steps again, for states within them
  double again_since_ = 0;             // Held::since of its inputs
  Motion motion_;
  double origin_ = 0;          // time from which times are counted
  double seen_since_ = never;  // start of the last step, if the integrator can find states within it
  std::size_t steps_ = 0;
  bool is_advancing_ = false;
  bool remembers_;
  StepHistory history_;
  EventWatch watch_;
  std::vector<Happened> happened_;
  std::optional<Occurrence> stopping_;
  std::optional<std::size_t> stopped_by_;
  std::function<bool()> stop_ = [] { return false; };
  std::vector<std::unique_ptr<Observer>> observers_;
  std::vector<Viewer> viewers_;
};

}  // namespace pendula
