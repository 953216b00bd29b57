#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

namespace pendula {

/// Members of an ensemble that one thread moves together: `size` of them from `first` on.
struct Chunk {
  std::int64_t first = 0, last = 0;

  std::int64_t size() const { return last - first; }
};

/// Calls work(chunk) for every chunk that `claim` hands out, until it has none, on `threads` threads, of which this is
/// one; on fewer, where the system gives no more. `claim` and `work` are called by several at once. What either throws
/// ends the others after their chunk, and is thrown here; the first one counts.
inline void for_each_chunk(int threads, const std::function<std::optional<Chunk>()>& claim,
                           const std::function<void(const Chunk&)>& work) {
  std::mutex guard;
  std::exception_ptr failure;
  const auto has_failed = [&] {
    const std::scoped_lock lock(guard);
    return failure != nullptr;
  };
  const auto take_all = [&] {
    try {
      while (!has_failed()) {
        const std::optional<Chunk> chunk = claim();
        if (!chunk) return;
        work(*chunk);
      }
    } catch (...) {
      const std::scoped_lock lock(guard);
      if (!failure) failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    try {
      for (int k = 1; k < threads; ++k) others.emplace_back(take_all);
    } catch (const std::system_error&) {
      // those that there are do all
    }
    take_all();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace pendula
