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

/// A line of the table: the measured value and its limit.
struct CheckLine {
  std::string_view kernel;
  std::string what;
  double measured = 0;
  double limit = 0;
  bool at_least = false;  ///< the limit is a lower bound

  bool ok() const { return at_least ? measured >= limit : measured <= limit; }  // false if NaN
};

/// Checks the integrators of a subject on its own motion, over times that follow from the motion. Errors are in units
/// of the error to which one rounding a step grows.
class MotionCheck {
 public:
  /// `units` are those of the coordinates; `energy_rounding` is the error of energies, 0 if unknown [J].
  MotionCheck(std::string_view kernel, const Subject& subject, Motion start, std::vector<std::string> units,
              double energy_rounding);

  /// The longest time over which eight steps of eight stages follow the motion; 0 if there is none [s].
  double time() const { return time_; }

  std::vector<CheckLine> lines() const;

  /// The distance of the ends by the dense kernel and by the chain solver.
  CheckLine dense_to_chain(Iteration iteration) const;

 private:
  /// The end of a run.
  struct End {
    Motion motion;
    double work = 0;  // work of loads  [J]
  };

  /// The beginning of the motion, up to a time.
  struct Span {
    double time = 0;
    Eigen::VectorXd q, v;  // largest coordinates and rates, by unit
    double growth = 1;     // growth of a small change
    Motion exact;          // the end
    double noise = 0;      // of the end, relative to the sizes
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
  CheckLine full_order(const Span& span) const;
  CheckLine dense_output(const Span& span) const;
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
