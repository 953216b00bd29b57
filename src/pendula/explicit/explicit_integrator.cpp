#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/modified_midpoint.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstddef>
#include <functional>
#include <pendula/explicit/explicit_integrator.hpp>
#include <pendula/explicit/field_steps.hpp>
#include <pendula/explicit/forced_steps.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/stop_sign.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {
namespace {

namespace odeint = boost::numeric::odeint;

using Vector = std::vector<double>;  // (q, q̇)

/// rate = d/dt (q, q̇) = (q̇, q̈) at time, where the state has moved so far since its step began.
using RightHandSide = std::function<void(const Vector& moved, Vector& rate, double time)>;

/// What fixed and adaptive steps share. Methods are given how far the state has moved since its step began, not the
/// state: so what many small steps add to it is not lost to rounding.
class ExplicitIntegrator : public PlainIntegrator {
 public:
  ExplicitIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, std::string_view kernel)
      : x_(2 * static_cast<std::size_t>(coordinates)),
        low_(x_.size()),
        next_(x_.size()),
        next_low_(x_.size()),
        rate_(x_.size()),
        place_(x_.size()),
        dynamics_(std::move(dynamics)),
        parts_(parts),
        kernel_(kernel),
        right_hand_side_([this](const Vector& moved, Vector& rate, double at) { find_rate(moved, rate, at); }) {}

  Outcome start(double time, const double* q, const double* v) override {
    time_.assign(time);
    statistics_ = {};
    proposed_ = before_.step = 0;
    const std::size_t k = x_.size() / 2;
    std::copy_n(v, k, std::copy_n(q, k, x_.begin()));
    std::fill(low_.begin(), low_.end(), 0.0);
    return require_finite_rate();
  }

  double time() const override { return time_.value; }

  void read_state(double* q, double* v) const override {
    const auto k = static_cast<std::ptrdiff_t>(x_.size() / 2);
    std::copy(x_.begin(), x_.begin() + k, q);
    std::copy(x_.begin() + k, x_.end(), v);
  }

  void remember_steps(bool wanted) override {
    remembers_ = wanted;
    before_.step = 0;
  }

