#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <pendula/numeric/directions.hpp>
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

/// A subject, the laws and signals that are added to its inputs, and its own constant inputs.
struct Fed {
  std::shared_ptr<const Subject> subject;
  std::vector<SampledLaw> laws;
  std::vector<Signal> signals;
  std::vector<double> inputs;

  /// The value of a law at a motion, within its limit; NaN where it has no value.
  static double said(const SampledLaw& law, const Motion& motion) {
    const double value = law.value(motion);
    return std::isnan(value) ? value : std::clamp(value, -law.limit, law.limit);
  }

  /// The subject while laws hold these values, and signals follow their lines from the last knots before `time`.
  std::shared_ptr<const Subject> part(const std::vector<double>& held, double time) const {
    std::vector<double> all = inputs;
    for (std::size_t k = 0; k < laws.size(); ++k) all[laws[k].input] += held[k];
    std::vector<InputLine> lines;
    for (const Signal& signal : signals) {
      const std::ptrdiff_t knot = signal.knot_before(time);
      const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(knot, 0));
      all[signal.input] += signal.values[at];
      const double slope = signal.slope_after(knot);
      if (slope == 0) continue;
      lines.push_back({signal.input, slope, signal.times[at], signal.times[at + 1] - signal.times[at]});
    }
    return with_inputs(subject, all, lines);
  }

  double next_knot(double time) const {
    double next = std::numeric_limits<double>::infinity();
    for (const Signal& signal : signals) next = std::min(next, signal.next_knot(time));
    return next;
  }

  /// The sum of all signals on an input.
  double signal(std::size_t input, double time) const {
    double sum = 0;
    for (const Signal& one : signals) {
      if (one.input == input) sum += one.at(time);
    }
    return sum;
  }

  /// Whether something is added to an input.
  bool feeds(std::size_t input) const {
    return std::ranges::find(laws, input, &SampledLaw::input) != laws.end() ||
           std::ranges::find(signals, input, &Signal::input) != signals.end();
  }
};

/// Steps of a subject whose inputs are held from sample to sample, or are lines from knot to knot. At each sample or
/// knot a new integrator takes over.
class HeldInputs : public Relay {
 public:
  HeldInputs(const Fed& fed, const RunOptions& options)
      : fed_(fed), options_(options), held_(fed.laws.size()), since_(fed.laws.size()) {
    make();
  }

  Outcome start(double time, const double* q, const double* v) override {
    const Motion motion = motion_of(time, q, v);
    for (std::size_t k = 0; k < held_.size(); ++k) {
      held_[k] = Fed::said(fed_.laws[k], motion);
      since_[k] = std::floor(time / fed_.laws[k].sample * (1 + rounding));
    }
    if (!is_finite(held_)) return not_finite(time);
    knot_ = time;
    make_if_new();
    return begin(motion);
  }

  Outcome step(double h) override {
    forget();
    const double knot = fed_.next_knot(time()), next = std::min(next_sample(), knot), left = next - time();
    const bool reaches = h >= left * (1 - rounding);
    const Outcome stepped = now().step(reaches ? left : h);
    count();
    if (!stepped || std::isinf(next) || next - time() > rounding * std::abs(next)) return stepped;
    const Outcome begun = go_on_from(next, knot <= next * (1 + rounding));
    return begun ? stepped : begun;
  }

  std::span<const double> held(double time) const override {
    // A row at 0.3 s belongs to the third sample of 0.1 s, even if rounding puts it before that sample.
    return has_before() && time < now().time() * (1 - rounding) ? before_held_ : held_;
  }

  bool depends_on_end(double h) const override {
    return h < std::min(next_sample(), fed_.next_knot(time())) - time() && now().depends_on_end(h);
  }

  void member(MemberNumbers& numbers) override {
    numbers(held_, since_, knot_, done_, all_);
    make_if_new();
    own_member(numbers);
  }

