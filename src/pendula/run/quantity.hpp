#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace pendula {

/// Kinds of quantities of a trajectory; those up to rates are its time and state.
enum class Role { time, coordinate, rate, input, point, force, energy, own };

/// A quantity of a trajectory: one number per row, or one for each link.
struct Quantity {
  std::string name;  ///< "theta"
  std::string unit;  ///< in SI, "rad/s"; "1" where it has none
  Role role = Role::time;
  std::string meaning;     ///< description in words
  std::size_t first = 0;   ///< column of its first number
  std::size_t links = 0;   ///< 0: one number, not of a link
  std::size_t stride = 1;  ///< columns from link to link

  /// Whether it is part of an Observation.
  bool is_observed() const { return role == Role::point || role == Role::force || role == Role::energy; }
  std::size_t size() const { return links == 0 ? 1 : links; }
  std::size_t column(std::size_t k) const { return first + k * stride; }
  bool holds(std::size_t at) const {
    return at >= first && (at - first) % stride == 0 && (at - first) / stride < size();
  }
};

/// A constant of a system: one number, or one for each link.
struct Constant {
  std::string name, unit, meaning;
  std::vector<double> values;
  bool per_link = false;
};

/// The index at the end of a name with its underscore: `_1` of `theta_1`; empty if there is none.
inline std::string_view index_of(std::string_view name) {
  const std::size_t end = name.find_last_not_of("0123456789");
  const bool numbered = end != std::string_view::npos && end > 0 && end + 1 < name.size() && name[end] == '_';
  return numbered ? name.substr(end) : std::string_view();
}

/// Name of the rate of a coordinate: `x_dot`, and `theta_dot_1`, since an index stays last.
inline std::string rate_name(std::string_view coordinate) {
  const std::string_view index = index_of(coordinate);
  const std::string_view stem = coordinate.substr(0, coordinate.size() - index.size());
  return std::string(stem).append("_dot").append(index);
}

/// Unit of the rate of a coordinate.
inline std::string rate_unit(std::string_view unit) {
  return (unit.empty() ? "1" : std::string(unit)) + "/s";
}

/// Name of a rate in older files: `theta_1_dot` for `theta_dot_1`, but `x_dot` for `x_dot`.
inline std::string former_rate_name(std::string_view rate) {
  constexpr std::string_view ending = "_dot";
  const std::string_view index = index_of(rate), stem = rate.substr(0, rate.size() - index.size());
  if (!stem.ends_with(ending)) return std::string(rate);
  return std::string(stem.substr(0, stem.size() - ending.size())).append(index).append(ending);
}

/// Present name of a rate with an older name; any other name unchanged.
inline std::string present_name(std::string_view name) {
  constexpr std::string_view ending = "_dot";
  if (!name.ends_with(ending)) return std::string(name);
  return rate_name(name.substr(0, name.size() - ending.size()));
}

/// Names of the columns of a row: `energy`, `theta_1`.
inline std::vector<std::string> columns_of(const std::vector<Quantity>& quantities) {
  std::size_t count = 0;
  for (const Quantity& quantity : quantities) count += quantity.size();
  std::vector<std::string> columns(count);
  for (const Quantity& quantity : quantities) {
    for (std::size_t k = 0; k < quantity.size(); ++k) {
      columns[quantity.column(k)] = quantity.links == 0 ? quantity.name : quantity.name + "_" + std::to_string(k + 1);
    }
  }
  return columns;
}

}  // namespace pendula
