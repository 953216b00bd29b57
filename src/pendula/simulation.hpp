#pragma once

#include <pendula/pendula.h>

#include <Eigen/Core>
#include <cstddef>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <pendula/c_error.hpp>
#include <pendula/model.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/row_times.hpp>
#include <pendula/system/member.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pendula {

/// How a simulation takes its steps: adaptive ones, unless `step` gives their size.
struct SimulationOptions {
  Method method = Method::gauss;
  int stages = 0;  ///< 0: as many as suit the tolerance, 4 for constant steps
  Form form = Form::momentum;
  Solver solver = Solver::automatic;
  Iteration iteration = Iteration::automatic;
  double step = 0;          ///< s
  double tolerance = 1e-9;  ///< error of the motion relative to its size, before its amplification by chaos
  bool remember = true;     ///< whether to keep earlier steps, for `at`; each takes as much memory as a motion
};

/// Row times at this distance, independent of the steps  [s].
inline RowTimes every(double interval) {
  return {interval, {}};
}

namespace detail {

/// The options for C; pointers refer to string literals.
inline pendula_options plain(const SimulationOptions& options) {
  return {name_of(options.method).data(),
          name_of(options.form).data(),
          name_of(options.solver).data(),
          name_of(options.iteration).data(),
          options.stages,
          options.step,
          options.tolerance,
          options.remember ? 0 : 1};
}

/// A function that asks `token`, its context, whether to stop; null if nobody can request a stop.
inline auto stop_function(const std::stop_token& token) -> int (*)(void* token) {
  if (!token.stop_possible()) return nullptr;
  return [](void* context) { return static_cast<const std::stop_token*>(context)->stop_requested() ? 1 : 0; };
}

/// Exceptions of callbacks must not pass through C: the first one is stored, stops the run, and is rethrown afterwards.
struct Guard {
  std::exception_ptr failure = nullptr;
  std::stop_token stop = {};

  static int stops(void* guard) {
    const auto& self = *static_cast<const Guard*>(guard);
    return self.failure || self.stop.stop_requested() ? 1 : 0;
  }

  template <class Result, class Do>
  Result keep(Result otherwise, Do act) noexcept {
    try {
      return act();
    } catch (...) {
      if (!failure) failure = std::current_exception();
      return otherwise;
    }
  }
  void rethrow() {
    if (failure) std::rethrow_exception(std::exchange(failure, nullptr));
  }
};

}  // namespace detail

/// A motion that advances as far as it is asked to. It is a value: a copy continues exactly as the original, to the
/// last bit, with the same events; rows stay with the original.
class Simulation {
 public:
  /// Throws std::invalid_argument for options or a start that make no sense, NoKernel, and RunFailed if the motion
  /// cannot begin (at a pole of the dense solver).
  Simulation(Model model, const Motion& start, const SimulationOptions& options = {}) : model_(std::move(model)) {
    model_.require(start);
    const pendula_options plain = detail::plain(options);
    hold(pendula_simulation_new(model_.get(), start.time, start.q.data(), start.v.data(), &plain));
  }

  Simulation(const Simulation& other) : model_(other.model_) {
    std::vector<void*> contexts;
    for (const auto& event : other.events_) {
      events_.push_back(std::make_unique<Watched>(*event, guard_.get()));
      contexts.push_back(events_.back().get());
    }
    hold(pendula_simulation_copy(other.get(), contexts.data()));
  }
  Simulation(Simulation&&) noexcept = default;
  Simulation& operator=(Simulation other) noexcept {
    std::swap(model_, other.model_);
    std::swap(guard_, other.guard_);
    std::swap(events_, other.events_);
    std::swap(rows_, other.rows_);
    std::swap(simulation_, other.simulation_);
    return *this;
  }
  ~Simulation() = default;

  const Model& model() const { return model_; }

  /// Advances to `time`, where a step ends. Returns false if an event or a request stopped it before. Throws RunFailed
  /// if the mathematics fails, what callbacks throw, and std::invalid_argument if `time` is past.
  bool advance_to(double time) {
    const pendula_status status = pendula_advance_to(get(), time);
    guard_->rethrow();
    return detail::require(status) == PENDULA_OK;
  }

  double time() const { return pendula_time(get()); }
  /// Number of steps taken.
  std::size_t steps() const { return pendula_steps(get()); }

