#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/modified_midpoint.hpp>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <pendula/explicit/error_size.hpp>
#include <pendula/explicit/extrapolation_integrator.hpp>
#include <pendula/explicit/field_steps.hpp>
#include <pendula/explicit/forced_steps.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/system/stop_sign.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {
namespace {

namespace odeint = boost::numeric::odeint;

using Vector = std::vector<double>;  // (q, q̇)

/// rate = d/dt (q, q̇) = (q̇, q̈) at `time`, where the state has moved by `moved` since its step began.
using RightHandSide = std::function<void(const Vector& moved, Vector& rate, double time)>;

/// Bulirsch–Stoer: odeint's modified midpoint rule with 2, 4, 6, … substeps, extrapolated to step size zero. Order and
/// step size minimise the work per unit of time (Hairer, Nørsett, Wanner, Solving ODEs I, II.9). odeint's own step-size
/// control is not used, because it hides the current order, which has to be part of the member.
///
/// The midpoint rule is given the displacement since the step began instead of the state, so that what many small steps
/// add is not lost to rounding.
class ExtrapolationIntegrator : public PlainIntegrator {
 public:
  ExtrapolationIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, double tolerance,
                          std::string_view kernel)
      : x_(2 * static_cast<std::size_t>(coordinates)),
        low_(x_.size()),
        next_(x_.size()),
        next_low_(x_.size()),
        rate_(x_.size()),
        look_rate_(x_.size()),
        place_(x_.size()),
        moved_(x_.size()),
        dynamics_(std::move(dynamics)),
        tolerance_(tolerance),
        forcing_(Quadrature(), x_.size() / 2, tolerance),
        field_(Quadrature::stages, *dynamics_, x_.size() / 2),
        parts_(parts),
        kernel_(kernel),
        right_hand_side_([this](const Vector& moved, Vector& rate, double at) { find_rate(moved, rate, at); }) {
    table_.fill(Vector(x_.size()));
  }

  Outcome start(double time, const double* q, const double* v) override {
    time_.assign(time);
    statistics_ = {};
    proposed_ = before_.step = 0;
    row_ = first_row;
    std::copy_n(v, x_.size() / 2, std::copy_n(q, x_.size() / 2, x_.begin()));
    std::fill(low_.begin(), low_.end(), 0.0);
    field_.forget();
    const Outcome outcome = require_finite_rate();
    if (outcome) forcing_.start(*dynamics_, time, q, v);
    return outcome;
  }

