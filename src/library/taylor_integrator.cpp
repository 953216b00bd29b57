#include "library/explicit_methods.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain_links.hpp>
#include <pendula/chain/heading.hpp>
#include <pendula/numeric/compensated.hpp>
#include <pendula/numeric/long_real.hpp>
#include <pendula/system/step_rules.hpp>
#include <pendula/taylor/series_limits.hpp>
#include <pendula/taylor/taylor_steps.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace pendula {
namespace {

/// One chain, in the first lane of the smallest register: its steps are those of a member of an ensemble.
template <class Space>
class TaylorIntegrator : public PlainIntegrator {
  using Rods = ChainAccelerations<Space, Eigen::Dynamic, LanePack<RegisterFor<2>>>;
  using Stepper = TaylorSteps<Rods>;
  using L = typename Stepper::L;
  using Direction = typename Space::Link::template Cartesian<double>;

 public:
  TaylorIntegrator(Chain<Space> chain, double tolerance)
      : chain_(std::move(chain)),
        links_(chain_),
        stepper_(chain_.links(), {tolerance}),
        anchors_(static_cast<std::size_t>(chain_.links())) {
    const std::vector<double> zero(coordinates());
    seat(0, zero.data(), zero.data());
  }

  Outcome start(double time, const double* q, const double* v) override {
    statistics_ = {};
    longest_ = detail::unlimited_step;
    seat(time, q, v);
    const std::size_t count = coordinates();
    const auto is_finite = [](double x) { return std::isfinite(x); };
    if (std::all_of(q, q + count, is_finite) && std::all_of(v, v + count, is_finite)) return outcome(Status::ok, 0);
    return outcome(Status::not_finite, 0);
  }

  // As MemberQueue takes steps of a member.
  Outcome step(double h) override {
    double wanted = std::min(longest_, stepper_.longest_step()[lane]);
    for (int attempt = 0; attempt < detail::most_attempts_in_lanes; ++attempt) {
      const bool is_cut = !detail::ends_before(wanted, h);
      const double size = is_cut ? h : wanted;
      if (size > 0 && solves(size)) {
        accept(size);
        if (!is_cut) statistics_.count_chosen(size);
        return outcome(Status::ok, size);
      }
      ++statistics_.rejected_steps;
      wanted = longest_ = 0.5 * size;
    }
    return outcome(Status::tolerance_not_met, wanted);
  }

  double time() const override { return time_.value; }

  void read_state(double* q, double* v) const override {
    for (int i = 0; i < chain_.links(); ++i) write(i, stepper_.heading(lane, i), anchor(i), q, v);
  }

  /// Nothing to do: the series is kept until the next step.
  void remember_steps(bool /*wanted*/) override {}

  void at(double time, double* q, double* v) override {
    if (step_ == 0 || time == this->time()) return read_state(q, v);
    const double share = (time - begin_) / step_;
    for (int i = 0; i < chain_.links(); ++i) {
      Anchor followed = begin_anchors_[static_cast<std::size_t>(i)];
      follow(i, share, followed);
      write(i, heading_at(i, share), followed, q, v);
    }
  }

  Outcome at_full_order(double time, double* q, double* v, double& work) override {
    work = statistics_.load_work;
    at(time, q, v);
    return {.status = Status::ok, .time = time, .step = time - begin_};
  }

  const Statistics& statistics() const override { return statistics_; }
  Description describe() const override { return {"", "", ""}; }

  void member(MemberNumbers& numbers) override {
    numbers(time_, statistics_, longest_);
    stepper_.member(lane, numbers);
    for (Anchor& anchor : anchors_) numbers(anchor);
  }

 private:
  using Anchor = AngleAnchor<Space>;

  static constexpr int lane = 0;

  std::size_t coordinates() const { return Space::dof * static_cast<std::size_t>(chain_.links()); }
  std::size_t entry(int i, std::size_t a) const {
    return a * static_cast<std::size_t>(chain_.links()) + static_cast<std::size_t>(i);
  }
  const Anchor& anchor(int i) const { return anchors_[static_cast<std::size_t>(i)]; }

