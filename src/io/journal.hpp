#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <pendula/ensemble/chunks.hpp>
#include <span>
#include <string>
#include <vector>

namespace pendula::io {

/// Results of a range of members: rows of numbers, and messages of some members.
struct DoneChunk {
  struct Message {
    std::int64_t member;
    std::string text;
  };

  Chunk members;
  std::vector<double> rows;  ///< (members x width), row by row
  std::vector<Message> messages;
};

/// The kind of a journal. Journals of one ensemble have the same; others are not read.
struct JournalKind {
  std::uint64_t ensemble = 0;  ///< fingerprint of scenario, program and instruction set
  std::uint64_t width = 0;     ///< numbers of a member
};

/// A file to which several threads append chunks. A chunk survives a `kill -9` once `add` has returned, and a loss of
/// power once `sync` has, which `add` calls at most once a second. A truncated record is noticed on reading.
class Journal {
 public:
  /// Begins a new file in the folder, which is made if needed. Throws InputError if it cannot be written.
  Journal(const std::string& folder, const JournalKind& kind);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Throws OutputError.
  void add(const DoneChunk& chunk);
  /// Writes everything to the disk. Throws OutputError.
  void sync();

 private:
  using Clock = std::chrono::steady_clock;

  void write(std::string_view bytes);

  std::mutex guard_;
  std::string name_;
  int descriptor_ = -1;
  Clock::time_point synced_ = Clock::now();
};

/// A lock on a folder, held by one process at a time. The constructor waits for it; the folder may have been removed by
/// then.
class FolderLock {
 public:
  /// Throws InputError where the folder cannot be written.
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_ = -1;
};

/// Whether the journals in the folder are of that kind. A journal that was truncated within its head does not count.
bool journals_are_of(const std::string& folder, const JournalKind& kind);

/// Calls take(chunk) for every complete record of all journals in the folder, in any order, possibly twice for some.
void read_journals(const std::string& folder, const JournalKind& kind,
                   const std::function<void(const DoneChunk&)>& take);

}  // namespace pendula::io
