#pragma once

#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

#include "io/section.hpp"

namespace pendula::io {

/// A column that a scenario asks for in [output] columns. Its expression is read once the other columns are known.
struct ColumnPlan {
  std::string name, value;
  std::string place;  ///< `where: key`
};

/// Throws InputError.
std::vector<ColumnPlan> read_columns(const Section& output);

/// Throws InputError if an expression cannot be read, and for names that are taken.
std::vector<OwnColumn> own_columns(const std::vector<ColumnPlan>& plans, const Subject& subject);

}  // namespace pendula::io
