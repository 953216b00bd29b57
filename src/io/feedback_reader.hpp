#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <pendula/run/feedback.hpp>
#include <pendula/run/subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "io/model_name.hpp"
#include "io/section.hpp"

namespace pendula::io {

/// Feedback as a scenario describes it. Its expression is read once the columns of the rows are known.
struct FeedbackPlan {
  std::string input, value;
  double sample = 0;      ///< 0: continuous  [s]
  bool is_drive = false;  ///< a function of time alone, and of pieces
  double limit = std::numeric_limits<double>::infinity();
  std::string place, input_place;  ///< `where: key` of `value` and of `input`
};

/// Reads the values of [[system.drive]], which are laws, too. Throws InputError.
std::vector<FeedbackPlan> read_drive_values(const Section& system);

/// The same as laws in the words of the generator, which checks whether an input, or a motion, has such a name. Throws
/// InputError if an expression cannot be read, or does not depend on time alone.
std::vector<InputLaw> drive_laws(const std::vector<FeedbackPlan>& plans);

/// The unit of an input of a system; empty if it is no input. Without `system`, that of a chain's torques.
std::string_view unit_of_input(const SystemInfo* system, std::string_view input);

/// Reads the tables [[system.feedback]] or [[chain.feedback]] of [system] or [chain]. Without `info`, of a chain, whose
/// feedback is always sampled. Throws InputError.
std::vector<FeedbackPlan> read_feedback(const Section& system, const SystemInfo* info = nullptr);

/// The index of an input of a subject. Throws InputError with the place of its name.
std::size_t input_named(const std::string& input, const std::string& place, const Subject& subject);

/// One plan, continuous or sampled, in the words of the generator. Throws InputError as continuous_laws.
InputLaw law_in_words(const FeedbackPlan& plan, const Subject& subject);

/// The continuous plans, in the words of the generator. Throws InputError if an expression cannot be read, names
/// something unknown, or is not smooth.
std::vector<InputLaw> continuous_laws(const std::vector<FeedbackPlan>& plans, const SystemSubject& system);

/// The same as functions, with those of drives of inputs. `system` is without feedback.
std::vector<InputFunction> continuous_functions(const std::vector<FeedbackPlan>& plans,
                                                const std::shared_ptr<const SystemSubject>& system);

/// The sampled plans. Throws InputError as continuous_laws.
std::vector<SampledLaw> sampled_laws(const std::vector<FeedbackPlan>& plans,
                                     const std::shared_ptr<const Subject>& subject);

}  // namespace pendula::io
