#pragma once

#include <string>
#include <vector>

#include "io/run_source.hpp"
#include "io/signal_reader.hpp"

namespace pendula::io {

/// The overrides of a run, and those that put numbers in place of the files of its signals: a run file needs no other.
std::vector<std::string> overrides_with_numbers(const RunSource& source, const std::vector<SignalPlan>& signals);

}  // namespace pendula::io
