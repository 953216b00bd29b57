#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <pendula/numeric/interval.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/numeric/reach.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula {

/// Which sign changes count.
enum class Direction { up, down, both };

/// The function of an event as a formula of a few quantities of the motion. Bounds of these over an interval of time
/// give bounds of the formula.
class Formula {
 public:
  Formula() = default;
  Formula(const Formula&) = delete;
  Formula& operator=(const Formula&) = delete;
  virtual ~Formula() = default;

  /// How many quantities the formula depends on, besides the time.
  virtual std::size_t size() const = 0;
  /// Reads the quantities from a motion.
  virtual void read(const Motion& motion, std::span<double> numbers) = 0;
  virtual double value(double time, std::span<const double> numbers) = 0;
  virtual Reach reach(const Reach& time, std::span<const Reach> numbers) = 0;
};

/// Bounds of the states of a motion over an interval of time, for each coordinate and rate.
struct MotionRange {
  Motion least, most;
};

/// Something that happens where a function of the motion changes sign.
///
/// A root that is only touched does not count, nor does one where the motion starts or ends; a jump across zero does.
/// Events are not searched where the function is not finite.
struct Event {
  std::string name = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  std::function<double(const Motion&)> value;
  Direction direction = Direction::both;
  bool stop = false;  ///< whether the run ends there
  /// The same function as a formula, needed if it may vary faster than the motion; null otherwise.
  std::shared_ptr<Formula> formula = nullptr;
  /// Encloses the values of the same function over a range; empty where that is not known.
  std::function<Interval(const MotionRange&)> enclose = {};  // NOLINT(readability-redundant-member-init)
};

/// One occurrence of an event.
struct Occurrence {
  std::size_t event = 0;  ///< index among the events of the run
  bool up = false;        ///< from − to +
  Motion motion;          ///< the state at that instant; its time is exact to rounding
};

/// Counts of an event along a run.
struct EventTally {
  std::int64_t count = 0;
  double first = std::numeric_limits<double>::quiet_NaN();  ///< s; NaN where it never happened
  double last = std::numeric_limits<double>::quiet_NaN();   ///< s
  /// End of the first step in which the function was not finite  [s]; NaN if there was none.
  double not_finite = std::numeric_limits<double>::quiet_NaN();
  /// End of the first step in which the function changed too often to be resolved  [s]; NaN if there was none.
  double not_told = std::numeric_limits<double>::quiet_NaN();

  void add(double time) {
    if (count++ == 0) first = time;
    last = time;
  }

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(count, first, last, not_finite, not_told);
  }
};

/// Reasons not to trust the events found in a run, one sentence each.
inline std::vector<std::string> event_warnings(std::span<const Event> events, std::span<const EventTally> tallies) {
  std::vector<std::string> warnings;
  const auto warn = [&](const Event& event, const std::string& what, double time, const std::string& so) {
    if (std::isnan(time)) return;
    warnings.push_back("event " + event.name + ": " + what + " before t = " + rounded(time) + " s; where that is so, " +
                       so);
  };
  for (std::size_t k = 0; k < tallies.size(); ++k) {
    warn(events[k], "not finite", tallies[k].not_finite, "nothing was looked for");
    warn(events[k], "changes too often for the steps", tallies[k].not_told, "it counts once at most in a step");
  }
  return warnings;
}

/// The cost of event location.
struct EventCost {
  std::int64_t glances = 0;  ///< states by dense output
  std::int64_t looks = 0;    ///< states at full order: about one step each
};

}  // namespace pendula