  /// By the cubic through the ends and the rates there.
  void glance(double time, double* q, double* v) override {
    if (before_.step == 0) return read_state(q, v);
    find_rates();
    const double h = before_.step, s = (time - before_.time) / h, r = 1 - s;
    const double a = r * r * (1 + 2 * s), b = s * s * (1 + 2 * r), c = h * s * r * r, d = -h * s * s * r;
    const std::size_t k = x_.size() / 2;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const double value = a * before_.x[i] + b * x_[i] + c * before_.rate[i] + d * before_.end_rate[i];
      (i < k ? q[i] : v[i - k]) = value;
    }
  }

  Outcome look(double time, double* q, double* v, double& work) override {
    work = statistics_.load_work;
    if (before_.step == 0 || time == this->time()) {
      read_state(q, v);
      return {.status = Status::ok, .time = time};
    }
    Vector moved = before_.low;
    const double h = time - before_.time;
    from_ = &before_.x;
    advance(moved, before_.time, h);
    from_ = &x_;
    if (is_stopped()) return interrupted(h);
    if (!is_finite(moved)) return {.status = Status::not_finite, .time = before_.time, .step = h};
    const std::size_t k = moved.size() / 2;
    for (std::size_t i = 0; i < moved.size(); ++i) (i < k ? q[i] : v[i - k]) = before_.x[i] + moved[i];
    return {.status = Status::ok, .time = time, .step = h};
  }

  void heed(StopSign stop) override {
    constexpr std::size_t quick = 2000;  // numbers whose rates take less than it takes to ask
    stop_ = x_.size() > quick ? stop : StopSign{};
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", kernel_}; }

  void member(MemberNumbers& numbers) override {
    numbers(time_, statistics_, proposed_);
    numbers.range(x_.data(), x_.size());
    numbers.range(low_.data(), low_.size());
    numbers.range(rate_.data(), rate_.size());
  }

 protected:
  RightHandSide& right_hand_side() { return right_hand_side_; }
  ForwardDynamics& dynamics() { return *dynamics_; }

  /// Moves on by h, which is part of a step that was accepted.
  virtual void advance(Vector& moved, double time, double h) = 0;

  /// Where a step ends that has moved the state so far.
  void arrive(const Vector& moved) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const Twofold<double> sum = exact_sum(x_[i], moved[i]);
      next_[i] = sum.value;
      next_low_[i] = sum.low;
    }
  }

  /// The step ends where it has arrived; the state that it began at is in next_ after that.
  Outcome accept(double h) {
    x_.swap(next_);
    low_.swap(next_low_);
    if (remembers_) {
      before_.time = time();
      before_.step = h;
      before_.x = next_;
      before_.low = next_low_;
      before_.has_rates = false;
    }
    time_.add(h);
    ++statistics_.steps;
    return {.status = Status::ok, .time = time(), .step = h};
  }

  Outcome failure(Status status, double h, const Vector& at) {
    ++statistics_.rejected_steps;
    return {.status = status, .time = time(), .step = h, .part = non_finite_part(at)};
  }

  /// Whether it is to end; then rates that were found since are of no use.
  bool is_stopped() const { return stop_(); }
  Outcome interrupted(double h) const { return {.status = Status::interrupted, .time = time(), .step = h}; }

  static bool is_finite(const Vector& x) {
    return std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); });
  }

  Vector x_, low_;          // the state, and what is below its last bits
  Vector next_, next_low_;  // where a step that is tried ends
  Vector rate_;             // of the start, or what a method hands on from its last step
  double proposed_ = 0;     // size of the next step, of an adaptive method; 0: not yet known
  Statistics statistics_;

 private:
  void find_rate(const Vector& moved, Vector& rate, double time) {
    if (is_stopped()) return;
    std::transform(moved.begin(), moved.end(), from_->begin(), place_.begin(), std::plus<>());
    find_rate_at(place_, rate, time);
  }

  void find_rate_at(const Vector& x, Vector& rate, double time) {
    const auto k = static_cast<std::ptrdiff_t>(x.size() / 2);
    std::copy(x.begin() + k, x.end(), rate.begin());
    dynamics_->acceleration(time, x.data(), x.data() + k, rate.data() + k);
  }

  // At a pole the accelerations are infinite: better to say so than to start.
  Outcome require_finite_rate() {
    find_rate_at(x_, rate_, time());
    if (is_finite(rate_)) return {.status = Status::ok, .time = time()};
    return {.status = Status::singular_mass_matrix, .time = time(), .part = non_finite_part(rate_)};
  }

  int non_finite_part(const Vector& x) const {
    const auto at = std::find_if(x.begin(), x.end(), [](double value) { return !std::isfinite(value); });
    return at == x.end() ? -1 : static_cast<int>((at - x.begin()) % parts_);
  }

  void find_rates() {
    if (before_.has_rates) return;
    before_.rate.resize(x_.size());
    before_.end_rate.resize(x_.size());
    find_rate_at(before_.x, before_.rate, before_.time);
    find_rate_at(x_, before_.end_rate, time());
    before_.has_rates = true;
  }

  // The last step.
  struct Remembered {
    double time = 0, step = 0;  // 0: there was none
    Vector x, low, rate, end_rate;
    bool has_rates = false;
  };

  const Vector* from_ = &x_;  // where the step begins that is taken
  Vector place_;
  std::unique_ptr<ForwardDynamics> dynamics_;
  int parts_;
  std::string kernel_;
  StopSign stop_;
  RightHandSide right_hand_side_;
  Compensated<double> time_{};
  bool remembers_ = false;
  Remembered before_;  // rates are found when they are asked for
};

