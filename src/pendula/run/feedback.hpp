#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <pendula/run/inputs.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/system/motion.hpp>
#include <vector>

namespace pendula {

/// A controller's addition to an input: a function of the motion, computed at multiples of the sample time and held in
/// between (a zero-order hold).
struct SampledLaw {
  std::size_t input = 0;  ///< index among the subject's inputs (inputs.hpp)
  std::function<double(const Motion&)> value;
  double sample = 0;                                       ///< > 0  [s]
  double limit = std::numeric_limits<double>::infinity();  ///< the largest size of what is added
};

/// The subject with sampled feedback and signals: steps end where samples and knots are. A row at a sample has the
/// inputs that are held from there on. Motions with sampled feedback have no derivatives. Throws std::invalid_argument
/// for an input that the subject does not have.
std::shared_ptr<const Subject> with_feedback(std::shared_ptr<const Subject> subject, std::vector<SampledLaw> laws,
                                             std::vector<Signal> signals = {});

}  // namespace pendula
