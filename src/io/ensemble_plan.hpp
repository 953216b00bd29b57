#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pendula::io {

/// Values of one key of a scenario, evenly from `from` to `to`: a direction of a grid of members.
struct EnsembleAxis {
  std::string key;
  double from = 0, to = 0;
  std::int64_t count = 1;

  double at(std::int64_t k) const;
};

/// A key that is drawn for every member.
struct EnsembleDraw {
  std::string key;
  bool normal = false;           ///< else uniform
  double first = 0, second = 1;  ///< from and to, or mean and standard deviation
};

/// Which members an ensemble has, and what is kept of each.
struct EnsemblePlan {
  std::vector<EnsembleAxis> axes;   ///< either these, the first one slowest,
  std::vector<EnsembleDraw> draws;  ///< or these
  std::int64_t count = 0;           ///< of members
  std::uint64_t seed = 0;
  bool chooses_method = false;    ///< by what takes least, in place of that of [run]
  std::vector<std::string> keep;  ///< as in the scenario; empty for what is usual
  std::string keep_place;         ///< `where: key`

  /// Of data sets, one number an axis.
  std::vector<std::int64_t> shape() const;
  std::vector<std::string> keys() const;
  /// Of each key, for a member from 0 on; it depends on the seed and on these numbers alone (Philox: Salmon et al.
  /// 2011).
  std::vector<double> values(std::int64_t member) const;
  /// The same as overrides of the scenario, `key=value`, each telling the same double.
  std::vector<std::string> overrides(std::int64_t member) const;
};

/// Of the numbers of a scenario's key, in SI; empty where that is not known.
std::string unit_of_key(std::string_view key);

/// The tables [ensemble], [[ensemble.axis]] and [[ensemble.random]] of a scenario's text. Throws InputError.
EnsemblePlan parse_ensemble(std::string_view text, const std::string& name, std::span<const std::string> overrides);

}  // namespace pendula::io
