#include "cli/interrupt.hpp"

#include <csignal>
#include <cstddef>

namespace pendula::cli {
namespace {

#ifdef __ELF__
struct sigaction inherited_hang_up = {};
bool is_known = false;  // not all systems run the function below

// Run before the libraries' own code; sanitizers may not yet be ready.
__attribute__((no_sanitize("address", "undefined"))) void note_inherited() {
  is_known = sigaction(SIGHUP, nullptr, &inherited_hang_up) == 0;
}

[[gnu::section(".preinit_array"), gnu::used]] void (*const noted_before_libraries)() = &note_inherited;
#endif

volatile std::sig_atomic_t noted = 0;

void note(int) {
  noted = 1;
}

}  // namespace

void restore_hang_up() {
#ifdef __ELF__
  if (is_known) sigaction(SIGHUP, &inherited_hang_up, nullptr);
#endif
}

InterruptGuard::InterruptGuard() {
  noted = 0;
  struct sigaction action {};
  action.sa_handler = note;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // a second signal has its default effect
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < signals.size(); ++i) {
    sigaction(signals[i], nullptr, &before_[i]);
    if (before_[i].sa_handler != SIG_IGN) sigaction(signals[i], &action, nullptr);  // nohup stays nohup
  }
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < signals.size(); ++i) sigaction(signals[i], &before_[i], nullptr);
}

bool InterruptGuard::interrupted() const {
  return noted != 0;
}

}  // namespace pendula::cli
