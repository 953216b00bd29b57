#include "io/signal_reader.hpp"

#include <cmath>
#include <cstddef>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <utility>

#include "io/feedback_reader.hpp"
#include "io/number_table.hpp"
#include "io/signal_origin.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {
namespace {

constexpr const char* times_column = "t";

void read_file(const Section& table, const Entry& file, const std::filesystem::path& folder, SignalPlan& plan) {
  for (const char* key : {"times", "values"}) {
    if (const auto beside = table.find(key)) beside->fail("nothing beside file");
  }
  const auto column = table.find("column");
  const std::filesystem::path given = file.text();
  const NumberTable numbers = read_number_table(given.is_absolute() ? given : folder / given,
                                                {times_column, column ? column->text() : plan.input});
  plan.signal.times = numbers.columns[0];
  plan.signal.values = numbers.columns[1];
  for (std::size_t k = 1; k < numbers.lines.size(); ++k) {
    const double before = plan.signal.times[k - 1], time = plan.signal.times[k];
    if (time > before) continue;
    throw InputError(numbers.place(k) + ": t: expected a time after " + shortest(before) + ", got " + shortest(time));
  }
}

void read_arrays(const Section& table, SignalPlan& plan) {
  const Entry times = table.require("times", "a file, or times and values"), values = table.require("values");
  if (const auto column = table.find("column")) column->fail("nothing without file");
  if (times.size() == 0) times.fail("an array of times, one at least");
  if (values.size() != times.size()) {
    values.fail("as many numbers as times has, " + std::to_string(times.size()));
  }
  for (std::size_t k = 0; k < times.size(); ++k) {
    const double time = times.element(k).number();
    if (k > 0 && time <= plan.signal.times.back()) times.element(k).fail("a time after the one before it");
    plan.signal.times.push_back(time);
    plan.signal.values.push_back(values.element(k).number());
  }
}

/// In TOML, where 1e300 and 1 are numbers as they are.
std::string array_of(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "[" : ", ") + shortest(number);
  return text + "]";
}

}  // namespace

std::vector<SignalPlan> read_signals(const Section& system, const std::filesystem::path& folder) {
  std::vector<SignalPlan> plans;
  for (const Section& table : system.each("signal")) {
    SignalPlan plan;
    const Entry input = table.require("input");
    plan.input = input.text();
    plan.input_place = input.place();
    plan.signal.is_held = table.truth("hold");
    if (const auto file = table.find("file")) {
      read_file(table, *file, folder, plan);
    } else {
      read_arrays(table, plan);
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

std::vector<std::string> overrides_with_numbers(const RunSource& source, const std::vector<SignalPlan>& signals) {
  std::vector<std::string> overrides = source.overrides;
  if (signals.empty()) return overrides;
  const toml::table document = parse_toml(source.text.text, source.text.name, source.overrides);
  const std::string kind = document.contains("system") ? "system" : "chain";
  for (std::size_t k = 0; k < signals.size(); ++k) {
    if (!document[kind]["signal"][k]["file"]) continue;
    const SignalPlan& plan = signals[k];
    overrides.push_back(kind + ".signal[" + std::to_string(k + 1) + "]={input=" + toml_string(plan.input) +
                        ", hold=" + (plan.signal.is_held ? "true" : "false") +
                        ", times=" + array_of(plan.signal.times) + ", values=" + array_of(plan.signal.values) + "}");
  }
  return overrides;
}

std::vector<Signal> signals_of(const std::vector<SignalPlan>& plans, const Subject& subject) {
  std::vector<Signal> signals;
  for (const SignalPlan& plan : plans) {
    signals.push_back(plan.signal);
    signals.back().input = input_named(plan.input, plan.input_place, subject);
  }
  return signals;
}

}  // namespace pendula::io