  Motion motion() const {
    Motion motion = empty_motion(time());
    pendula_motion(get(), motion.q.data(), motion.v.data());
    return motion;
  }
  /// The motion at any time since the start, at the full order of the method.
  Motion at(double time) {
    Motion motion = empty_motion(time);
    detail::require(pendula_at(get(), time, motion.q.data(), motion.v.data()));
    return motion;
  }

  /// A number of the current row by the name of its column: "x_2", "energy". Throws std::invalid_argument for an
  /// unknown name.
  double operator[](std::string_view column) const {
    const std::size_t place = detail::place_of("column", column, model_.columns());
    std::vector<double> numbers(pendula_columns(model_.get()));
    detail::require(pendula_simulation_row(get(), numbers.data()));
    return numbers[place];
  }

  /// Holds an input at a constant value from now on, to which drives are added. It is part of copies and of what is
  /// saved. Throws std::invalid_argument for an unknown name, for a value that is not finite, and in callbacks.
  void hold(std::string_view input, double value) {
    Eigen::VectorXd all = held();
    all[static_cast<Eigen::Index>(detail::place_of("input", input, model_.input_names()))] = value;
    hold(all);
  }
  /// Holds all inputs, in the order of Model::input_names.
  void hold(const Eigen::VectorXd& inputs) {
    detail::require(pendula_hold(get(), inputs.data(), static_cast<std::size_t>(inputs.size())));
  }
  /// The inputs held; at first the constant inputs of the model.
  Eigen::VectorXd held() const {
    Eigen::VectorXd inputs(static_cast<Eigen::Index>(model_.inputs()));
    pendula_held(get(), inputs.data());
    return inputs;
  }

  /// Continues from another motion, such as after an impact.
  void restart(const Motion& motion) {
    model_.require(motion);
    detail::require(pendula_restart(get(), motion.time, motion.q.data(), motion.v.data()));
  }

  /// From now on calls happened(motion) where event.value changes sign; event.stop ends the advance there. Returns the
  /// index of the event.
  std::size_t on(Event event, std::function<void(const Motion&)> happened = nullptr) {
    if (event.formula)
      throw std::invalid_argument("formula: expected none, events of a simulation are functions alone");
    if (!event.value) throw std::invalid_argument("value: expected a function of the motion, got none");
    events_.push_back(std::make_unique<Watched>(std::move(event), std::move(happened), empty_motion(0), guard_.get()));
    const Event& told = events_.back()->event;
    const int direction = told.direction == Direction::up ? 1 : told.direction == Direction::down ? -1 : 0;
    const pendula_event plain{&Watched::value, &Watched::tell, events_.back().get(), direction, told.stop ? 1 : 0};
    detail::require(pendula_on(get(), &plain));
    return events_.size() - 1;
  }
  /// The event that stopped the last advance.
  std::optional<std::size_t> stopped_by() const {
    const int event = pendula_stopped_by(get());
    return event < 0 ? std::nullopt : std::optional<std::size_t>(static_cast<std::size_t>(event));
  }

  /// Writes rows to a CSV file, at these times counted from now. The file is complete after `finish`, or when the
  /// simulation is destroyed.
  void write_csv(const std::string& file, const RowTimes& rows) {
    detail::require(pendula_write_csv(get(), file.c_str(), interval_of(rows)));
  }
  /// Passes rows to take(numbers), in the order of Model::columns.
  void on_rows(const RowTimes& rows, std::function<void(std::span<const double>)> take) {
    rows_.push_back(std::make_unique<Rows>(std::move(take), guard_.get()));
    detail::require(pendula_on_rows(get(), interval_of(rows), &Rows::take_row, rows_.back().get()));
    guard_->rethrow();
  }
  /// Ends all rows; throws std::runtime_error if a file cannot be written.
  void finish() { detail::require(pendula_finish(get())); }

  /// Stops advances, also within long steps, when a stop is requested. Copies do not heed it.
  void heed(std::stop_token stop) { guard_->stop = std::move(stop); }

  /// Where the d coordinates and rates are in (q, v) from which the others follow by constraints here, ascending;
  /// without constraints all.
  std::vector<int> independent() const {
    std::vector<int> found(2 * model_.coordinates());
    int count = 0;
    detail::require(pendula_independent(get(), &count, found.data()));
    found.resize(static_cast<std::size_t>(count));
    return found;
  }

