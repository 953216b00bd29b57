#pragma once

#include <functional>
#include <memory>
#include <problems.hpp>
#include <string>
#include <vector>

namespace bench {

/// One whole run, made ready: memory is there, tables are set up. Runs again and again from the same start.
class Run {
 public:
  virtual ~Run() = default;
  virtual void operator()() = 0;  ///< start to end; this is what is timed
  virtual EndState end() = 0;     ///< where the last run ended; NaN where it failed
};

/// A method that can be sent into a race, and its one knob.
struct Contestant {
  std::string name;
  std::string knob;                                             ///< "tolerance" or "steps"
  std::function<bool(const Problem&)> enters;                   ///< whether it can run the problem
  std::function<std::vector<double>(const Problem&)> settings;  ///< from coarse to fine
  std::function<std::unique_ptr<Run>(const Problem&, double setting)> make;
};

/// Tolerances 10^-first … 10^-last, `each` a decade.
std::vector<double> tolerances(int first, int last, int each);

/// Numbers of steps, growing by `factor`, from `coarsest` times (10 + 2n) a second.
std::vector<double> step_counts(const Problem& problem, double coarsest, double factor, int count);

/// A run that failed has this end.
EndState failed(const Problem& problem);

// Each of these stands in a file of its own name.
void add_gsl(std::vector<Contestant>& contestants);
void add_odeint(std::vector<Contestant>& contestants);
void add_cvode(std::vector<Contestant>& contestants);
void add_mujoco(std::vector<Contestant>& contestants);
void add_pendula(std::vector<Contestant>& contestants);

/// Generated kernels, of chains and of other systems.
void add_kernels(std::vector<Contestant>& contestants);

/// GSL's rk4imp, the 2-stage Gauss method, with a constant step; also timed step by step. Its Newton iteration stops at
/// the driver's tolerance.
std::unique_ptr<Run> make_rk4imp(const Problem& problem, int steps, double step, double newton_tolerance);

}  // namespace bench
