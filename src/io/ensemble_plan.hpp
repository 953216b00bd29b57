#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace pendula::io {

class Section;

/// One axis of a grid of members: a key of the scenario takes evenly spaced values `from` … `to`, or those of a list.
struct EnsembleAxis {
  std::string key;
  double from = 0, to = 0;
  std::int64_t count = 1;
  std::vector<double> values = {};  // NOLINT(readability-redundant-member-init): left out in initializers

  double at(std::int64_t k) const;
  std::vector<double> all() const;
};

/// A key whose value every member has for itself: drawn at random, or from a list.
struct EnsembleDraw {
  std::string key;
  bool normal = false;              ///< else uniform
  double first = 0, second = 1;     ///< from and to, or mean and standard deviation
  std::vector<double> values = {};  // NOLINT(readability-redundant-member-init): left out in initializers
};

/// The members of an ensemble, and the quantities that are kept for each.
struct EnsemblePlan {
  std::vector<EnsembleAxis> axes;   ///< of a grid, the first one slowest; or
  std::vector<EnsembleDraw> draws;  ///< without a grid, random ones first
  std::int64_t count = 0;           ///< number of members
  std::uint64_t seed = 0;
  bool chooses_method = false;    ///< the fastest one is used, whatever [run] says
  std::vector<std::string> keep;  ///< as in the scenario; empty for the default
  std::string keep_place;         ///< `where: key`

  /// Shape of the data sets: one number for each axis.
  std::vector<std::int64_t> shape() const;
  std::vector<std::string> keys() const;
  /// The value of each key for a member, counted from 0. It depends on the seed and on that number alone (Philox:
  /// Salmon et al. 2011).
  std::vector<double> values(std::int64_t member) const;
  /// The same as overrides of the scenario, `key=value`; each reads back as the same double.
  std::vector<std::string> overrides(std::int64_t member) const;
};

/// SI unit of a scenario's key; empty if unknown.
std::string unit_of_key(std::string_view key);

/// Reads the table [ensemble] of a scenario, and those within it; `name` stands for the file. Throws InputError.
EnsemblePlan read_ensemble(const Section& root, const std::string& name);

}  // namespace pendula::io