  int linearize() override {
    if (!fed_.laws.empty()) throw std::invalid_argument(sampled_has_no_derivatives);
    keep_last();
    return rows_ = now().linearize();
  }
  int parameters() override { return now().parameters(); }
  int conditions() const override { return now().conditions(); }
  double resolved_decay(double error) const override { return now().resolved_decay(error); }
  void push(double* tangents, int count, const double* parameters) override {
    Eigen::Map<Directions<>> given(tangents, rows_, count);
    Directions<> moved = given;
    if (parameters == nullptr) {
      last().push(moved);
    } else {
      last().push(moved, Eigen::Map<const Directions<>>(parameters, this->parameters(), count));
    }
    given = moved;
  }
  void pull(double* gradients, int count, double* parameters) override {
    Eigen::Map<Directions<>> given(gradients, rows_, count);
    Directions<> moved = given;
    if (parameters == nullptr) {
      last().pull(moved);
    } else {
      Eigen::Map<Directions<>> sum(parameters, this->parameters(), count);
      Directions<> of_parameters = sum;
      last().pull(moved, of_parameters);
      sum = of_parameters;
    }
    given = moved;
  }

 private:
  static constexpr double rounding = Signal::rounding;

  double next_sample() const {
    double next = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < since_.size(); ++k) next = std::min(next, (since_[k] + 1) * fed_.laws[k].sample);
    return next;
  }

  std::unique_ptr<Integrator> made() {
    made_for_ = held_;
    made_at_ = knot_;
    std::unique_ptr<Integrator> made = fed_.part(held_, knot_)->make_integrator(options_);
    if (rows_ > 0) made->linearize();
    return made;
  }
  void make() { use(made()); }
  void make_if_new() {
    const bool is_same = fed_.signals.empty() || knot_ == made_at_;
    if (held_ != made_for_ || !is_same) make();
  }

  static bool is_finite(const std::vector<double>& numbers) {
    return std::ranges::all_of(numbers, [](double value) { return std::isfinite(value); });
  }
  static Outcome not_finite(double time) { return {.status = Status::not_finite, .time = time}; }

  Outcome go_on_from(double at, bool is_knot) {
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
    if (held_ == before_held_ && !is_knot) return {};  // the same integrator goes on
    knot_ = at;
    return hand_over(made(), motion);
  }

  const Fed fed_;
  const RunOptions options_;
  std::vector<double> held_, since_;  // of each law: its value, and the number of its last sample
  std::vector<double> made_for_, before_held_;
  double knot_ = 0, made_at_ = 0;  // times of signals: of the present lines; of those of the integrator  [s]
  int rows_ = 0;                   // of tangents; 0 without derivatives
};

class FedSubject : public Subject {
 public:
  explicit FedSubject(Fed fed) : fed_(std::move(fed)), names_(input_names(*fed_.subject)) {
    for (const Quantity& quantity : fed_.subject->motion_quantities()) {
      if (quantity.role == Role::input && !own_) own_ = quantity.first;
    }
  }

  std::unique_ptr<Integrator> make_integrator(const RunOptions& options) const override {
    const auto size = static_cast<Eigen::Index>(state_columns(*fed_.subject).size() / 2);
    return std::make_unique<Integrator>(std::make_unique<HeldInputs>(fed_, options), size, "system with feedback");
  }

  /// Forces of constraints depend on inputs.
  Observation observe(const Motion& motion) const override {
    Observation seen = fed_.subject->observe(motion);
    if (seen.forces.size() == 0) return seen;
    std::vector<double> inputs = fed_.inputs;
    for (std::size_t k = 0; k < fed_.laws.size(); ++k) inputs[fed_.laws[k].input] += held(k, motion);
    for (const Signal& signal : fed_.signals) inputs[signal.input] += signal.at(motion.time);
    return pendula::with_inputs(fed_.subject, inputs, {})->observe(motion);
  }
  std::optional<double> energy_scale() const override { return fed_.subject->energy_scale(); }
  bool loaded() const override { return true; }
  void close(Motion& state) const override { fed_.subject->close(state); }
  bool damped() const override { return true; }
  bool balances(Method method) const override { return !is_explicit(method) && fed_.subject->balances(method); }
  std::vector<std::string> expected_trouble(const RunOptions& options) const override {
    return fed_.subject->expected_trouble(options);
  }
  bool has_poles() const override { return fed_.subject->has_poles(); }

