#include "io/journal.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "io/errors.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view magic = "pendula journal 1\n";
constexpr std::string_view journal_ending = ".journal";

void append(std::string& bytes, std::uint64_t word) {
  for (int k = 0; k < 8; ++k) bytes += static_cast<char>((word >> (8 * k)) & 0xff);
}

std::string head_of(const JournalKind& kind) {
  std::string head(magic);
  append(head, kind.ensemble);
  append(head, kind.width);
  return head;
}

/// A record: first member, one after the last, bytes of messages; then numbers, messages, and a hash of all that.
std::string record_of(const DoneChunk& chunk) {
  std::string messages;
  for (const DoneChunk::Message& message : chunk.messages) {
    append(messages, static_cast<std::uint64_t>(message.member));
    append(messages, message.text.size());
    messages += message.text;
  }
  std::string record;
  append(record, static_cast<std::uint64_t>(chunk.members.first));
  append(record, static_cast<std::uint64_t>(chunk.members.last));
  append(record, messages.size());
  const std::size_t size = record.size(), bytes = chunk.rows.size() * sizeof(double);
  record.resize(size + bytes);
  if (bytes > 0) std::memcpy(record.data() + size, chunk.rows.data(), bytes);
  record += messages;
  append(record, fingerprint(record));
  return record;
}

/// Reads a file from its beginning.
class Reader {
 public:
  explicit Reader(const fs::path& file) : stream_(file, std::ios::binary) {
    std::error_code unknown;
    left_ = static_cast<std::uint64_t>(fs::file_size(file, unknown));
    if (unknown) left_ = 0;
  }

  std::uint64_t left() const { return left_; }

  /// Empty if fewer bytes are left.
  std::string take(std::uint64_t bytes) {
    if (bytes > left_) return {};
    std::string text(bytes, '\0');
    if (!stream_.read(text.data(), static_cast<std::streamsize>(bytes))) return {};
    left_ -= bytes;
    return text;
  }

 private:
  std::ifstream stream_;
  std::uint64_t left_ = 0;
};

std::vector<fs::path> journals_in(const std::string& folder) {
  std::error_code none;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, none)) {
    if (entry.path().extension() == journal_ending) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

std::uint64_t word_at(std::string_view bytes, std::size_t at) {
  std::uint64_t word = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    word |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[at + k])) << (8 * k);
  }
  return word;
}

std::vector<DoneChunk::Message> messages_of(std::string_view bytes) {
  std::vector<DoneChunk::Message> messages;
  while (!bytes.empty()) {
    const std::uint64_t size = word_at(bytes, 8);
    messages.push_back({static_cast<std::int64_t>(word_at(bytes, 0)), std::string(bytes.substr(16, size))});
    bytes.remove_prefix(16 + size);
  }
  return messages;
}

/// Reads the next record; false if no complete one follows.
bool read_record(Reader& reader, const JournalKind& kind, DoneChunk& chunk) {
  constexpr std::size_t words = 24;
  std::string record = reader.take(words);
  if (record.empty()) return false;
  const std::uint64_t first = word_at(record, 0), last = word_at(record, 8), text = word_at(record, 16);
  constexpr std::uint64_t most = std::uint64_t{1} << 40;  // an upper limit of all counts, so that sums do not overflow
  if (last < first || last - first > most || text > most || kind.width > 0xffff'ffff) return false;
  if (kind.width > 0 && last - first > most / kind.width) return false;
  const std::uint64_t numbers = (last - first) * kind.width * sizeof(double);
  const std::string rest = reader.take(numbers + text + 8);
  if (rest.empty()) return false;
  record += rest;
  if (fingerprint(std::string_view(record).substr(0, record.size() - 8)) != word_at(record, record.size() - 8)) {
    return false;
  }
  chunk.members = {static_cast<std::int64_t>(first), static_cast<std::int64_t>(last)};
  chunk.rows.resize((last - first) * kind.width);
  if (numbers > 0) std::memcpy(chunk.rows.data(), record.data() + words, numbers);
  chunk.messages = messages_of(std::string_view(record).substr(words + numbers, text));
  return true;
}

}  // namespace

Journal::Journal(const std::string& folder, const JournalKind& kind) {
  std::error_code unknown;
  if (mkdir(folder.c_str(), 0777) != 0 && !fs::is_directory(folder, unknown)) {
    if (errno == EEXIST) throw InputError(folder + ": expected a folder for the journals, or nothing, got a file");
    reject_output(folder, folder, errno);
  }
  for (int k = 0; descriptor_ < 0; ++k) {
    name_ = folder + "/" + std::to_string(getpid()) + "-" + std::to_string(k) + std::string(journal_ending);
    descriptor_ = open(name_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0666);
    if (descriptor_ < 0 && errno != EEXIST) reject_output(name_, name_, errno);
  }
  write(head_of(kind));
}

Journal::~Journal() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void Journal::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw OutputError(name_, written < 0 ? errno : ENOSPC);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void Journal::add(const DoneChunk& chunk) {
  const std::string record = record_of(chunk);
  const std::scoped_lock lock(guard_);
  write(record);
  if (Clock::now() - synced_ < std::chrono::seconds(1)) return;
  if (fdatasync(descriptor_) != 0) throw OutputError(name_, errno);
  synced_ = Clock::now();
}

void Journal::sync() {
  const std::scoped_lock lock(guard_);
  if (fdatasync(descriptor_) != 0) throw OutputError(name_, errno);
}

FolderLock::FolderLock(const std::string& folder) {
  const std::string file = folder + "/lock";
  descriptor_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0 && errno == ENOENT) return;  // the last holder has removed the folder
  if (descriptor_ < 0) reject_output(file, file, errno);
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  while (fcntl(descriptor_, F_OFD_SETLKW, &whole) != 0 && errno == EINTR) {
  }
}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool journals_are_of(const std::string& folder, const JournalKind& kind) {
  const std::string head = head_of(kind);
  bool are_of_another = false;
  for (const fs::path& file : journals_in(folder)) {
    Reader reader(file);
    const std::string begin = reader.take(std::min<std::uint64_t>(head.size(), reader.left()));
    if (begin == head) return true;
    are_of_another |= !head.starts_with(begin);
  }
  return !are_of_another;
}

void read_journals(const std::string& folder, const JournalKind& kind,
                   const std::function<void(const DoneChunk&)>& take) {
  const std::string head = head_of(kind);
  for (const fs::path& file : journals_in(folder)) {
    Reader reader(file);
    if (reader.take(head.size()) != head) continue;
    for (DoneChunk chunk; read_record(reader, kind, chunk);) take(chunk);
  }
}

}  // namespace pendula::io
