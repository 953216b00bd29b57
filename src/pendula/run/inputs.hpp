#pragma once

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

/// The same subject with these as constant parts, which keeps the first one; drives stay. Throws std::invalid_argument
/// on another number of inputs than it has, and on one that is not finite.
std::shared_ptr<const Subject> with_inputs(const std::shared_ptr<const Subject>& subject,
                                           std::span<const double> inputs);

}  // namespace pendula
