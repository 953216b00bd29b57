#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <pendula/numeric/number_text.hpp>
#include <pendula/numeric/reach.hpp>
#include <pendula/system/motion.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula {

/// Which changes of sign are meant.
enum class Direction { up, down, both };

/// An event's function as one of a few numbers of the motion: what it may be over a time is known where they are.
class Formula {
 public:
  Formula() = default;
  Formula(const Formula&) = delete;
  Formula& operator=(const Formula&) = delete;
  virtual ~Formula() = default;

  /// How many numbers besides the time it is made of.
  virtual std::size_t size() const = 0;
  /// These, of a motion.
  virtual void read(const Motion& motion, std::span<double> numbers) = 0;
  virtual double value(double time, std::span<const double> numbers) = 0;
  virtual Reach reach(const Reach& time, std::span<const Reach> numbers) = 0;
};

/// Something that happens where a function of the motion changes its sign.
///
/// A zero that is touched is none, nor is one that the motion starts or ends at; a jump over zero is one. Where the
/// function is not finite nothing is looked for.
struct Event {
  std::string name = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  std::function<double(const Motion&)> value;
  Direction direction = Direction::both;
  bool stop = false;  ///< whether the run ends there
  /// The same function, where it may turn faster than the motion: none for what turns as slowly as that.
  std::shared_ptr<Formula> formula = nullptr;
};

/// That an event happened.
struct Occurrence {
  std::size_t event = 0;  ///< its number among those of the run
  bool up = false;        ///< from − to +
  Motion motion;          ///< the state at that instant, to round-off of the time
};

/// What is kept of an event along a run.
struct EventTally {
  std::int64_t count = 0;
  double first = std::numeric_limits<double>::quiet_NaN();  ///< s; NaN where it never happened
  double last = std::numeric_limits<double>::quiet_NaN();   ///< s
  /// End of the first step in which the function was not finite  [s]; NaN where there is none.
  double not_finite = std::numeric_limits<double>::quiet_NaN();
  /// The same of steps in which it changed too often to be followed.
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

/// Why not to trust what was found of events along a run: one sentence each.
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

/// What looking for events has cost.
struct EventCost {
  std::int64_t glances = 0;  ///< states by the polynomial of a step
  std::int64_t looks = 0;    ///< states at full order: about a step each
};

}  // namespace pendula
