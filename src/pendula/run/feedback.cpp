#include <algorithm>
#include <cmath>
#include <optional>
#include <pendula/run/feedback.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/relay.hpp>
#include <pendula/run/state_columns.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <stdexcept>
#include <string>
#include <utility>

namespace pendula {
namespace {

/// A subject, its laws, and its inputs without them.
struct Fed {
  std::shared_ptr<const Subject> subject;
  std::vector<SampledLaw> laws;
  std::vector<double> inputs;

  /// What a law says of a motion, within its limit; NaN where it has no value.
  static double said(const SampledLaw& law, const Motion& motion) {
    const double value = law.value(motion);
    return std::isnan(value) ? value : std::clamp(value, -law.limit, law.limit);
  }

  std::unique_ptr<Integrator> make(const RunOptions& options, const std::vector<double>& held) const {
    std::vector<double> all = inputs;
    for (std::size_t k = 0; k < laws.size(); ++k) all[laws[k].input] += held[k];
    return with_inputs(subject, all)->make_integrator(options);
  }
};

/// Steps of a subject whose inputs are held from sample to sample: from each sample on by a new integrator.
class HeldInputs : public Relay {
 public:
  HeldInputs(const Fed& fed, const RunOptions& options)
      : fed_(fed), options_(options), held_(fed.laws.size()), since_(fed.laws.size()), made_for_(held_) {
    use(fed_.make(options_, held_));
  }

  Outcome start(double time, const double* q, const double* v) override {
    const Motion motion = motion_of(time, q, v);
    for (std::size_t k = 0; k < held_.size(); ++k) {
      held_[k] = Fed::said(fed_.laws[k], motion);
      since_[k] = std::floor(time / fed_.laws[k].sample * (1 + rounding));
    }
    if (!is_finite(held_)) return not_finite(time);
    if (held_ != made_for_) make();
    return begin(motion);
  }

  Outcome step(double h) override {
    forget();
    const double next = next_sample(), left = next - time();
    const bool reaches = h >= left * (1 - rounding);
    const Outcome stepped = now().step(reaches ? left : h);
    count();
    if (!stepped || next - time() > rounding * std::abs(next)) return stepped;
    const Outcome begun = resample(next);
    return begun ? stepped : begun;
  }

  std::span<const double> held(double time) const override {
    // A row at 0.3 s is at the third sample of 0.1 s, which rounding puts behind it.
    return has_before() && time < now().time() * (1 - rounding) ? before_held_ : held_;
  }

  bool depends_on_end(double h) const override { return h < next_sample() - time() && now().depends_on_end(h); }

  void member(MemberNumbers& numbers) override {
    numbers(held_, since_, done_, all_);
    if (held_ != made_for_) make();
    own_member(numbers);
  }

  int linearize() override { throw std::invalid_argument(sampled_has_no_derivatives); }

 private:
  static constexpr double rounding = 1e-12;

  double next_sample() const {
    double next = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < since_.size(); ++k) next = std::min(next, (since_[k] + 1) * fed_.laws[k].sample);
    return next;
  }

  void make() {
    use(fed_.make(options_, held_));
    made_for_ = held_;
  }

  static bool is_finite(const std::vector<double>& numbers) {
    return std::ranges::all_of(numbers, [](double value) { return std::isfinite(value); });
  }
  static Outcome not_finite(double time) { return {.status = Status::not_finite, .time = time}; }

  Outcome resample(double at) {
    Motion motion = now().state();
    motion.time = at;
    before_held_ = held_;
    for (std::size_t k = 0; k < held_.size(); ++k) {
      if ((since_[k] + 1) * fed_.laws[k].sample > at * (1 + rounding)) continue;
      since_[k] += 1;
      held_[k] = Fed::said(fed_.laws[k], motion);
    }
    if (!is_finite(held_)) {
      held_ = before_held_;
      return not_finite(at);
    }
    if (held_ == before_held_) return {};  // it goes on as it was
    made_for_ = held_;
    return hand_over(fed_.make(options_, held_), motion);
  }

  const Fed fed_;
  const RunOptions options_;
  std::vector<double> held_, since_;  // of each law: its value, and the number of its last sample
  std::vector<double> made_for_, before_held_;
};

class FedSubject : public Subject {
 public:
  explicit FedSubject(Fed fed) : fed_(std::move(fed)), names_(input_names(*fed_.subject)) {
    for (const Quantity& quantity : fed_.subject->quantities()) {
      if (quantity.role == Role::input && !own_) own_ = quantity.first;
    }
  }

