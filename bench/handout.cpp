// pendula_handout FOLDER: what an ensemble costs besides its members, as one line of JSON. Under mpirun the number of
// the next chunk is with rank 0, as in `pendula ensemble`.
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "cli/ranks.hpp"
#include "io/journal.hpp"

namespace {

using Clock = std::chrono::steady_clock;

double microseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
}

/// Of one claim, while all ranks claim as fast as they can: the worst that there is.
double claim_microseconds(pendula::cli::Ranks& ranks) {
  constexpr int claims = 20000;
  ranks.all(true);
  const auto begin = Clock::now();
  for (int k = 0; k < claims; ++k) ranks.claim();
  return microseconds_since(begin) / claims;
}

/// Of one chunk of 256 members with 12 numbers each.
double record_microseconds(const std::string& folder) {
  constexpr int chunks = 2000;
  constexpr std::int64_t members = 256, width = 13;
  const pendula::io::JournalKind kind{1, width};
  pendula::io::Journal journal(folder, kind);
  pendula::io::DoneChunk chunk;
  chunk.rows.assign(static_cast<std::size_t>(members * width), 1.0);
  const auto begin = Clock::now();
  for (std::int64_t k = 0; k < chunks; ++k) {
    chunk.members = {k * members, (k + 1) * members};
    journal.add(chunk);
  }
  journal.sync();
  return microseconds_since(begin) / chunks;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: pendula_handout FOLDER\n";
    return 2;
  }
  pendula::cli::Ranks ranks(false);
  const double claim = claim_microseconds(ranks);
  const std::string folder = std::string(arguments[1]) + "/handout" + std::to_string(ranks.rank());
  const double record = record_microseconds(folder);
  std::filesystem::remove_all(folder);
  std::cout << "{\"rank\": " + std::to_string(ranks.rank()) + ", \"ranks\": " + std::to_string(ranks.size()) +
                   ", \"claim_microseconds\": " + std::to_string(claim) +
                   ", \"record_microseconds\": " + std::to_string(record) + "}\n";
  ranks.all(true);
}