class FixedStepIntegrator : public ExplicitIntegrator {
 public:
  FixedStepIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, std::string_view kernel)
      : ExplicitIntegrator(std::move(dynamics), coordinates, parts, kernel),
        field_(2, this->dynamics(), static_cast<std::size_t>(coordinates)),
        fastest_(static_cast<std::size_t>(coordinates)) {}

  Outcome start(double time, const double* q, const double* v) override {
    std::fill(fastest_.begin(), fastest_.end(), 0.0);
    field_.forget();
    return ExplicitIntegrator::start(time, q, v);
  }

  void member(MemberNumbers& numbers) override {
    ExplicitIntegrator::member(numbers);
    numbers.range(fastest_.data(), fastest_.size());
    field_.forget();
  }

  // A step that ends nowhere is taken in ever smaller parts.
  Outcome step(double h) override {
    for (int parts = 1; parts <= most_parts; parts *= 2) {
      const bool is_good = try_in(parts, h);
      if (is_stopped()) return interrupted(h);
      if (is_good) {
        parts_of_last_ = parts;
        if (field_.has_to_look()) count_unseen(h);
        return accept(h);
      }
      ++statistics_.rejected_steps;
    }
    --statistics_.rejected_steps;
    return failure(Status::not_finite, h / most_parts, next_);
  }

 private:
  static constexpr int most_parts = 1024;

  bool try_in(int parts, double h) {
    moved_ = low_;
    take(parts, moved_, time(), h);
    arrive(moved_);
    return is_finite(next_);
  }

  void take(int parts, Vector& moved, double time, double h) {
    for (int part = 0; part < parts && is_finite(moved); ++part) {
      stepper_.do_step(std::ref(right_hand_side()), moved, time + part * (h / parts), h / parts);
    }
  }

  void advance(Vector& moved, double time, double h) override { take(parts_of_last_, moved, time, h); }

  // Of the step to next_, relative to the fastest that a coordinate was, or others were, nearly.
  void count_unseen(double h) {
    constexpr double beside = 1e-3;
    for (std::size_t k = 0; k < fastest_.size(); ++k) {
      fastest_[k] = std::max(fastest_[k], std::abs(next_[fastest_.size() + k]));
    }
    const double least = std::max(beside * *std::max_element(fastest_.begin(), fastest_.end()), nothing);
    const auto size_of = [&](const Vector&) {
      return [this, least](std::size_t k) { return std::max(fastest_[k], least); };
    };
    statistics_.step_over(time(), field_.unseen(dynamics(), time(), h, x_, next_, size_of).effect, 0);
    field_.move_on();
  }

  static constexpr double nothing = 1e-280;

  odeint::runge_kutta4<Vector> stepper_;
  int parts_of_last_ = 1;
  FieldSteps field_;
  Vector moved_, fastest_;
};

/// What the errors of a step are compared with: coordinates and rates themselves, and beside them a radian and one a
/// second, or the whole motion where that is smaller, so that swings of 1e-9 rad are followed as others are. The end of
/// the step counts, too: forces may begin at nothing.
class ErrorSize {
 public:
  /// Of a step that has moved x so far, with `rate` as its derivative.
  ErrorSize(const Vector& x, const Vector& rate, const Vector& moved, double h, double tolerance)
      : x_(x), half_(x.size() / 2) {
    double q = 0, v = 0, a = 0;
    for (std::size_t i = 0; i < half_; ++i) {
      const std::size_t k = half_ + i;
      q = std::max({q, std::abs(x[i]), std::abs(x[i] + moved[i])});
      v = std::max({v, std::abs(x[k]), std::abs(x[k] + moved[k])});
      a = std::max(a, std::abs(rate[k]));
    }
    const double rounding = rounded * q / (tolerance * h);  // what is left of rates at rest
    place_ = std::clamp(std::max(q, h * v), nothing, 1.0);
    turn_ = std::clamp(std::max({v, h * a, rounding}), nothing, 1.0);
  }

  double operator[](std::size_t i) const { return (i < half_ ? place_ : turn_) + std::abs(x_[i]); }

 private:
  static constexpr double rounded = 1e-14, nothing = 1e-16;

  const Vector& x_;
  std::size_t half_;
  double place_, turn_;
};

/// Steps of its own size; h is only an upper bound.
class AdaptiveIntegrator : public ExplicitIntegrator {
 public:
  /// Of a method that is as good as the quadrature `Gauss`.
  template <class Gauss>
  AdaptiveIntegrator(Gauss gauss, std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts,
                     std::string_view kernel, double tolerance, bool is_blind = false)
      : ExplicitIntegrator(std::move(dynamics), coordinates, parts, kernel),
        moved_(x_.size()),
        next_rate_(x_.size()),
        tolerance_(tolerance),
        forcing_(gauss, static_cast<std::size_t>(coordinates), tolerance, is_blind),
        field_(Gauss::stages, this->dynamics(), static_cast<std::size_t>(coordinates), is_blind) {}

