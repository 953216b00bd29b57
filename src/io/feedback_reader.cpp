#include "io/feedback_reader.hpp"

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/feedback.hpp>
#include <pendula/run/inputs.hpp>
#include <pendula/run/state_columns.hpp>
#include <string_view>
#include <utility>

#include "io/expression.hpp"
#include "io/expression_operations.hpp"
#include "io/expression_reader.hpp"
#include "io/nearest_name.hpp"
#include "io/row_function.hpp"

namespace pendula::io {
namespace {

/// The name of columns that feedback must not use: no expression can contain it.
constexpr const char* nameless = "";

/// Names of the columns that an expression may use: all but inputs and what depends on them, and with `without_energy`
/// all but the energy, too.
std::vector<std::string> names_for(const Subject& subject, bool without_energy) {
  std::vector<std::string> names = subject.columns();
  for (const Quantity& quantity : subject.quantities()) {
    const bool depends_on_inputs = quantity.role == Role::input || quantity.role == Role::force;
    const bool is_left_out = depends_on_inputs || (without_energy && quantity.role == Role::energy);
    for (std::size_t k = 0; is_left_out && k < quantity.size(); ++k) names[quantity.column(k)] = nameless;
  }
  return names;
}

template <class Read>
auto told_at(const FeedbackPlan& plan, Read read) {
  try {
    return read();
  } catch (const ExpressionError& error) {
    throw InputError(plan.place + ": expected " + error.expected + ", got " + error.got);
  }
}

/// The names that the expression of a drive may use.
const std::vector<std::string> time_alone{"t"};

std::size_t input_of(const FeedbackPlan& plan, const Subject& subject) {
  return input_named(plan.input, plan.input_place, subject);
}

/// A function of the motion that several threads may call.
std::function<double(const Motion&)> function_of(const FeedbackPlan& plan,
                                                 const std::shared_ptr<const Subject>& subject) {
  struct Guarded {
    Guarded(const std::shared_ptr<const Subject>& subject, std::shared_ptr<Expression> expression, const Motion& any)
        : function(subject, std::move(expression), any) {}
    RowFunction function;
    std::mutex guard;
  };
  const std::vector<std::string> names = plan.is_drive ? time_alone : names_for(*subject, plan.sample == 0);
  auto expression = told_at(plan, [&] { return std::make_shared<Expression>(plan.value, names); });
  const auto size = static_cast<Eigen::Index>(state_columns(*subject).size() / 2);
  const Motion any(0, Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size));
  const auto shared = std::make_shared<Guarded>(subject, std::move(expression), any);
  return [shared](const Motion& motion) {
    const std::scoped_lock lock(shared->guard);
    return shared->function(motion);
  };
}

/// A program as the generator reads it: words in postfix order. `x 9 * ~` is -(x * 9).
std::string postfix_text(const ExpressionProgram& program, const std::vector<std::string>& names,
                         const FeedbackPlan& plan) {
  using enum Operation::Of;
  std::string text;
  for (const ExpressionProgram::Node& node : program.nodes) {
    if (!text.empty()) text += ' ';
    if (!node.operation) {
      text += node.is_column ? names[program.columns[node.a]] : shortest(node.number);
    } else if (node.operation->of <= (plan.is_drive ? drives : models)) {
      text.append(node.operation->name).append(node.operation->is_function() ? "()" : "");
    } else if (plan.is_drive) {
      throw ExpressionError(
          "functions that are smooth between pieces in drives (no ==, !=, rint, floor, fmod, atan2, log2, log10; "
          "sin(2*pi*t) > 0 repeats)",
          "another one");
    } else {
      const bool is_sampled = plan.sample > 0;
      throw ExpressionError(std::string("smooth functions in ") + (is_sampled ? "exported" : "continuous") +
                                " feedback (+ - * / ^, sqrt, exp, log, trigonometric and hyperbolic ones)",
                            std::string("another one") + (is_sampled ? "" : "; sample = ... beside it allows all"));
    }
  }
  return text;
}

}  // namespace

