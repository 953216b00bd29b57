#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace pendula::cli {

/// One line of the table: what was measured, and what it may be.
struct CheckLine {
  std::string_view kernel;
  std::string what;
  double measured = 0;
  double limit = 0;
  bool at_least = false;  ///< the limit is a lower one

  bool ok() const { return at_least ? measured >= limit : measured <= limit; }  // false for NaN
};

/// Checks of anything that moves by its integrators, through the same door as every run: over times that follow from
/// its motion, in units of what one rounding a step grows to.
class MotionCheck {
 public:
  /// `units` are those of the coordinates; `energy_rounding` is what energies are off by, 0 where that is not known
  /// [J].
  MotionCheck(std::string_view kernel, const Subject& subject, Motion start, std::vector<std::string> units,
              double energy_rounding);

  /// How long eight steps of eight stages follow it; 0 where they do not even for a moment  [s].
  double time() const { return time_; }

  std::vector<CheckLine> lines() const;

  /// How far the ends of runs by the dense kernel and by the chain solver are apart.
  CheckLine dense_to_chain(Iteration iteration) const;

 private:
  /// Where a run ended.
  struct End {
    Motion motion;
    double work = 0;  // that loads brought  [J]
  };

  /// A part of the motion, from its start on.
  struct Span {
    double time = 0;
    Eigen::VectorXd q, v;  // sizes that coordinates of each unit, and their rates, reach
    double growth = 1;     // of a small change
    Motion exact;          // the end
    double noise = 0;      // of ends, relative to the sizes
  };

  static RunOptions options(int stages, Form form, Solver solver = Solver::dense);
  static double distance(const std::optional<Motion>& a, const std::optional<Motion>& b, const Span& span);
  static double roundings(const std::optional<Motion>& a, const std::optional<Motion>& b, const Span& span);
  std::optional<End> run(const RunOptions& options, const Motion& start, int steps, double time) const;
  std::optional<Motion> end(const RunOptions& options, int steps, const Span& span) const;
  std::optional<Motion> own_steps(double time) const;
  std::optional<Span> sized(double time) const;
  bool follows(double time) const;
  std::optional<Span> span(double time) const;
  double growth(const Motion& from, double time, const Span& span) const;

  CheckLine best(const std::function<CheckLine(const Span&)>& line) const;
  CheckLine at_most(const std::string& what, double roundings) const;
  CheckLine at_least(const std::string& what, double order, double limit) const;
  CheckLine order(int stages, Form form, const Span& span) const;
  CheckLine energy(Form form, const Span& span) const;
  CheckLine way_back(const Span& span) const;
  CheckLine iterations(const Span& span) const;
  template <class Find>
  double farthest_within(double step, const Span& span, Find find) const;
  CheckLine look(const Span& span) const;
  CheckLine glance(const Span& span) const;
  CheckLine event(const Span& span) const;
  CheckLine tangents(const Span& span) const;

  std::string_view kernel_;
  const Subject& subject_;
  Motion start_;
  std::vector<std::string> units_;
  double energy_rounding_;
  double time_ = 0;
  std::vector<Span> spans_;
};

}  // namespace pendula::cli
