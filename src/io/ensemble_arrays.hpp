#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "io/ensemble_file.hpp"
#include "io/hdf5.hpp"

/// What a file of an ensemble has, apart from where it is written.
namespace pendula::io {

/// A data set of an ensemble: its scale, or one number of each member.
struct EnsembleArray {
  enum class Source {
    axis,    ///< values of an axis; a scale
    number,  ///< numbers of the members; a scale where there are no axes
    row,     ///< a column of the rows of journals
    draw     ///< values of a key that members have each for itself
  };

  std::string name;     ///< letters, digits and underscores
  std::string meaning;  ///< long name
  std::string unit;     ///< in SI; empty if there is none
  hdf5::Type type = hdf5::Type::real;
  Source source = Source::row;
  std::size_t index = 0;           ///< of the axis, the column or the draw
  std::vector<std::string> flags;  ///< meanings of -1, 0, 1, ...; empty where values are numbers

  bool is_scale() const { return source == Source::axis || source == Source::number; }
};

/// A number of a row as its data set has it: what is not there is -1 among integers.
template <class Number>
Number stored(double value) {
  return std::is_floating_point_v<Number> || !std::isnan(value) ? static_cast<Number>(value) : Number(-1);
}

/// Scales first, in the order of the axes.
std::vector<EnsembleArray> arrays_of(const EnsembleHead& head);

/// Attributes of the whole: where it comes from, and of how many members there are numbers.
using EnsembleAttribute = std::pair<std::string, std::variant<std::string, std::int64_t>>;
std::vector<EnsembleAttribute> attributes_of(const EnsembleHead& head, std::int64_t done);

}  // namespace pendula::io