std::string_view unit_of_input(const SystemInfo* system, std::string_view input) {
  if (system == nullptr) return "N m";
  const auto known = std::ranges::find(system->inputs, input);
  return known == system->inputs.end() ? std::string_view()
                                       : system->input_units[static_cast<std::size_t>(known - system->inputs.begin())];
}

std::vector<FeedbackPlan> read_feedback(const Section& system, const SystemInfo* info) {
  std::vector<FeedbackPlan> plans;
  for (const Section& table : system.each("feedback")) {
    FeedbackPlan plan;
    const Entry input = table.require("input"), value = table.require("value");
    plan.input = input.text();
    plan.input_place = input.place();
    plan.value = value.text();
    plan.place = value.place();
    if (info == nullptr) table.require("sample");
    if (const auto sample = table.find("sample")) plan.sample = sample->number();
    if (const auto limit = table.find("limit")) {
      if (plan.sample == 0) limit->fail("sample beside it: a limit is not smooth");
      plan.limit = limit->number(unit_of_input(info, plan.input));
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

std::size_t input_named(const std::string& input, const std::string& place, const Subject& subject) {
  const std::vector<std::string> names = input_names(subject);
  const auto found = std::ranges::find(names, input);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  constexpr std::size_t few = 12;
  std::string known;
  for (std::size_t k = 0; k < std::min(few, names.size()); ++k) known += (known.empty() ? "" : ", ") + names[k];
  if (names.size() > few) known += ", ...";
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw InputError(place + ": expected an input: " + (known.empty() ? "there is none" : known) + "; got \"" + input +
                   '"' + did_you_mean(nearest_name(input, views)));
}

InputLaw law_in_words(const FeedbackPlan& plan, const Subject& subject) {
  input_of(plan, subject);
  const std::vector<std::string> names = names_for(subject, true);
  return {plan.input, told_at(plan, [&] { return postfix_text(read_expression(plan.value, names), names, plan); })};
}

std::vector<FeedbackPlan> read_drive_values(const Section& system) {
  std::vector<FeedbackPlan> plans;
  for (const Section& table : system.each("drive")) {
    const auto value = table.find("value");
    if (!value) continue;
    const Entry input = table.require("input");
    FeedbackPlan plan;
    plan.input = input.text();
    plan.value = value->text();
    plan.is_drive = true;
    plan.place = value->place();
    plan.input_place = input.place();
    plans.push_back(std::move(plan));
  }
  return plans;
}

std::vector<InputLaw> drive_laws(const std::vector<FeedbackPlan>& plans) {
  std::vector<InputLaw> laws;
  laws.reserve(plans.size());
  for (const FeedbackPlan& plan : plans) {
    laws.push_back({plan.input, told_at(plan, [&] {
                      return postfix_text(read_expression(plan.value, time_alone), time_alone, plan);
                    })});
  }
  return laws;
}

std::vector<InputLaw> continuous_laws(const std::vector<FeedbackPlan>& plans, const SystemSubject& system) {
  std::vector<InputLaw> laws;
  for (const FeedbackPlan& plan : plans) {
    input_of(plan, system);
    if (plan.sample == 0) laws.push_back(law_in_words(plan, system));
  }
  return laws;
}

std::vector<InputFunction> continuous_functions(const std::vector<FeedbackPlan>& plans,
                                                const std::shared_ptr<const SystemSubject>& system) {
  std::vector<InputFunction> functions;
  const std::vector<std::string> inputs = input_names(*system);
  for (const FeedbackPlan& plan : plans) {
    const bool is_of_motion = plan.is_drive && std::ranges::find(inputs, plan.input) == inputs.end();
    if (plan.sample == 0 && !is_of_motion) functions.push_back({input_of(plan, *system), function_of(plan, system)});
  }
  return functions;
}

std::vector<SampledLaw> sampled_laws(const std::vector<FeedbackPlan>& plans,
                                     const std::shared_ptr<const Subject>& subject) {
  std::vector<SampledLaw> laws;
  for (const FeedbackPlan& plan : plans) {
    if (plan.sample == 0) continue;
    laws.push_back({input_of(plan, *subject), function_of(plan, subject), plan.sample, plan.limit});
  }
  return laws;
}

}  // namespace pendula::io
