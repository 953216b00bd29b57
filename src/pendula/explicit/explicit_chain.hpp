#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_angles.hpp>
#include <pendula/chain/chain_links.hpp>
#include <pendula/system/outcome.hpp>
#include <string_view>
#include <utility>

namespace pendula {

/// A chain as SingleIntegrator moves it: users see angles, the method integrates rods.
template <class Space>
class ExplicitChain {
 public:
  explicit ExplicitChain(Chain<Space> chain) : chain_(std::move(chain)), links_(chain_), angles_(chain_.lengths()) {}

  /// Tolerance for rods as a fraction of that for angles and their rates.
  static constexpr double tolerance_share = 0.2;

  int subject() const { return chain_.links(); }
  std::size_t coordinates() const { return Space::dof * static_cast<std::size_t>(chain_.links()); }
  std::string_view kernel() const { return ""; }

  template <class Steps>
  Outcome start(double time, const double* q, const double* v, Steps& steps) {
    steps.start(0, time, chain_, links_, q, v);
    angles_.start(q, [&](int i) { return steps.along(i); });
    const auto is_finite = [](double x) { return std::isfinite(x); };
    const int count = Space::dof * chain_.links();
    const bool all = std::all_of(q, q + count, is_finite) && std::all_of(v, v + count, is_finite);
    return {.status = all ? Status::ok : Status::not_finite, .time = time};
  }

  template <class Steps>
  void follow(const Steps& steps) {
    angles_.follow(places(steps));
  }

  template <class Steps>
  void read(const Steps& steps, double* q, double* v) const {
    for (int i = 0; i < chain_.links(); ++i) angles_.read(i, steps.exact_place(i), steps.exact_rate(i), q, v);
  }

  template <class Steps>
  void read_within(const Steps& steps, double share, double* q, double* v) const {
    for (int i = 0; i < chain_.links(); ++i) {
      const auto there = steps.at(i, share);
      angles_.read_within(i, share, places(steps), there.place, there.rate, q, v);
    }
  }

  template <class Vector>
  void read_near(int i, const Vector& rod, const Vector& rate, double* q, double* v) const {
    angles_.read_near(i, rod, rate, q, v);
  }

  // Torques depend on time through sines only, which ExplicitSteps::longest_step resolves.
  template <class Steps>
  double followed(const Steps& /*steps*/, double /*time*/, double h) const {
    return h;
  }
  bool has_to_look() const { return false; }
  template <class Parts>
  Unseen unseen(const Parts& /*from*/, const Parts& /*to*/, double /*time*/, double /*h*/, double /*tolerance*/) const {
    return {};
  }
  void move_on() const {}

  template <class Numbers>
  void member(Numbers& numbers) {
    numbers(angles_);
  }

 private:
  // The rod vectors within the last step.
  template <class Steps>
  static auto places(const Steps& steps) {
    return [&steps](int i, double share) { return share == 1 ? steps.parts()[i].place : steps.at(i, share).place; };
  }

  Chain<Space> chain_;
  ChainLinks<Space> links_;
  ChainAngles<Space> angles_;
};

}  // namespace pendula
