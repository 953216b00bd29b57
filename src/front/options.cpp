#include "front/options.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace pendula::front {
namespace {

template <class Option>
void read(const char* key, const char* name, Option& option) {
  if (name == nullptr) return;
  if (const std::optional<Option> found = option_of<Option>(name)) {
    option = *found;
    return;
  }
  std::string all;
  for (const std::string_view one : names_of<Option>) all += (all.empty() ? "" : ", ") + std::string(one);
  throw std::invalid_argument(
      std::string(key) + ": expected one of " + all + ", got " + name +
      (instead_of(name).empty() ? "" : ", which is gone: take " + std::string(instead_of(name))));
}

}  // namespace

RunOptions options_of(const pendula_options* given) {
  constexpr int stages_of_constant_steps = 4;
  const pendula_options asked = given == nullptr ? pendula_options{} : *given;
  RunOptions options;
  read("method", asked.method, options.method);
  read("form", asked.form, options.form);
  read("solver", asked.solver, options.solver);
  read("iteration", asked.iteration, options.iteration);
  options.step = asked.step;
  if (!(asked.step >= 0) || std::isinf(asked.step))
    throw std::invalid_argument("step: expected a number, not negative");
  if (!(asked.tolerance >= 0)) throw std::invalid_argument("tolerance: expected a number, not negative");
  if (asked.tolerance > 0) options.tolerance = asked.tolerance;
  if (options.method == Method::rk4 && asked.step == 0) {
    throw std::invalid_argument("step: expected one > 0, rk4 has none of its own choice");
  }
  options.stages = asked.stages != 0                 ? asked.stages
                   : is_adaptive(options)            ? stages_for(options.method, options.tolerance)
                   : options.method == Method::radau ? 3
                                                     : stages_of_constant_steps;
  return options;
}

}  // namespace pendula::front
