#pragma once

#include <cstddef>
#include <memory>
#include <pendula/run/subject.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula {

/// Names of a subject's inputs; of a chain its torques, link by link: "torque_1", in space "torque_x_1".
std::vector<std::string> input_names(const Subject& subject);

/// Their constant parts.
std::vector<double> inputs_of(const Subject& subject);

/// A line that is added to an input for a time: slope (t - since).
struct InputLine {
  std::size_t input = 0;
  double slope = 0;
  double since = 0;     ///< [s]
  double duration = 0;  ///< > 0  [s]
};

/// The same subject with `inputs` as the constant parts, and with `lines` added; drives stay. It shares ownership of
/// `subject`. Throws std::invalid_argument on another number of inputs than the subject has, and on one that is not
/// finite.
std::shared_ptr<const Subject> with_inputs(const std::shared_ptr<const Subject>& subject,
                                           std::span<const double> inputs, std::span<const InputLine> lines = {});

}  // namespace pendula
