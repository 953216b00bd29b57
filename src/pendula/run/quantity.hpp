#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pendula {

/// A quantity of a trajectory: one number a row, or one of each link.
struct Quantity {
  std::string name;        ///< "theta"
  std::string unit;        ///< in SI, "rad/s"; "1" where it has none
  std::size_t first = 0;   ///< column of its first number
  std::size_t links = 0;   ///< 0: it is one number, of no link
  std::size_t stride = 1;  ///< columns from link to link

  std::size_t size() const { return links == 0 ? 1 : links; }
  std::size_t column(std::size_t k) const { return first + k * stride; }
};

/// Names of the columns that quantities have in a row: `energy`, `theta_1`.
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
