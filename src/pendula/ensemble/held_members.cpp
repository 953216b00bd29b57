#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/ensemble/held_members.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/system/step_rules.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {

namespace {

// Ends a motion that takes more explicit steps than this, as a stiff one does: implicit steps move it anew.
class StepBudget : public MemberWatch {
 public:
  StepBudget(std::size_t members, const std::function<bool()>& stop) : steps_(members), stop_(stop) {}

  bool is_slow(std::size_t member) const { return steps_[member] >= most_steps; }

  bool wants_steps() const override { return true; }
  bool wants_looks() const override { return false; }
  void after_step(MemberSteps& steps) override {
    for (int lane = 0; lane < steps.lanes(); ++lane) {
      if (steps.took_step(lane) && ++steps_[steps.member(lane)] >= most_steps) steps.finish(lane);
    }
  }
  bool stops() override { return stop_(); }

 private:
  static constexpr int most_steps = 200;

  std::vector<int> steps_;
  const std::function<bool()>& stop_;
};

template <class Space>
bool is_driven(const ChainSubject<Space>& subject) {
  return !subject.chain().drives().empty();
}
bool is_driven(const SystemSubject& subject) {
  return !subject.numbers().sines.empty();
}

// Members of one model with the same numbers, but each with its own state and what it holds.
template <class Model, class Hold>
std::vector<PlainMember<Model>> members_of(const Model& model, std::size_t count, double duration, const double* states,
                                           std::size_t coordinates, Hold hold) {
  std::vector<PlainMember<Model>> members;
  members.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double* const q = states + 2 * k * coordinates;
    members.push_back({model, 0, duration, q, q + coordinates});
    hold(k, members.back().model);
  }
  return members;
}

}  // namespace

HeldMembers::HeldMembers(std::shared_ptr<const Subject> subject, std::size_t coordinates, const RunOptions& options,
                         double duration)
    : subject_(std::move(subject)),
      options_(options),
      duration_(duration),
      coordinates_(coordinates),
      inputs_(inputs_of(*subject_).size()) {
  if (!(duration_ > 0) || std::isinf(duration_)) {
    throw std::invalid_argument("members: duration: expected a positive number, got " + std::to_string(duration_));
  }
  const bool driven = as_its_kind(*subject_, [](const auto& kind) { return is_driven(kind); });
  if (driven || !subject_->switches().empty()) {
    throw std::invalid_argument("members: expected a system without drives and pieces");
  }
  subject_->make_integrator(options_);  // throws here, not at the first move
  const auto size = static_cast<Eigen::Index>(coordinates_);
  // A held input may be a load, which lanes for chains without loads do not take.
  const RunSetup setup{{options_, duration_},
                       with_inputs(subject_, std::vector<double>(inputs_, 1)),
                       Motion(0, Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size))};
  in_lanes_ = quickest_in_lanes(setup);
  kind_ = lane_kind(setup, in_lanes_);
}

HeldMembers::MoveResult HeldMembers::move(std::span<const double> inputs, std::span<double> states,
                                          const std::function<bool()>& stop) {
  const std::size_t row = 2 * coordinates_, count = states.size() / row;
  const auto require = [](const char* what, std::size_t expected, std::size_t got) {
    if (expected == got) return;
    throw std::invalid_argument(std::string("members: ") + what + ": expected " + std::to_string(expected) +
                                " numbers, got " + std::to_string(got));
  };
  require("states", count * row, states.size());
  require("inputs", count * inputs_, inputs.size());
  ends_.resize(states.size());
  std::vector<MemberEnd> ends(count);
  for (std::size_t k = 0; k < count; ++k) {
    ends[k].q = ends_.data() + k * row;
    ends[k].v = ends[k].q + coordinates_;
    if (!kind_) ends[k].status = Status::not_converged;
  }
  StepBudget watch(count, stop);
  if (kind_ && !go_in_lanes(inputs, states, ends, watch)) return {{.status = Status::interrupted}, 0};
  for (std::size_t k = 0; k < count; ++k) {
    if (ends[k].status == Status::ok && !watch.is_slow(k)) continue;
    const Outcome outcome = go_alone(inputs.subspan(k * inputs_, inputs_), states.subspan(k * row, row), ends[k], stop);
    if (!outcome) return {outcome, k};
  }
  std::ranges::copy(ends_, states.begin());
  return {};
}

bool HeldMembers::go_in_lanes(Numbers inputs, Numbers states, std::span<MemberEnd> ends, MemberWatch& watch) const {
  const auto input = [&](std::size_t k) { return inputs.data() + k * inputs_; };
  const auto by_system = [&](const PlainSystem& model) {
    const auto members = members_of(model, ends.size(), duration_, states.data(), coordinates_,
                                    [&](std::size_t k, PlainSystem& own) { own.inputs = input(k); });
    return library<LaneMovers<Models>>().plain(in_lanes_)(*kind_->kernel, in_lanes_, 0, members, ends, watch);
  };
  const auto by_chain = [&]<class Space>(const Chain<Space>& chain) {
    const PlainChain model = plain(chain, {});
    if (kind_->kernel != nullptr) return by_system(ChainSystem(model, Space::torque_components).plain());
    const auto members = members_of(model, ends.size(), duration_, states.data(), coordinates_,
                                    [&](std::size_t k, PlainChain& own) { own.torque = input(k); });
    return library<LaneMovers<Space>>().plain(in_lanes_)(in_lanes_, 0, members, ends, watch);
  };
  return as_its_kind(*subject_, [&](const auto& kind) {
    if constexpr (requires { kind.chain(); }) {
      return by_chain(kind.chain());
    } else {
      return by_system(kind.numbers().plain());
    }
  });
}

Outcome HeldMembers::go_alone(Numbers inputs, Numbers state, const MemberEnd& end,
                              const std::function<bool()>& stop) const {
  const auto size = static_cast<Eigen::Index>(coordinates_);
  const Eigen::Map<const Eigen::VectorXd> q(state.data(), size), v(state.data() + size, size);
  const std::unique_ptr<Integrator> integrator = with_inputs(subject_, inputs)->make_integrator(options_);
  Outcome outcome = integrator->start(Motion(0, q, v));
  const double step = longest_step(options_);
  while (outcome && integrator->time() < duration_) {
    const double left = duration_ - integrator->time();
    outcome = integrator->step(detail::ends_before(step, left) ? step : left);
    if (stop()) outcome.status = Status::interrupted;
  }
  const Motion there = integrator->state();
  std::ranges::copy(there.q, end.q);
  std::ranges::copy(there.v, end.v);
  return outcome;
}

}  // namespace pendula
