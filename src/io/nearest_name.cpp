#include "io/nearest_name.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace pendula::io {
namespace {

/// Number of edits that turn `a` into `b`; a swap of two neighbours counts as one.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

/// A candidate that begins with `name`: "masses" for "mass".
std::string_view begun_name(std::string_view name, std::span<const std::string_view> candidates) {
  constexpr std::size_t fewest_letters = 3;
  if (name.size() < fewest_letters) return {};
  const auto begins = [&](std::string_view candidate) { return candidate.starts_with(name); };
  const auto found = std::ranges::find_if(candidates, begins);
  return found == candidates.end() ? std::string_view() : *found;
}

}  // namespace

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> candidates) {
  constexpr std::size_t longest_name = 64;  // the cost is quadratic in the length, and a longer name is no misspelling
  if (name.empty() || name.size() > longest_name) return {};
  std::size_t best = std::max<std::size_t>(1, (name.size() + 1) / 3) + 1;
  std::string_view nearest;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= best) continue;
    best = distance;
    nearest = candidate;
  }
  return nearest.empty() ? begun_name(name, candidates) : nearest;
}

std::string did_you_mean(std::string_view name) {
  return name.empty() ? "" : " (did you mean " + std::string(name) + "?)";
}

}  // namespace pendula::io
