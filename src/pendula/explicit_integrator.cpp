#include <algorithm>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <functional>
#include <pendula/explicit_integrator.hpp>
#include <pendula/gauss/compensated.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace pendula {
namespace {

namespace odeint = boost::numeric::odeint;

using Vector = std::vector<double>;  // (q, q̇)

/// rate = d/dt (q, q̇) = (q̇, q̈) at x and time. Behind one type, so that odeint is compiled once for both spaces.
using RightHandSide = std::function<void(const Vector& x, Vector& rate, double time)>;

template <class Space>
RightHandSide right_hand_side_of(ForwardDynamics<Space>& dynamics, Eigen::Index coordinates) {
  using Workspace = Coordinates<Space, Eigen::Dynamic>;
  return [&dynamics, q = Workspace(coordinates), v = Workspace(coordinates), acceleration = Workspace(coordinates)](
             const Vector& x, Vector& rate, double time) mutable {
    const Eigen::Index k = q.size();
    q = Eigen::Map<const Workspace>(x.data(), k);
    v = Eigen::Map<const Workspace>(x.data() + k, k);
    dynamics.acceleration(time, q, v, acceleration);
    Eigen::Map<Workspace>(rate.data(), k) = v;
    Eigen::Map<Workspace>(rate.data() + k, k) = acceleration;
  };
}

/// What fixed and adaptive steps share.
template <class Space>
class ExplicitIntegrator : public Integrator<Space> {
 public:
  ExplicitIntegrator(std::unique_ptr<ForwardDynamics<Space>> dynamics, std::string kernel)
      : dynamics_(std::move(dynamics)), kernel_(std::move(kernel)) {}

  Outcome start(const State<Space>& state) override {
    time_.assign(state.time);
    statistics_ = {};
    x_.resize(static_cast<std::size_t>(2 * state.q.size()));
    Eigen::Map<Eigen::VectorXd>(x_.data(), state.q.size()) = state.q;
    Eigen::Map<Eigen::VectorXd>(x_.data() + state.q.size(), state.q.size()) = state.v;
    right_hand_side_ = right_hand_side_of(*dynamics_, state.q.size());
    return require_finite_rate();
  }

  double time() const override { return time_.value; }

  State<Space> state() const override {
    const auto k = static_cast<Eigen::Index>(x_.size() / 2);
    return {time(), Eigen::Map<const Eigen::VectorXd>(x_.data(), k),
            Eigen::Map<const Eigen::VectorXd>(x_.data() + k, k)};
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", kernel_}; }

 protected:
  RightHandSide& right_hand_side() { return right_hand_side_; }

  Outcome accept(double h) {
    time_.add(h);
    ++statistics_.steps;
    return {Status::ok, time(), h, 0, 0, -1};
  }

  Outcome failure(Status status, double h, const Vector& at) {
    ++statistics_.rejected_steps;
    return {status, time(), h, 0, 0, non_finite_link(at)};
  }

  static bool is_finite(const Vector& x) {
    return std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); });
  }

  Vector x_;
  Statistics statistics_;

 private:
  // At a pole the accelerations are infinite: better to say so than to start.
  Outcome require_finite_rate() {
    Vector rate(x_.size());
    right_hand_side()(x_, rate, time());
    if (is_finite(rate)) return {Status::ok, time(), 0, 0, 0, -1};
    return {Status::singular_mass_matrix, time(), 0, 0, 0, non_finite_link(rate)};
  }

  static int non_finite_link(const Vector& x) {
    const auto at = std::find_if(x.begin(), x.end(), [](double value) { return !std::isfinite(value); });
    const auto links = static_cast<std::ptrdiff_t>(x.size()) / (2 * Space::dof);
    return at == x.end() ? -1 : static_cast<int>((at - x.begin()) % links);
  }

  std::unique_ptr<ForwardDynamics<Space>> dynamics_;
  std::string kernel_;
  RightHandSide right_hand_side_;
  Compensated<double> time_{};
};

