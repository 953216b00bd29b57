#include "io/provenance.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <ctime>
#include <filesystem>
#include <string_view>

namespace pendula::io {
namespace {

/// The public form of a word of a command line, such as `/home/me/run.h5` or `--output=/home/me/run.h5`.
std::string public_word(std::string word) {
  const std::size_t equals = word.find("=/");
  const std::size_t begin = word.starts_with('/') ? 0 : word.starts_with("-o/") ? 2 : equals + 1;
  if (begin == 0 && !word.starts_with('/')) return word;  // no '=' before a '/'
  return word.erase(begin, word.rfind('/') + 1 - begin);
}

std::string quoted_for_shell(const std::string& word) {
  constexpr std::string_view plain = "_-./=:,+@%";
  const auto is_plain = [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || plain.find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::ranges::all_of(word, is_plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string public_name(const std::string& file) {
  const std::filesystem::path path(file);
  return path.is_absolute() ? path.filename().string() : file;
}

std::string with_public_name(std::string text, const std::string& file) {
  const std::string name = public_name(file);
  if (name == file) return text;
  for (std::size_t at = 0; (at = text.find(file, at)) != std::string::npos; at += name.size()) {
    text.replace(at, file.size(), name);
  }
  return text;
}

std::string command_line(std::span<char* const> words) {
  std::string text;
  for (const char* word : words) text.append(text.empty() ? "" : " ").append(quoted_for_shell(public_word(word)));
  return text;
}

std::string history_line(const std::string& command) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  std::array<char, sizeof "2000-01-01T00:00:00Z"> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return std::string(text.data()) + ": " + command;
}

}  // namespace pendula::io