  void seat(double time, const double* q, const double* v) {
    time_.assign(time);
    step_ = 0;
    stepper_.start(lane, time, chain_, links_, q, v);
    for (int i = 0; i < chain_.links(); ++i) {
      std::array<double, Space::dof> angles;
      for (std::size_t a = 0; a < angles.size(); ++a) angles[a] = q[entry(i, a)];
      anchors_[static_cast<std::size_t>(i)].set(direction_of(stepper_.along(i)), angles);
    }
  }

  bool solves(double size) {
    const auto found = stepper_.solve(L(time()), L(size), L(1.0) > L(0.0));
    return select(found, L(1.0), L(0.0))[lane] != 0;
  }

  void accept(double size) {
    stepper_.accept(L(1.0) > L(0.0));
    longest_ = detail::unlimited_step;
    begin_ = time();
    step_ = size;
    begin_anchors_ = anchors_;
    for (int i = 0; i < chain_.links(); ++i) follow(i, 1, anchors_[static_cast<std::size_t>(i)]);
    time_.add(size);
    ++statistics_.steps;
  }

  Outcome outcome(Status status, double size) const { return {.status = status, .time = time(), .step = size}; }

  // Follows the angles from the start of the last step to the fraction `share` of it.
  void follow(int i, double share, Anchor& anchor) const {
    const auto direction = [&](double at) { return direction_of(stepper_.at(i, at).place); };
    const Direction there = direction(share);
    double squared = 0;
    for (std::size_t k = 0; k < there.size(); ++k) {
      squared += (there[k] - anchor.direction()[k]) * (there[k] - anchor.direction()[k]);
    }
    if (squared > anchor.reach_squared()) anchor.follow_path(direction, share);
  }

  static Direction direction_of(const std::array<L, Space::dimension>& rod) {
    Direction u;
    double squared = 0;
    for (std::size_t k = 0; k < u.size(); ++k) {
      u[k] = rod[k][lane];
      squared += u[k] * u[k];
    }
    for (double& x : u) x /= std::sqrt(squared);
    return u;
  }

  auto heading_at(int i, double share) const {
    const auto rod = stepper_.at(i, share);
    Heading<Space, LongReal> heading;
    for (std::size_t k = 0; k < Space::dimension; ++k) {
      heading.u[k] = rod.place[k][lane] / chain_.lengths()[i];
      heading.u_dot[k] = rod.rate[k][lane] / chain_.lengths()[i];
    }
    return heading;
  }

  void write(int i, const Heading<Space, LongReal>& heading, const Anchor& followed, double* q, double* v) const {
    std::array<LongReal, Space::dof> near;
    for (std::size_t a = 0; a < near.size(); ++a) near[a] = followed.angles()[a];
    const auto angles = user_angles(heading, near);
    for (std::size_t a = 0; a < near.size(); ++a) {
      q[entry(i, a)] = static_cast<double>(angles.q[a]);
      v[entry(i, a)] = static_cast<double>(angles.v[a]);
    }
  }

  Chain<Space> chain_;
  ChainLinks<Space, Eigen::Dynamic, double> links_;
  Stepper stepper_;
  Statistics statistics_;
  Compensated<double> time_{};
  double longest_ = detail::unlimited_step;  // limit of the next step after a failure
  double begin_ = 0, step_ = 0;              // of the last step; 0: there was none
  std::vector<Anchor> anchors_, begin_anchors_;
};

}  // namespace

template <class Space>
std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Space>& chain, const RunOptions& options) {
  if (!(options.tolerance > 0)) {
    throw std::invalid_argument("tolerance: expected a positive number, got " + std::to_string(options.tolerance));
  }
  if (chain.loaded()) {
    throw std::invalid_argument(
        "method: taylor takes damping, torques and drives where there is a planar kernel for the number of links, "
        "got " +
        std::string(Space::name) + ':' + std::to_string(chain.links()) + "; gauss takes them all");
  }
  return std::make_unique<TaylorIntegrator<Space>>(chain, options.tolerance);
}

template std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Planar>&, const RunOptions&);
template std::unique_ptr<PlainIntegrator> make_taylor_integrator(const Chain<Spatial>&, const RunOptions&);

}  // namespace pendula
