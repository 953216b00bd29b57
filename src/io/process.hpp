#pragma once

#include <functional>
#include <string>
#include <vector>

namespace pendula::io {

/// How a program ended.
struct Ended {
  int status = 0;      ///< exit status; 127 where it could not be started
  std::string output;  ///< standard output and standard error
};

/// Runs a program and waits for it.
Ended run_process(const std::vector<std::string>& command);

/// The same with this program's standard streams; its exit status.
int run_attached(const std::vector<std::string>& command);

/// Whether `action` ends, however it ends, in a copy of this process, within half a second of processor time. For what
/// other people's libraries do with damaged files. No other thread may run.
bool comes_to_an_end(const std::function<void()>& action);

}  // namespace pendula::io