  /// Without feedback a chain has no columns of torques. Those with feedback come last.
  std::vector<Quantity> motion_quantities() const override {
    std::vector<Quantity> quantities = fed_.subject->motion_quantities();
    if (own_) return quantities;
    std::size_t column = columns_of(quantities).size();
    for (const std::size_t input : fed_inputs()) {
      quantities.push_back({names_[input], "N m", Role::input, "torque " + names_[input], column++});
    }
    return quantities;
  }

  std::shared_ptr<Subject> copy() const override { return std::make_shared<FedSubject>(fed_); }

  void append_motion_row(const Motion& motion, const Observation& seen, std::vector<double>& row) const override {
    const std::size_t first = row.size();
    fed_.subject->append_motion_row(motion, seen, row);
    if (own_) {
      for (std::size_t k = 0; k < fed_.laws.size(); ++k) row[first + *own_ + fed_.laws[k].input] += held(k, motion);
      for (const Signal& signal : fed_.signals) row[first + *own_ + signal.input] += signal.at(motion.time);
      return;
    }
    for (const std::size_t input : fed_inputs()) {
      double torque = fed_.inputs[input] + fed_.signal(input, motion.time);
      for (std::size_t k = 0; k < fed_.laws.size(); ++k) {
        if (fed_.laws[k].input == input) torque += held(k, motion);
      }
      row.push_back(torque);
    }
  }

  std::vector<std::size_t> fed_columns() const override {
    std::vector<std::size_t> columns = fed_.subject->fed_columns();
    for (const Quantity& quantity : motion_quantities()) {
      if (quantity.role != Role::input) continue;
      for (const std::size_t input : fed_inputs()) {
        if (quantity.name == names_[input]) columns.push_back(quantity.first);
      }
    }
    return columns;
  }

  std::shared_ptr<const Subject> part_at(double time) const override {
    return fed_.laws.empty() ? fed_.part({}, time) : nullptr;
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
  /// The start holds the value that is sampled there.
  double held(std::size_t law, const Motion& motion) const {
    return motion.held.size() > 0 ? motion.held[static_cast<Eigen::Index>(law)] : Fed::said(fed_.laws[law], motion);
  }

  std::vector<std::size_t> fed_inputs() const {
    std::vector<std::size_t> inputs;
    for (std::size_t input = 0; input < names_.size(); ++input) {
      if (fed_.feeds(input)) inputs.push_back(input);
    }
    return inputs;
  }

  Fed fed_;
  std::vector<std::string> names_;  // of inputs
  std::optional<std::size_t> own_;  // the first column of inputs, if the subject has some
};

}  // namespace

std::shared_ptr<const Subject> with_feedback(std::shared_ptr<const Subject> subject, std::vector<SampledLaw> laws,
                                             std::vector<Signal> signals) {
  if (laws.empty() && signals.empty()) return subject;
  const std::size_t count = input_names(*subject).size();
  for (const SampledLaw& law : laws) {
    if (law.input < count && law.sample > 0) continue;
    throw std::invalid_argument("feedback: expected an input from 0 to before " + std::to_string(count) +
                                " and a sample time > 0, got " + std::to_string(law.input));
  }
  for (const Signal& signal : signals) {
    const bool is_table = !signal.times.empty() && signal.times.size() == signal.values.size() &&
                          std::ranges::adjacent_find(signal.times, std::greater_equal()) == signal.times.end();
    if (signal.input < count && is_table) continue;
    throw std::invalid_argument("signal: expected an input from 0 to before " + std::to_string(count) +
                                " and values at times that ascend, got input " + std::to_string(signal.input) +
                                " and " + std::to_string(signal.times.size()) + " times");
  }
  std::vector<double> inputs = inputs_of(*subject);
  return std::make_shared<FedSubject>(Fed{std::move(subject), std::move(laws), std::move(signals), std::move(inputs)});
}

}  // namespace pendula
