#pragma once

#include <iostream>
#include <string>
#include <vector>

#include "io/kernel_cache.hpp"
#include "io/scenario.hpp"
#include "io/toolchain.hpp"

namespace pendula::cli {

/// The scenario in a file, with some keys replaced, `key.path=value`. Unless `quiet`, says when a kernel is made.
/// Throws io::InputError.
inline io::AnyScenario read_scenario(const std::string& file, const std::vector<std::string>& overrides, bool quiet) {
  const io::FindSystem find = [&](const io::ModelName& name) {
    const auto tell = [&](const std::string& what) {
      if (!quiet) std::cerr << "pendula: " << what << '\n';
    };
    return io::find_kernel(name, io::Toolchain::of_this_program(), tell).table;
  };
  const io::ScenarioText text = io::read_scenario_text(file);
  return io::parse_scenario(text.text, text.name, overrides, find);
}

}  // namespace pendula::cli