  // Forces that depend on time are checked for the step that would be taken without the limit h, and a limited step
  // that fails is repeated without the limit. So a run that is continued takes the same steps as one that was not
  // interrupted.
  Outcome step(double h) override {
    const double longest = forcing_.followed(*dynamics_, time(), x_.data(), x_.data() + x_.size() / 2,
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
    const bool tells = !is_cut || trial.proposed < trial.size;  // else it says nothing about the next step
    if (tells) {
      proposed_ = trial.proposed;
      row_ = next_row_;
    }
    if (!is_cut) statistics_.count_chosen(trial.size);
    statistics_.step_over(time(), trial.unseen, tolerance_);
    field_.move_on();
    return accept(trial.size);
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

  /// Steps are too long for polynomials through their ends.
  void glance(double time, double* q, double* v) override {
    double work = 0;
    look(time, q, v, work);
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
    constexpr std::size_t quick = 2000;  // numbers: evaluating fewer rates is faster than asking
    stop_ = x_.size() > quick ? stop : StopSign{};
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", kernel_}; }

  void member(MemberNumbers& numbers) override {
    field_.forget();
    numbers(time_, statistics_, proposed_, row_, forcing_);
    numbers(x_, low_);
  }

 private:
  using Quadrature = kernels::GaussTableau<8>;  // as accurate as the extrapolation rows

  static constexpr std::size_t rows = 9, first_row = 4, least_row = 2;
  static constexpr double first_step = 1e-3;  // s; the control adapts it within a few steps
  static constexpr int max_attempts = 100;

  // --- Steps ---

  /// The result of trying steps; next_ is the end of the last one tried.
  struct Trial {
    double size = 0, proposed = 0;  // of the last step tried, and of the step after it
    int rejected = 0;
    bool is_accepted = false;
    double unseen = 0;  // impulse between the stages
  };

  /// Tries steps from `longest` on, shorter each time.
  Trial find_step(double longest, int tries = max_attempts) {
    Trial trial{.proposed = longest};
    for (int attempt = 0; attempt < tries && trial.proposed > smallest_step() && !is_stopped(); ++attempt) {
      trial.size = trial.proposed;
      trial.is_accepted = try_step(trial.proposed);
      arrive(moved_);
      if (!is_finite(next_) || !std::isfinite(trial.proposed)) {
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

  double smallest_step() const { return 1e-14 * std::max(1.0, std::abs(time())); }

  // For the step to next_.
  double unseen(double h) {
    const auto size_of = [&](const Vector& rate) {
      return [this, sizes = ErrorSize(x_, rate, moved_, h, tolerance_)](std::size_t k) {
        return sizes[x_.size() / 2 + k];
      };
    };
    return field_.unseen(*dynamics_, time(), h, x_, next_, size_of).impulse;
  }

  /// Computes the end of a step that moves the state by `moved`.
  void arrive(const Vector& moved) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const Twofold<double> sum = exact_sum(x_[i], moved[i]);
      next_[i] = sum.value;
      next_low_[i] = sum.low;
    }
  }

  /// Moves to next_, which then holds the start of the step.
  Outcome accept(double h) {
    x_.swap(next_);
    low_.swap(next_low_);
    if (remembers_) {
      before_.time = time();
      before_.step = h;
      before_.x = next_;
      before_.low = next_low_;
    }
    time_.add(h);
    ++statistics_.steps;
    return {.status = Status::ok, .time = time(), .step = h};
  }

  Outcome failure(Status status, double h, const Vector& at) {
    ++statistics_.rejected_steps;
    return {.status = status, .time = time(), .step = h, .part = non_finite_part(at)};
  }

  // --- Rows of the extrapolation table ---

  static constexpr unsigned short substeps(std::size_t row) { return static_cast<unsigned short>(2 * (row + 1)); }
  // Evaluations of accelerations in all rows up to this one.
  static constexpr double work(std::size_t row) { return static_cast<double>((row + 1) * (row + 2) + 1); }

  // Adds rows until one converges: the expected one or a neighbour.
  bool try_step(double& tried) {
    const double h = tried;
    right_hand_side_(low_, rate_, time());
    for (std::size_t row = 0; row <= row_ + 1; ++row) {
      add_row(row, low_, rate_, time(), h);
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

  /// Advances by h, a part of an accepted step.
  void advance(Vector& moved, double time, double h) {
    right_hand_side_(moved, look_rate_, time);
    for (std::size_t row = 0; row <= row_of_last_; ++row) add_row(row, moved, look_rate_, time, h);
    moved = table_[0];
  }

  /// Adds a row of the Aitken–Neville table; table_ holds the previous row. `rate` is the derivative at the start.
  void add_row(std::size_t row, const Vector& start, const Vector& rate, double time, double h) {
    midpoint_.set_steps(substeps(row));
    midpoint_.do_step(std::ref(right_hand_side_), start, rate, time, table_[row], h);
    for (std::size_t column = row; column > 0; --column) {
      const double ratio = static_cast<double>(substeps(row)) / substeps(column - 1);
      for (std::size_t i = 0; i < start.size(); ++i) {
        double& end = table_[column - 1][i];
        end = table_[column][i] + (table_[column][i] - end) / (ratio * ratio - 1);
      }
    }
  }

  /// Difference of the last two columns of a row, relative to the tolerance.
  double largest_error(double h) const {
    const ErrorSize size(x_, rate_, table_[0], h, tolerance_);
    double largest = 0;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const double error = std::abs(table_[0][i] - table_[1][i]) / (tolerance_ * size[i]);
      if (!(error <= largest)) largest = error;
    }
    return largest;
  }

  /// Step size with which a row would converge.
  static double best_step(double h, double error, std::size_t row) {
    const double exponent = 1 / (2 * static_cast<double>(row) + 1), most = std::pow(50, exponent);
    return h * std::clamp(0.94 * std::pow(0.65 / std::max(error, 1e-30), exponent), 1 / (4 * most), most);
  }

  /// Chooses the row and the step size for the next step, after convergence in `row`.
  double choose(std::size_t row) {
    const auto effort = [&](std::size_t k) { return work(k) / best_[k]; };
    next_row_ = row;
    if (row > 1 && effort(row - 1) < 0.8 * effort(row)) --next_row_;
    const bool grows = next_row_ == row && (row == 1 || effort(row) < 0.9 * effort(row - 1));
    if (grows) ++next_row_;
    next_row_ = std::clamp(next_row_, least_row, rows - 2);
    return next_row_ <= row ? best_[next_row_] : best_[row] * work(next_row_) / work(row);
  }

  // --- Right-hand side ---

  bool is_stopped() const { return stop_(); }  // rates found since then are invalid
  Outcome interrupted(double h) const { return {.status = Status::interrupted, .time = time(), .step = h}; }

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

  // At a pole accelerations are infinite: better to fail at the start.
  Outcome require_finite_rate() {
    find_rate_at(x_, rate_, time());
    if (is_finite(rate_)) return {.status = Status::ok, .time = time()};
    return {.status = Status::singular_mass_matrix, .time = time(), .part = non_finite_part(rate_)};
  }

  static bool is_finite(const Vector& x) {
    return std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); });
  }
  int non_finite_part(const Vector& x) const {
    const auto at = std::find_if(x.begin(), x.end(), [](double value) { return !std::isfinite(value); });
    return at == x.end() ? -1 : static_cast<int>((at - x.begin()) % parts_);
  }

  // The start of the last step.
  struct Remembered {
    double time = 0, step = 0;  // 0: there was none
    Vector x, low;
  };

  Vector x_, low_;                   // the state, and its rounding error
  Vector next_, next_low_;           // end of the tried step
  Vector rate_, look_rate_, place_;  // at the start of a step, and anywhere
  Vector moved_;
  const Vector* from_ = &x_;  // start of the current step
  std::unique_ptr<ForwardDynamics> dynamics_;
  double tolerance_;
  ForcedSteps forcing_;
  FieldSteps field_;
  int parts_;
  std::string kernel_;
  RightHandSide right_hand_side_;
  StopSign stop_;
  Compensated<double> time_{};
  double proposed_ = 0;  // size of the next step; 0: not yet known
  Statistics statistics_;
  bool remembers_ = false;
  Remembered before_;

  odeint::modified_midpoint<Vector> midpoint_;
  std::array<Vector, rows> table_;
  std::array<double, rows> best_{};
  std::size_t row_ = first_row, next_row_ = first_row;  // in which the next step is expected to converge
  std::size_t row_of_last_ = first_row;                 // in which the last step converged
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_extrapolation_integrator(std::unique_ptr<ForwardDynamics> dynamics,
                                                               int coordinates, int parts, double tolerance,
                                                               std::string_view kernel) {
  if (!(tolerance > 0)) {
    throw std::invalid_argument("tolerance: expected a positive number, got " + std::to_string(tolerance));
  }
  return std::make_unique<ExtrapolationIntegrator>(std::move(dynamics), coordinates, parts, tolerance, kernel);
}

}  // namespace pendula
