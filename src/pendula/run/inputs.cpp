#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/subject_kinds.hpp>
#include <stdexcept>

namespace pendula {
namespace {

std::vector<std::string> names(const SystemSubject& system) {
  return {system.info().inputs.begin(), system.info().inputs.end()};
}

template <class Space>
std::vector<std::string> names(const ChainSubject<Space>& chain) {
  std::vector<std::string> names;
  for (int link = 1; link <= chain.chain().links(); ++link) {
    for (int axis = 0; axis < Space::torque_components; ++axis) {
      const std::string of = Space::torque_components == 1 ? "" : std::string(1, "xyz"[axis]) + '_';
      names.push_back("torque_" + of + std::to_string(link));
    }
  }
  return names;
}

std::vector<double> inputs(const SystemSubject& system) {
  return system.numbers().inputs;
}

template <class Space>
std::vector<double> inputs(const ChainSubject<Space>& chain) {
  const auto& torque = chain.chain().constant_torque();
  return {torque.data(), torque.data() + torque.size()};
}

/// A line as a sine of so small an angle that the two agree to the last digit: sin(x) = x (1 - x^2/6 ...).
InputSine sine_of(const InputLine& line) {
  constexpr double turn = 1e-9;
  const double frequency = turn / line.duration;
  return {static_cast<int>(line.input), line.slope / frequency, frequency, -frequency * line.since};
}

}  // namespace

std::vector<std::string> input_names(const Subject& subject) {
  return as_its_kind(subject, [](const auto& kind) { return names(kind); });
}

std::vector<double> inputs_of(const Subject& subject) {
  return as_its_kind(subject, [](const auto& kind) { return inputs(kind); });
}

std::shared_ptr<const Subject> with_inputs(const std::shared_ptr<const Subject>& subject,
                                           std::span<const double> inputs, std::span<const InputLine> lines) {
  const std::vector<std::string> known = input_names(*subject);
  if (inputs.size() != known.size()) {
    throw std::invalid_argument("inputs: expected " + std::to_string(known.size()) + " numbers, got " +
                                std::to_string(inputs.size()));
  }
  for (std::size_t k = 0; k < known.size(); ++k) {
    if (std::isfinite(inputs[k])) continue;
    throw std::invalid_argument(known[k] + ": expected a finite number, got " + shortest(inputs[k]));
  }
  std::vector<InputSine> sines;
  for (const InputLine& line : lines) sines.push_back(sine_of(line));
  return subject->with_inputs(inputs, sines);
}

}  // namespace pendula
