#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace pendula {

/// Time between rows of a table of about ten rows of a run: a round number, if the rows of the run lie on its
/// multiples. `spacing` is the distance of these in time, 0 if unknown.
inline double table_interval(double duration, double spacing) {
  constexpr double wanted = 10, most = 15, fewest = 5, slack = 1e-6;
  if (!(duration > 0) || !(spacing > 0)) return duration / wanted;
  const auto is_whole = [](double x) { return x > 0.5 && std::abs(x - std::round(x)) <= slack * x; };
  double best = 0, best_off = 0;
  const auto consider = [&](double interval) {
    const double rows = duration / interval;
    if (rows > most + slack || rows < fewest - slack || !is_whole(interval / spacing)) return;
    const double off = std::abs(std::log(rows / wanted)) + (is_whole(rows) ? 0 : 1);
    if (best > 0 && off >= best_off) return;
    best = interval;
    best_off = off;
  };
  for (const double round : std::array{1.0, 2.0, 2.5, 5.0, 10.0}) {
    consider(round * std::pow(10, std::floor(std::log10(duration / most))));
  }
  if (best > 0) return best;
  const double all = duration / spacing, first = std::max(1.0, std::ceil(all / most - slack));
  for (double count = first; count <= all / fewest + slack && count < first + 1e3; ++count) consider(count * spacing);
  return best > 0 ? best : std::ceil(all / wanted - slack) * spacing;
}

}  // namespace pendula
