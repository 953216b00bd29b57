#pragma once

#include <filesystem>
#include <memory>
#include <pendula/run/inputs.hpp>
#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

#include "io/section.hpp"

namespace pendula::io {

/// A table [[system.signal]] or [[chain.signal]] of a scenario, with its numbers.
struct SignalPlan {
  std::string input;
  std::string input_place;  ///< the place of the input's name, as `where: key`, for later errors
  Signal signal;            ///< its input is not set yet
};

/// Reads [[NAME.signal]] of the table of a system or a chain; files are relative to `folder`. Throws InputError.
std::vector<SignalPlan> read_signals(const Section& system, const std::filesystem::path& folder,
                                     const SystemInfo* info = nullptr);

/// Throws InputError for an input that the subject does not have.
std::vector<Signal> signals_of(const std::vector<SignalPlan>& plans, const Subject& subject);

}  // namespace pendula::io