  Outcome start(double time, const double* q, const double* v) override {
    const Outcome outcome = ExplicitIntegrator::start(time, q, v);
    if (outcome) forcing_.start(dynamics(), time, q, v);
    field_.forget();
    return outcome;
  }

  void member(MemberNumbers& numbers) override {
    ExplicitIntegrator::member(numbers);
    field_.forget();
    numbers(forcing_);
  }

  // What depends on time is looked at as if nothing cut the step, and one that is cut and fails is found as if nothing
  // cut it: so a run that goes on takes the steps of one that was not cut.
  Outcome step(double h) override {
    const double longest = forcing_.followed(dynamics(), time(), x_.data(), x_.data() + x_.size() / 2,
                                             proposed_ == 0 ? first_step : proposed_);
    bool is_cut = longest > h;
    Trial trial = is_cut ? find_step(h, 1) : find_step(longest);
    if (is_cut && !trial.is_accepted) {
      trial = find_step(longest);
      is_cut = !trial.is_accepted || trial.size >= h;
      if (is_cut) trial = find_step(h);
    }
    if (is_stopped()) return interrupted(trial.size);
    statistics_.rejected_steps += trial.rejected;
    if (!trial.is_accepted) return failure(Status::tolerance_not_met, trial.proposed, next_);
    const bool tells = !is_cut || trial.proposed < trial.size;  // else that of the next one is not known from this
    if (tells) proposed_ = trial.proposed;
    hand_on(tells);
    if (!is_cut) statistics_.count_chosen(trial.size);
    statistics_.step_over(time(), trial.unseen, tolerance_);
    field_.move_on();
    return accept(trial.size);
  }

 protected:
  /// Tries a step of the size `tried`, finds how far it has `moved_`, and makes `tried` the size that the next one
  /// should have.
  virtual bool try_step(double& tried) = 0;
  /// After a step that was accepted; whether it says how to take the next one.
  virtual void hand_on(bool tells) = 0;

  Vector moved_, next_rate_;
  double tolerance_;

 private:
  /// What steps that were tried have come to; the last one's end is in next_.
  struct Trial {
    double size = 0, proposed = 0;  // of the last one, and of what follows it
    int rejected = 0;
    bool is_accepted = false;
    double unseen = 0;  // impulse between its stages
  };

  /// Tries steps, shorter and shorter from this one on.
  Trial find_step(double longest, int tries = max_attempts) {
    Trial trial{.proposed = longest};
    for (int attempt = 0; attempt < tries && trial.proposed > smallest_step() && !is_stopped(); ++attempt) {
      trial.size = trial.proposed;
      trial.is_accepted = try_step(trial.proposed);
      arrive(moved_);
      if (!is_finite(next_) || !is_finite(next_rate_) || !std::isfinite(trial.proposed)) {
        trial.proposed = trial.size / 8;
        trial.is_accepted = false;
      }
      if (trial.is_accepted && field_.has_to_look()) {
        trial.unseen = unseen(trial.size);
        if (statistics_.has_to_see(trial.unseen, trial.size, tolerance_)) {
          trial.proposed = trial.size / 2;
          trial.is_accepted = false;
        }
      }
      if (trial.is_accepted) break;
      ++trial.rejected;
    }
    return trial;
  }

  // Of the step to next_.
  double unseen(double h) {
    const auto size_of = [&](const Vector& rate) {
      return [this, sizes = ErrorSize(x_, rate, moved_, h, tolerance_)](std::size_t k) {
        return sizes[x_.size() / 2 + k];
      };
    };
    return field_.unseen(dynamics(), time(), h, x_, next_, size_of).impulse;
  }

  ForcedSteps forcing_;
  FieldSteps field_;

  double smallest_step() const { return 1e-14 * std::max(1.0, std::abs(time())); }

  static constexpr double first_step = 1e-3;  // s; the control finds the right one within a few steps
  static constexpr int max_attempts = 100;
};

/// ErrorSize and what a step adds to a coordinate or rate, as odeint asks for it.
class ErrorChecker {
 public:
  using value_type = double;

  /// Steps that are tried have `moved` x so far.
  ErrorChecker(double tolerance, const Vector& x, const Vector& moved) : tolerance_(tolerance), x_(x), moved_(moved) {}

