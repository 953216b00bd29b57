// Scenarios: any text is a run, or an ensemble of runs, or an InputError.
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <pendula/run/library.hpp>
#include <pendula/system/interpreted_kernel.hpp>
#include <string_view>
#include <variant>

#include "fuzz/whole_text.hpp"
#include "io/errors.hpp"
#include "io/members.hpp"
#include "io/scenario_run.hpp"

namespace pendula::io {
namespace {

/// Stands for every model: what finds one runs programs.
std::shared_ptr<const SystemTable> furuta(const ModelName&) {
  static const std::shared_ptr<const SystemTable> table =
      table_of(fuzz::whole_text(FURUTA_PROGRAM), *library<const ProgramInterpreter*>());
  return table;
}

void set_up(const AnyScenario& scenario) {
  std::visit([](const auto& one) { told_at_keys(one, "scenario.toml", [&] { return setup_of(one); }); }, scenario);
}

template <class Do>
void with_input_error(Do act) {
  try {
    act();
  } catch (const InputError&) {
    // as it should be
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  with_input_error([&] { set_up(parse_scenario(text, "scenario.toml", {}, furuta)); });
  with_input_error([&] {
    const ScenarioDocument document(text, "scenario.toml", {});
    if (document.plan().count == 0) return;
    set_up(document.with(document.plan().keys(), document.plan().values(0), furuta));
    set_up(document.with(document.plan().overrides(document.plan().count - 1), furuta));
  });
  return 0;
}

}  // namespace pendula::io
