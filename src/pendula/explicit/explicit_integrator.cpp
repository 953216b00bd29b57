#include <algorithm>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <functional>
#include <pendula/explicit/explicit_integrator.hpp>
#include <pendula/numeric/compensated.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace pendula {
namespace {

namespace odeint = boost::numeric::odeint;

using Vector = std::vector<double>;  // (q, q̇)

/// rate = d/dt (q, q̇) = (q̇, q̈) at x and time.
using RightHandSide = std::function<void(const Vector& x, Vector& rate, double time)>;

RightHandSide right_hand_side_of(ForwardDynamics& dynamics, std::size_t coordinates) {
  const auto k = static_cast<std::ptrdiff_t>(coordinates);
  return [&dynamics, k](const Vector& x, Vector& rate, double time) {
    std::copy(x.begin() + k, x.end(), rate.begin());
    dynamics.acceleration(time, x.data(), x.data() + k, rate.data() + k);
  };
}

/// What fixed and adaptive steps share.
class ExplicitIntegrator : public PlainIntegrator {
 public:
  ExplicitIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, std::string_view kernel)
      : x_(2 * static_cast<std::size_t>(coordinates)),
        rate_(x_.size()),
        dynamics_(std::move(dynamics)),
        parts_(parts),
        kernel_(kernel),
        right_hand_side_(right_hand_side_of(*dynamics_, x_.size() / 2)) {}

  Outcome start(double time, const double* q, const double* v) override {
    time_.assign(time);
    statistics_ = {};
    proposed_ = 0;
    const std::size_t k = x_.size() / 2;
    std::copy_n(v, k, std::copy_n(q, k, x_.begin()));
    return require_finite_rate();
  }

  double time() const override { return time_.value; }

  void read_state(double* q, double* v) const override {
    const auto k = static_cast<std::ptrdiff_t>(x_.size() / 2);
    std::copy(x_.begin(), x_.begin() + k, q);
    std::copy(x_.begin() + k, x_.end(), v);
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", kernel_}; }

  void member(MemberNumbers& numbers) override {
    numbers(time_, statistics_, proposed_);
    numbers.range(x_.data(), x_.size());
    numbers.range(rate_.data(), rate_.size());
  }

 protected:
  RightHandSide& right_hand_side() { return right_hand_side_; }

  Outcome accept(double h) {
    time_.add(h);
    ++statistics_.steps;
    return {.status = Status::ok, .time = time(), .step = h};
  }

  Outcome failure(Status status, double h, const Vector& at) {
    ++statistics_.rejected_steps;
    return {.status = status, .time = time(), .step = h, .part = non_finite_part(at)};
  }

  static bool is_finite(const Vector& x) {
    return std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); });
  }

  Vector x_, rate_;      // rate: of the start, or what a method hands on from its last step
  double proposed_ = 0;  // size of the next step, of an adaptive method; 0: not yet known
  Statistics statistics_;

 private:
  // At a pole the accelerations are infinite: better to say so than to start.
  Outcome require_finite_rate() {
    right_hand_side()(x_, rate_, time());
    if (is_finite(rate_)) return {.status = Status::ok, .time = time()};
    return {.status = Status::singular_mass_matrix, .time = time(), .part = non_finite_part(rate_)};
  }

  int non_finite_part(const Vector& x) const {
    const auto at = std::find_if(x.begin(), x.end(), [](double value) { return !std::isfinite(value); });
    return at == x.end() ? -1 : static_cast<int>((at - x.begin()) % parts_);
  }

  std::unique_ptr<ForwardDynamics> dynamics_;
  int parts_;
  std::string kernel_;
  RightHandSide right_hand_side_;
  Compensated<double> time_{};
};

class FixedStepIntegrator : public ExplicitIntegrator {
 public:
  using ExplicitIntegrator::ExplicitIntegrator;

  // A step that ends nowhere is taken in ever smaller parts.
  Outcome step(double h) override {
    for (int parts = 1; parts <= most_parts; parts *= 2) {
      if (try_in(parts, h)) {
        x_.swap(next_);
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
    next_ = x_;
    for (int part = 0; part < parts && is_finite(next_); ++part) {
      stepper_.do_step(std::ref(right_hand_side()), next_, time() + part * (h / parts), h / parts);
    }
    return is_finite(next_);
  }

  odeint::runge_kutta4<Vector> stepper_;
  Vector next_;
};

/// Embedded pair with odeint's step control; h is only an upper bound.
template <class Stepper>
class AdaptiveIntegrator : public ExplicitIntegrator {
 public:
  AdaptiveIntegrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates, int parts, std::string_view kernel,
                     double tolerance)
      : ExplicitIntegrator(std::move(dynamics), coordinates, parts, kernel),
        stepper_(odeint::make_controlled<Stepper>(tolerance, tolerance)),
        next_(x_.size()),
        next_rate_(x_.size()) {}

  Outcome step(double h) override {
    const bool cut = proposed_ > h;  // a step that is cut short says nothing about the size of the next one
    double tried = proposed_ == 0 ? std::min(h, first_step) : std::min(h, proposed_);
    for (int attempt = 0; attempt < max_attempts && tried > smallest_step(); ++attempt) {
      const double size = tried;
      const bool accepted = try_step(tried);
      if (!is_finite(next_) || !is_finite(next_rate_) || !std::isfinite(tried)) {
        tried = size / 8;
      } else if (accepted) {
        x_.swap(next_);
        if (hands_on_rate) rate_.swap(next_rate_);
        if (!cut || tried < size) proposed_ = tried;
        return accept(size);
      }
      ++statistics_.rejected_steps;
    }
    return failure(Status::tolerance_not_met, tried, next_);
  }

 private:
  // The rate is kept here, not in the stepper, whose memory is no part of the member.
  bool try_step(double& tried) {
    double at = time();
    if constexpr (hands_on_rate) {
      return stepper_.try_step(std::ref(right_hand_side()), x_, rate_, at, next_, next_rate_, tried) == odeint::success;
    } else {
      return stepper_.try_step(std::ref(right_hand_side()), x_, at, next_, tried) == odeint::success;
    }
  }

  double smallest_step() const { return 1e-14 * std::max(1.0, std::abs(time())); }

  static constexpr bool hands_on_rate =
      std::is_same_v<typename Stepper::stepper_category, odeint::explicit_error_stepper_fsal_tag>;
  static constexpr double first_step = 1e-3;  // s; the control finds the right one within a few steps
  static constexpr int max_attempts = 100;

  typename odeint::result_of::make_controlled<Stepper>::type stepper_;
  Vector next_, next_rate_;
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_explicit_integrator(std::unique_ptr<ForwardDynamics> dynamics, int coordinates,
                                                          int parts, const RunOptions& options,
                                                          std::string_view kernel) {
  using Dopri5 = AdaptiveIntegrator<odeint::runge_kutta_dopri5<Vector>>;
  using Fehlberg78 = AdaptiveIntegrator<odeint::runge_kutta_fehlberg78<Vector>>;
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
    case Method::gauss:
    case Method::radau:
      break;
  }
  throw std::invalid_argument("method: expected an explicit one");
}

}  // namespace pendula
