#include "io/process.hpp"

#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace pendula::io {
namespace {

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// Time between calls of ask() while waiting for another program  [ms].
constexpr int patience = 50;

std::string read_all(int descriptor, const std::function<void()>& ask) {
  std::string text;
  std::array<char, 4096> block;
  pollfd waits{descriptor, POLLIN, 0};
  for (ssize_t count = 0;;) {
    if (ask) ask();
    if (poll(&waits, 1, ask ? patience : -1) <= 0) continue;
    if ((count = read(descriptor, block.data(), block.size())) == 0) break;
    if (count < 0 && errno != EINTR) break;
    if (count > 0) text.append(block.data(), static_cast<std::size_t>(count));
  }
  return text;
}

int wait_for(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// Starts a program. Returns its process, and an errno if it could not be started.
std::pair<pid_t, int> spawn(std::vector<std::string> arguments, const posix_spawn_file_actions_t* actions) {
  pid_t child = 0;
  const int error =
      posix_spawnp(&child, arguments.front().c_str(), actions, nullptr, pointers(arguments).data(), environ);
  return {child, error};
}

}  // namespace

std::string last_line(const std::string& output) {
  const std::size_t end = output.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const std::size_t begin = output.find_last_of('\n', end);
  return output.substr(begin == std::string::npos ? 0 : begin + 1,
                       end - (begin == std::string::npos ? 0 : begin + 1) + 1);
}

Ended run_process(const std::vector<std::string>& command, const std::function<void()>& ask) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return {127, std::strerror(errno)};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  const auto [child, error] = spawn(command, &actions);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  Ended ended{127, error != 0 ? std::strerror(error) : ""};
  if (error == 0) {
    try {
      ended.output = read_all(ends[0], ask);
    } catch (...) {
      kill(child, SIGTERM);
      wait_for(child);
      close(ends[0]);
      throw;
    }
    ended.status = wait_for(child);
  }
  close(ends[0]);
  return ended;
}

int run_attached(const std::vector<std::string>& command) {
  const auto [child, error] = spawn(command, nullptr);
  return error != 0 ? 127 : wait_for(child);
}

bool comes_to_an_end(const std::function<void()>& action) {
  const pid_t child = fork();
  if (child < 0) return true;  // no child process: not checked
  if (child > 0) return wait_for(child) == 0;
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  constexpr itimerval half_a_second{{0, 0}, {0, 500'000}}, half_a_minute{{0, 0}, {30, 0}};
  setitimer(ITIMER_PROF, &half_a_second, nullptr);
  setitimer(ITIMER_REAL, &half_a_minute, nullptr);  // for a lock held by a thread that this process does not have
  try {
    action();
  } catch (...) {  // the caller will meet the same exception
  }
  _exit(0);
}

}  // namespace pendula::io
