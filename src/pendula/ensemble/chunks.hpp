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

/// Calls work(chunk) for every chunk that `claim` returns, until it returns none, on `threads` threads; this one counts
/// as one of them, and fewer are used where the system gives no more. Several threads call `claim` and `work` at once.
/// If one throws, the others end after their chunk, and the first exception is thrown here.
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
      // the threads that exist do all the work
    }
    take_all();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace pendula
