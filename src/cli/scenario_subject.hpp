#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/system_subject.hpp>
#include <stdexcept>
#include <string>

#include "io/input_error.hpp"
#include "io/scenario.hpp"

namespace pendula::cli {

/// The subject of a scenario.
template <class Space>
std::shared_ptr<const Subject> subject_of(const io::Scenario<Space>& scenario) {
  return std::make_shared<ChainSubject<Space>>(scenario.chain);
}
inline std::shared_ptr<const Subject> subject_of(const io::SystemScenario& scenario) {
  return scenario.system;
}

/// Calls act(). Errors of the runtime about an option, `key: …`, become io::InputError with the place of that key.
template <class Do>
auto told_at_keys(const io::RunPlan& plan, const std::string& file, Do it) {
  try {
    return it();
  } catch (const NoKernel& error) {
    throw io::InputError(plan.places.at("links") + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    const std::size_t colon = std::min(what.find(':'), what.size());
    const auto place = plan.places.find(what.substr(0, colon));
    throw io::InputError(place == plan.places.end() ? file + ": " + what : place->second + what.substr(colon));
  }
}

}  // namespace pendula::cli
