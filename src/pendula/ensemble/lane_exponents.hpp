#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <pendula/ensemble/lane_runs.hpp>
#include <pendula/run/lyapunov.hpp>
#include <span>
#include <vector>

namespace pendula {

namespace detail {

/// The leading exponent of a member, from the growth of its tangent.
class LaneExponent {
 public:
  explicit LaneExponent(double duration) : duration_(duration) {}

  /// Takes the growth in a step to `time` since the start.
  void follow(double growth, double time) {
    tangent_.follow(growth, time_, time);
    time_ = time;
    if (time >= (history_.last_time() + duration_ / entries)) note();
  }

  LyapunovSpectrum spectrum() {
    if (time_ > history_.last_time()) note();
    LyapunovSpectrum spectrum;
    spectrum.duration = time_;
    spectrum.ftle = tangent_.grown() / time_;
    spectrum.megno = tangent_.megno(time_);
    history_.average(GrowthHistory::settling * time_, spectrum);
    spectrum.sum = spectrum.exponents.sum();
    return spectrum;
  }

 private:
  static constexpr double entries = 320;  // ten in each of the shortest blocks whose scatter gives the errors

  void note() {
    history_.add(time_, Eigen::VectorXd::Constant(1, tangent_.grown() - noted_));
    noted_ = tangent_.grown();
  }

  double duration_, time_ = 0, noted_ = 0;
  TangentGrowth tangent_;
  GrowthHistory history_{1};
};

/// The exponents of members that are moved in lanes, with one tangent each. `Members` is PlainChains or PlainSystems.
template <class Members>
class LaneExponents : private MemberWatch {
 public:
  /// `kind` is the tangent_lane_kind of all `setups` with `options`; their own options tell how they would be run
  /// alone. `setups` must outlive this object.
  LaneExponents(const LaneKind& kind, std::span<const RunSetup* const> setups, const RunOptions& options,
                const std::function<bool()>& stop)
      : setups_(setups), options_(options), stop_(stop), members_(setups, kind) {
    exponents_.reserve(setups.size());
    for (const RunSetup* setup : setups) exponents_.emplace_back(setup->duration);
  }

  /// The exponent of each run; nullopt if lanes could not move it. The vector is empty if `stop` ended the work.
  std::vector<std::optional<LyapunovSpectrum>> go() {
    if (!members_.move_with_tangents(options_, *this)) return {};
    std::vector<std::optional<LyapunovSpectrum>> found(setups_.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      if (members_.end(k).status == Status::ok && is_good(k)) found[k] = exponents_[k].spectrum();
    }
    return found;
  }

 private:
  // As in LaneRuns, a substituted method must conserve the energy where the motion does.
  bool is_good(std::size_t k) const {
    const RunSetup& setup = *setups_[k];
    const Subject& subject = *setup.subject;
    const bool is_tried = options_.method != setup.options.method && has_to_be_tried(subject);
    if (!is_tried || subject.loaded()) return true;
    const Observation before = subject.observe(setup.start), after = subject.observe(members_.motion(k));
    const double scale = energy_scale(subject, before, after, 0);
    return std::abs(after.energy - before.energy) <= setup.options.tolerance * scale;
  }

  bool wants_steps() const override { return true; }
  bool wants_looks() const override { return false; }
  bool stops() override { return stop_(); }

  void after_step(MemberSteps& steps) override {
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (!steps.took_step(lane)) continue;
      const std::size_t k = steps.member(lane);
      exponents_[k].follow(steps.growth(lane), steps.end(lane) - setups_[k]->start.time);
    }
  }

  std::span<const RunSetup* const> setups_;
  RunOptions options_;
  const std::function<bool()>& stop_;
  Members members_;
  std::vector<LaneExponent> exponents_;
};

}  // namespace detail

}  // namespace pendula