  template <class Algebra>
  double error(Algebra& /*algebra*/, const Vector& /*low*/, const Vector& rate, const Vector& errors, double h) const {
    const ErrorSize size(x_, rate, moved_, h, tolerance_);
    double largest = 0;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const double error = std::abs(errors[i]) / (tolerance_ * (size[i] + h * std::abs(rate[i])));
      if (!(error <= largest)) largest = error;
    }
    return largest;
  }

 private:
  double tolerance_;
  const Vector& x_;
  const Vector& moved_;
};

/// An embedded pair with odeint's step control, as good as a quadrature. Pairs of which one part differs from the other
/// by slopes at the ends alone are blind to what depends on time.
template <class Stepper, class Gauss, bool is_blind = false>
class PairIntegrator : public AdaptiveIntegrator {
 public:
  PairIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, std::string_view kernel,
                 double tolerance)
      : AdaptiveIntegrator(Gauss(), std::move(dynamics), coordinates, parts, kernel, tolerance, is_blind),
        stepper_(ErrorChecker(tolerance, x_, moved_)) {}

 private:
  // The rate is kept here, not in the stepper, whose memory is no part of the member.
  bool try_step(double& tried) override {
    double at = time();
    if constexpr (hands_on_rate) {
      return stepper_.try_step(std::ref(right_hand_side()), low_, rate_, at, moved_, next_rate_, tried) ==
             odeint::success;
    } else {
      return stepper_.try_step(std::ref(right_hand_side()), low_, at, moved_, tried) == odeint::success;
    }
  }
  void hand_on(bool) override {
    if (hands_on_rate) rate_.swap(next_rate_);
  }

  void advance(Vector& moved, double time, double h) override {
    Stepper plain;
    plain.do_step(std::ref(right_hand_side()), moved, time, h);
  }

  static constexpr bool hands_on_rate =
      std::is_same_v<typename Stepper::stepper_category, odeint::explicit_error_stepper_fsal_tag>;

  odeint::controlled_runge_kutta<Stepper, ErrorChecker> stepper_;
};

