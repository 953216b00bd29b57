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

/// Members of an ensemble that are done: rows of numbers, and what there is to say of some.
struct DoneChunk {
  struct Message {
    std::int64_t member;
    std::string text;
  };

  Chunk members;
  std::vector<double> rows;  ///< (members x width), row by row
  std::vector<Message> messages;
};

/// What all journals of one ensemble have in common; those of another are not read.
struct JournalKind {
  std::uint64_t ensemble = 0;  ///< that tells it from others: of scenario, program and instruction set
  std::uint64_t width = 0;     ///< numbers of a member
};

/// A file that chunks are appended to by several threads. What `add` returned from is there after a `kill -9`; after a
/// loss of power what `sync` was called for, which `add` does once a second at most. A record that was cut short is
/// noticed when it is read.
class Journal {
 public:
  /// Begins a file of its own in the folder, which is made where it is not there. Throws InputError where it cannot be
  /// written.
  Journal(const std::string& folder, const JournalKind& kind);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Throws OutputError.
  void add(const DoneChunk& chunk);
  /// To the disk. Throws OutputError.
  void sync();

 private:
  using Clock = std::chrono::steady_clock;

  void write(std::string_view bytes);

  std::mutex guard_;
  std::string name_;
  int descriptor_ = -1;
  Clock::time_point synced_ = Clock::now();
};

/// Held by one process at a time: the others wait where they make it. The folder may be gone when they get it.
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

/// Whether any journal in the folder is of that kind, or none of another: one that was cut short before it says what it
/// is of counts for nothing.
bool journals_are_of(const std::string& folder, const JournalKind& kind);

/// Calls take(chunk) for every whole record of all journals in the folder, in any order, some perhaps twice.
void read_journals(const std::string& folder, const JournalKind& kind,
                   const std::function<void(const DoneChunk&)>& take);

}  // namespace pendula::io
