#pragma once

#include <string>
#include <vector>

namespace pendula::io {

/// How a program ended.
struct Ended {
  int status = 0;      ///< exit status; 127 where it could not be started
  std::string output;  ///< standard output and standard error
};

/// Runs a program and waits for it; `environment` are NAME=VALUE beside the present ones.
Ended run_process(const std::vector<std::string>& command, const std::vector<std::string>& environment = {});

/// The same with this program's standard streams; its exit status.
int run_attached(const std::vector<std::string>& command, const std::vector<std::string>& environment = {});

}  // namespace pendula::io