  /// dx/dt = A x + B inputs, x the d independent coordinates and rates, linearised exactly about the current motion:
  /// A is (d x d), B (d x inputs).
  std::pair<Eigen::MatrixXd, Eigen::MatrixXd> linearize() const {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto n = static_cast<Eigen::Index>(independent().size());
    RowMajor a(n, n), b(n, static_cast<Eigen::Index>(model_.inputs()));
    detail::require(pendula_linearize(get(), a.data(), b.data()));
    return {a, b};
  }

  /// Everything that the next steps depend on.
  Member save() const {
    Member saved{std::vector<double>(pendula_saved(get()))};
    detail::require(pendula_save(get(), saved.numbers.data(), saved.numbers.size()));
    return saved;
  }
  /// Continues from what was saved by a simulation with the same model, options and events, to the last bit. Throws
  /// std::invalid_argument for a wrong number of numbers.
  void resume(const Member& saved) {
    detail::require(pendula_resume(get(), saved.numbers.data(), saved.numbers.size()));
  }

  /// The simulation of the C interface.
  pendula_simulation* get() const { return simulation_.get(); }

 private:
  struct Free {
    void operator()(pendula_simulation* simulation) const { pendula_simulation_free(simulation); }
  };

  struct Watched {
    Watched(Event watched, std::function<void(const Motion&)> told, Motion place, detail::Guard* kept_by)
        : event(std::move(watched)), happened(std::move(told)), motion(std::move(place)), guard(kept_by) {}
    Watched(const Watched& other, detail::Guard* kept_by)
        : event(other.event), happened(other.happened), motion(other.motion), guard(kept_by) {}

    const Motion& place(double time, const double* q, const double* v) {
      motion.time = time;
      motion.q = Eigen::Map<const Eigen::VectorXd>(q, motion.q.size());
      motion.v = Eigen::Map<const Eigen::VectorXd>(v, motion.v.size());
      return motion;
    }
    static double value(void* context, double time, const double* q, const double* v) {
      auto& self = *static_cast<Watched*>(context);
      const double unknown = std::numeric_limits<double>::quiet_NaN();
      return self.guard->keep(unknown, [&] { return self.event.value(self.place(time, q, v)); });
    }
    static int tell(void* context, int /*up*/, double time, const double* q, const double* v) {
      auto& self = *static_cast<Watched*>(context);
      if (self.guard->failure) return 1;
      return self.guard->keep(1, [&] {
        if (self.happened) self.happened(self.place(time, q, v));
        return 0;
      });
    }

    Event event;
    std::function<void(const Motion&)> happened;
    Motion motion;
    detail::Guard* guard;
  };

  struct Rows {
    Rows(std::function<void(std::span<const double>)> taker, detail::Guard* kept_by)
        : take(std::move(taker)), guard(kept_by) {}

    static int take_row(void* context, const double* numbers, std::size_t count) {
      auto& self = *static_cast<Rows*>(context);
      return self.guard->keep(1, [&] {
        self.take(std::span(numbers, count));
        return 0;
      });
    }

    std::function<void(std::span<const double>)> take;
    detail::Guard* guard;
  };

  void hold(pendula_simulation* simulation) {
    simulation_.reset(detail::made(simulation));
    detail::require(pendula_heed(get(), &detail::Guard::stops, guard_.get()));
  }

  Motion empty_motion(double time) const {
    const auto count = static_cast<Eigen::Index>(model_.coordinates());
    return {time, Eigen::VectorXd(count), Eigen::VectorXd(count)};
  }

  static double interval_of(const RowTimes& rows) {
    if (rows.times.empty()) return rows.interval;
    throw std::invalid_argument("rows: expected an interval, every(0.01), got times");
  }

  Model model_;
  std::unique_ptr<detail::Guard> guard_ = std::make_unique<detail::Guard>();
  std::vector<std::unique_ptr<Watched>> events_;
  std::vector<std::unique_ptr<Rows>> rows_;
  std::unique_ptr<pendula_simulation, Free> simulation_;  // destroyed first, since it may still write rows
};

}  // namespace pendula
