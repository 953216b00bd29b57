// The superblock of a file: it says whether somebody has the file open, and where it ends.

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "io/files.hpp"
#include "io/hdf5.hpp"

namespace pendula::io::hdf5 {
namespace {

/// Checksum of the superblock: Bob Jenkins' lookup3.
std::uint32_t checksum(std::span<const unsigned char> bytes) {
  const auto rotated = [](std::uint32_t x, int by) { return (x << by) | (x >> (32 - by)); };
  std::uint32_t a = 0xdeadbeef + static_cast<std::uint32_t>(bytes.size()), b = a, c = a;
  std::array<unsigned char, 12> block{};
  while (!bytes.empty()) {
    const std::size_t taken = std::min<std::size_t>(bytes.size(), block.size());
    block.fill(0);
    std::copy_n(bytes.begin(), taken, block.begin());
    bytes = bytes.subspan(taken);
    const auto word = [&](std::size_t at) {
      return static_cast<std::uint32_t>(block[at]) | static_cast<std::uint32_t>(block[at + 1]) << 8 |
             static_cast<std::uint32_t>(block[at + 2]) << 16 | static_cast<std::uint32_t>(block[at + 3]) << 24;
    };
    a += word(0), b += word(4), c += word(8);
    if (!bytes.empty()) {
      a -= c, a ^= rotated(c, 4), c += b;
      b -= a, b ^= rotated(a, 6), a += c;
      c -= b, c ^= rotated(b, 8), b += a;
      a -= c, a ^= rotated(c, 16), c += b;
      b -= a, b ^= rotated(a, 19), a += c;
      c -= b, c ^= rotated(b, 4), b += a;
    } else {
      c ^= b, c -= rotated(b, 14);
      a ^= c, a -= rotated(c, 11);
      b ^= a, b -= rotated(a, 25);
      c ^= b, c -= rotated(b, 16);
      a ^= c, a -= rotated(c, 4);
      b ^= a, b -= rotated(a, 14);
      c ^= b, c -= rotated(b, 24);
    }
  }
  return c;
}

std::uint64_t number_in(std::span<const unsigned char> bytes) {
  std::uint64_t number = 0;
  for (std::size_t k = bytes.size(); k-- > 0;) number = number << 8 | bytes[k];
  return number;
}
void put_number(std::uint64_t number, std::span<unsigned char> bytes) {
  for (unsigned char& byte : bytes) {
    byte = static_cast<unsigned char>(number);
    number >>= 8;
  }
}

}  // namespace

// Superblock version 3, bytes: signature (8), version (1), sizes (2), flags (1), four addresses (32; the third is the
// end of the file), checksum (4).
void mark_as_closed(const std::string& file) {
  constexpr std::size_t version_at = 8, flags_at = 11, end_at = 28, checksum_at = 44;
  std::array<unsigned char, 48> block{};
  struct stat status {};
  const Descriptor descriptor(open(file.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor.get() < 0 || pread(descriptor.get(), block.data(), block.size(), 0) != ssize_t{48}) return;
  if (block[version_at] != 3 || fstat(descriptor.get(), &status) != 0) return;
  const std::array<unsigned char, 48> before = block;
  block[flags_at] = 0;
  const auto end = static_cast<std::uint64_t>(status.st_size);
  if (number_in(std::span(block).subspan(end_at, 8)) < end) put_number(end, std::span(block).subspan(end_at, 8));
  if (block == before) return;
  put_number(checksum(std::span(block).first(checksum_at)), std::span(block).subspan(checksum_at, 4));
  if (pwrite(descriptor.get(), block.data(), block.size(), 0) != ssize_t{48}) return;  // the mark stays: harmless
}

}  // namespace pendula::io::hdf5