template <class Space>
class FixedStepIntegrator : public ExplicitIntegrator<Space> {
  using Base = ExplicitIntegrator<Space>;

 public:
  using Base::Base;

  Outcome step(double h) override {
    Vector& x = this->x_;
    next_.resize(x.size());
    stepper_.do_step(std::ref(this->right_hand_side()), x, this->time(), next_, h);
    if (!Base::is_finite(next_)) return this->failure(Status::not_finite, h, next_);
    x.swap(next_);
    return this->accept(h);
  }

 private:
  odeint::runge_kutta4<Vector> stepper_;
  Vector next_;
};

/// Embedded pair with odeint's step control; h is only an upper bound.
template <class Space, class Stepper>
class AdaptiveIntegrator : public ExplicitIntegrator<Space> {
  using Base = ExplicitIntegrator<Space>;

 public:
  AdaptiveIntegrator(std::unique_ptr<ForwardDynamics<Space>> dynamics, double tolerance, std::string kernel)
      : Base(std::move(dynamics), std::move(kernel)),
        tolerance_(tolerance),
        stepper_(odeint::make_controlled<Stepper>(tolerance, tolerance)) {}

  Outcome start(const State<Space>& state) override {
    stepper_ = odeint::make_controlled<Stepper>(tolerance_, tolerance_);
    proposed_ = 0;
    return Base::start(state);
  }

  Outcome step(double h) override {
    const bool cut = proposed_ > h;  // a step that is cut short says nothing about the size of the next one
    double tried = proposed_ == 0 ? std::min(h, first_step) : std::min(h, proposed_);
    for (int attempt = 0; attempt < max_attempts && tried > smallest_step(); ++attempt) {
      const double size = tried;
      double time = this->time();
      next_ = this->x_;
      const bool accepted = stepper_.try_step(std::ref(this->right_hand_side()), next_, time, tried) == odeint::success;
      if (!Base::is_finite(next_) || !std::isfinite(tried)) return this->failure(Status::not_finite, size, next_);
      if (accepted) {
        this->x_.swap(next_);
        if (!cut || tried < size) proposed_ = tried;
        return this->accept(size);
      }
      ++this->statistics_.rejected_steps;
    }
    return this->failure(Status::not_converged, tried, this->x_);
  }

 private:
  double smallest_step() const { return 1e-14 * std::max(1.0, std::abs(this->time())); }

  static constexpr double first_step = 1e-3;  // s; the control finds the right one within a few steps
  static constexpr int max_attempts = 100;

  double tolerance_;
  typename odeint::result_of::make_controlled<Stepper>::type stepper_;
  double proposed_ = 0;
  Vector next_;
};

}  // namespace

template <class Space>
std::unique_ptr<Integrator<Space>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Space>> dynamics,
                                                            const RunOptions& options, std::string kernel) {
  if (is_adaptive(options.method) && !(options.tolerance > 0)) {
    throw std::invalid_argument("tolerance: expected a positive number, got " + std::to_string(options.tolerance));
  }
  switch (options.method) {
    case Method::rk4:
      return std::make_unique<FixedStepIntegrator<Space>>(std::move(dynamics), std::move(kernel));
    case Method::dopri5:
      return std::make_unique<AdaptiveIntegrator<Space, odeint::runge_kutta_dopri5<Vector>>>(
          std::move(dynamics), options.tolerance, std::move(kernel));
    case Method::fehlberg78:
      return std::make_unique<AdaptiveIntegrator<Space, odeint::runge_kutta_fehlberg78<Vector>>>(
          std::move(dynamics), options.tolerance, std::move(kernel));
    case Method::gauss:
      break;
  }
  throw std::invalid_argument("method: expected an explicit one");
}

template std::unique_ptr<Integrator<Planar>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Planar>>,
                                                                      const RunOptions&, std::string);
template std::unique_ptr<Integrator<Spatial>> make_explicit_integrator(std::unique_ptr<ForwardDynamics<Spatial>>,
                                                                       const RunOptions&, std::string);

}  // namespace pendula