/// Bulirsch–Stoer: odeint's modified midpoints in 2, 4, 6, … substeps, extrapolated to infinitely many. Order and step
/// are those that take least work for the way (Hairer, Nørsett, Wanner, Solving ODEs I, II.9). odeint's own control is
/// not used: the order that it has come to is hidden in it, and would be no part of the member.
class ExtrapolationIntegrator : public AdaptiveIntegrator {
 public:
  ExtrapolationIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts,
                          std::string_view kernel, double tolerance)
      : AdaptiveIntegrator(kernels::GaussTableau<8>(), std::move(dynamics), coordinates, parts, kernel, tolerance) {
    table_.fill(Vector(x_.size()));
  }

  Outcome start(double time, const double* q, const double* v) override {
    row_ = first_row;
    return AdaptiveIntegrator::start(time, q, v);
  }

  void member(MemberNumbers& numbers) override {
    AdaptiveIntegrator::member(numbers);
    numbers(row_);
  }

  /// Steps are so long that no cubic follows them.
  void glance(double time, double* q, double* v) override {
    double work = 0;
    look(time, q, v, work);
  }

 private:
  static constexpr std::size_t rows = 9, first_row = 4, least_row = 2;

  static constexpr unsigned short substeps(std::size_t row) { return static_cast<unsigned short>(2 * (row + 1)); }
  // Accelerations of all rows up to this one.
  static constexpr double work(std::size_t row) { return static_cast<double>((row + 1) * (row + 2) + 1); }

  // Rows until one converges: the one that is expected to, or one of its neighbours.
  bool try_step(double& tried) override {
    const double h = tried;
    right_hand_side()(low_, rate_, time());
    for (std::size_t row = 0; row <= row_ + 1; ++row) {
      add_row(row, low_, time(), h);
      if (row == 0) continue;
      const double error = largest_error(h);
      if (!std::isfinite(error)) break;
      best_[row] = best_step(h, error, row);
      if (row + 1 < row_ || error > 1) continue;
      moved_ = table_[0];
      row_of_last_ = row;
      tried = choose(row);
      return true;
    }
    moved_ = table_[0];
    tried = std::min(best_[row_], 0.7 * h);
    return false;
  }

  void hand_on(bool tells) override {
    if (tells) row_ = next_row_;
  }

  void advance(Vector& moved, double time, double h) override {
    rate_.swap(next_rate_);  // which is part of the member
    right_hand_side()(moved, rate_, time);
    for (std::size_t row = 0; row <= row_of_last_; ++row) add_row(row, moved, time, h);
    rate_.swap(next_rate_);
    moved = table_[0];
  }

  /// The table by Aitken and Neville: its new row, from the last, whose ends stand in table_. The rates at the start
  /// are known.
  void add_row(std::size_t row, const Vector& start, double time, double h) {
    midpoint_.set_steps(substeps(row));
    midpoint_.do_step(std::ref(right_hand_side()), start, rate_, time, table_[row], h);
    for (std::size_t column = row; column > 0; --column) {
      const double ratio = static_cast<double>(substeps(row)) / substeps(column - 1);
      for (std::size_t i = 0; i < start.size(); ++i) {
        double& end = table_[column - 1][i];
        end = table_[column][i] + (table_[column][i] - end) / (ratio * ratio - 1);
      }
    }
  }

  /// Of the last two columns of a row, relative to what is tolerated.
  double largest_error(double h) const {
    const ErrorSize size(x_, rate_, table_[0], h, tolerance_);
    double largest = 0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const double error = std::abs(table_[0][i] - table_[1][i]) / (tolerance_ * size[i]);
      if (!(error <= largest)) largest = error;
    }
    return largest;
  }

  /// How long a step may be that converges in a row.
  static double best_step(double h, double error, std::size_t row) {
    const double exponent = 1 / (2 * static_cast<double>(row) + 1), most = std::pow(50, exponent);
    return h * std::clamp(0.94 * std::pow(0.65 / std::max(error, 1e-30), exponent), 1 / (4 * most), most);
  }

  /// The row for the next step, and how long that is to be, where a step has converged in `row`.
  double choose(std::size_t row) {
    const auto effort = [&](std::size_t k) { return work(k) / best_[k]; };
    next_row_ = row;
    if (row > 1 && effort(row - 1) < 0.8 * effort(row)) --next_row_;
    const bool grows = next_row_ == row && (row == 1 || effort(row) < 0.9 * effort(row - 1));
    if (grows) ++next_row_;
    next_row_ = std::clamp(next_row_, least_row, rows - 2);
    return next_row_ <= row ? best_[next_row_] : best_[row] * work(next_row_) / work(row);
  }

  odeint::modified_midpoint<Vector> midpoint_;
  std::array<Vector, rows> table_;
  std::array<double, rows> best_{};
  std::size_t row_ = first_row, next_row_ = first_row;  // that a step is expected to converge in
  std::size_t row_of_last_ = first_row;                 // that the last one did
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_explicit_integrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates,
                                                          int parts, const RunOptions& options,
                                                          std::string_view kernel) {
  using Dopri5 = PairIntegrator<odeint::runge_kutta_dopri5<Vector>, kernels::GaussTableau<3>>;
  using Fehlberg78 = PairIntegrator<odeint::runge_kutta_fehlberg78<Vector>, kernels::GaussTableau<4>, true>;
  if (is_adaptive(options.method) && !(options.tolerance > 0)) {
    throw std::invalid_argument("tolerance: expected a positive number, got " + std::to_string(options.tolerance));
  }
  switch (options.method) {
    case Method::rk4:
      return std::make_unique<FixedStepIntegrator>(std::move(dynamics), coordinates, parts, kernel);
    case Method::dopri5:
      return std::make_unique<Dopri5>(std::move(dynamics), coordinates, parts, kernel, options.tolerance);
    case Method::fehlberg78:
      return std::make_unique<Fehlberg78>(std::move(dynamics), coordinates, parts, kernel, options.tolerance);
    case Method::bulirsch_stoer:
      return std::make_unique<ExtrapolationIntegrator>(std::move(dynamics), coordinates, parts, kernel,
                                                       options.tolerance);
    case Method::gauss:
    case Method::radau:
    case Method::taylor:
      break;
  }
  throw std::invalid_argument("method: expected one that needs nothing but accelerations, got " +
                              std::string(name_of(options.method)) +
                              (options.method == Method::taylor ? ", which moves chains alone" : ""));
}

}  // namespace pendula