  std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
    const auto size = static_cast<Eigen::Index>(state_columns(*fed_.subject).size() / 2);
    return std::make_unique<Integrator>(std::make_unique<HeldInputs>(fed_, options), size, "system with feedback");
  }

  Observation observe(const Motion& motion) const override { return fed_.subject->observe(motion); }
  std::optional<double> energy_scale() const override { return fed_.subject->energy_scale(); }
  bool loaded() const override { return true; }
  bool damped() const override { return true; }
  bool balances(Method method) const override { return !is_explicit(method) && fed_.subject->balances(method); }
  std::vector<std::string> expected_trouble(const RunOptions& options) const override {
    return fed_.subject->expected_trouble(options);
  }
  bool has_poles() const override { return fed_.subject->has_poles(); }

  /// A chain has no columns of torques otherwise: those with feedback come last.
  std::vector<Quantity> quantities() const override {
    std::vector<Quantity> quantities = fed_.subject->quantities();
    if (own_) return quantities;
    std::size_t column = columns_of(quantities).size();
    for (const std::size_t input : fed_inputs()) {
      quantities.push_back({names_[input], "N m", Role::input, "torque " + names_[input], column++});
    }
    return quantities;
  }

  void append_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    const std::size_t first = row.size();
    fed_.subject->append_row(motion, seen, row);
    if (own_) {
      for (std::size_t k = 0; k < fed_.laws.size(); ++k) row[first + *own_ + fed_.laws[k].input] += held(k, motion);
      return;
    }
    for (const std::size_t input : fed_inputs()) {
      double torque = fed_.inputs[input];
      for (std::size_t k = 0; k < fed_.laws.size(); ++k) {
        if (fed_.laws[k].input == input) torque += held(k, motion);
      }
      row.push_back(torque);
    }
  }

  std::vector<std::size_t> fed_columns() const override {
    std::vector<std::size_t> columns = fed_.subject->fed_columns();
    for (const Quantity& quantity : quantities()) {
      if (quantity.role != Role::input) continue;
      for (const SampledLaw& law : fed_.laws) {
        if (quantity.name == names_[law.input]) columns.push_back(quantity.first);
      }
    }
    return columns;
  }

  std::vector<Constant> constants() const override { return fed_.subject->constants(); }
  std::span<const std::string_view> coordinates() const override { return fed_.subject->coordinates(); }
  std::span<const std::string_view> switches() const override { return fed_.subject->switches(); }
  std::pair<std::size_t, std::size_t> shown_columns() const override { return fed_.subject->shown_columns(); }
  using Subject::distance;
  double distance(const Motion& a, const Motion& b, const Motion& size) const override {
    return fed_.subject->distance(a, b, size);
  }

 private:
  /// A start holds what is sampled there.
  double held(std::size_t law, const Motion& motion) const {
    return motion.held.size() > 0 ? motion.held[static_cast<Eigen::Index>(law)] : Fed::said(fed_.laws[law], motion);
  }

  std::vector<std::size_t> fed_inputs() const {
    std::vector<std::size_t> inputs;
    for (const SampledLaw& law : fed_.laws) {
      if (std::ranges::find(inputs, law.input) == inputs.end()) inputs.push_back(law.input);
    }
    return inputs;
  }

  Fed fed_;
  std::vector<std::string> names_;  // of inputs
  std::optional<std::size_t> own_;  // the first column of inputs, if the subject has some
};

}  // namespace

std::shared_ptr<const Subject> with_feedback(std::shared_ptr<const Subject> subject, std::vector<SampledLaw> laws) {
  if (laws.empty()) return subject;
  const std::size_t count = input_names(*subject).size();
  for (const SampledLaw& law : laws) {
    if (law.input < count && law.sample > 0) continue;
    throw std::invalid_argument("feedback: expected an input from 0 to before " + std::to_string(count) +
                                " and a sample time > 0, got " + std::to_string(law.input));
  }
  std::vector<double> inputs = inputs_of(*subject);
  return std::make_shared<FedSubject>(Fed{std::move(subject), std::move(laws), std::move(inputs)});
}

}  // namespace pendula
