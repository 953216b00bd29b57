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

/// The last line of a program's output; empty if there is none.
std::string last_line(const std::string& output);

/// Runs a program and waits for it. Calls ask(), if given, many times a second meanwhile; if that throws, the program
/// is ended.
Ended run_process(const std::vector<std::string>& command, const std::function<void()>& ask = {});

/// Runs a program with this program's standard streams. Returns its exit status.
int run_attached(const std::vector<std::string>& command);

/// Whether `action` ends, in whatever way, in a child process within half a second of processor time. Guards against
/// libraries that loop forever on damaged files. Other threads do not exist there: if it waits for a lock of one, it is
/// ended after half a minute.
bool comes_to_an_end(const std::function<void()>& action);

}  // namespace pendula::io
