#pragma once

#include <pendula/run/system_subject.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <string>

namespace pendula::cli {

/// Numbers of a system with default parameters; 1 for parameters without a default.
SystemNumbers usual_numbers(const SystemInfo& info);

/// The first start with a finite energy that keeps the constraints, if there is one far from where some of these follow
/// from others. Throws io::InputError, with the name of the command, where none is found.
Motion usual_start(const SystemSubject& system, const std::string& command);

}  // namespace pendula::cli
