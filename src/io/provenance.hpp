#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pendula::io {

/// The public name of a file: an absolute path without its folders.
std::string public_name(const std::string& file);

/// Replaces `file` in a text by its public name.
std::string with_public_name(std::string text, const std::string& file);

/// A command line as typed, quoted for a shell; files have their public names.
std::string command_line(std::span<char* const> words);

/// A line of the CF attribute `history`: the time and the command.
std::string history_line(const std::string& command);

inline constexpr std::uint64_t empty_fingerprint = 0xcbf29ce484222325U;

/// A 64-bit hash of a text (FNV-1a), to tell it from others and to notice damage: one changed byte always changes it.
/// `before` is that of what comes before the text.
constexpr std::uint64_t fingerprint(std::string_view text, std::uint64_t before = empty_fingerprint) {
  std::uint64_t hash = before;
  for (const char byte : text) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return hash;
}

/// The same of numbers, to the last bit.
constexpr std::uint64_t fingerprint(std::span<const double> numbers, std::uint64_t before = empty_fingerprint) {
  std::uint64_t hash = before;
  for (const double number : numbers) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(number)) * 0x100000001b3U;
    hash ^= hash >> 32;
  }
  return hash;
}

/// The leading 52 bits, which a double holds exactly.
constexpr double as_number(std::uint64_t fingerprint) {
  return static_cast<double>(fingerprint >> 12);
}

}  // namespace pendula::io
