#include <algorithm>
#include <pendula/run/quantity.hpp>
#include <pendula/run/state_columns.hpp>
#include <pendula/run/system_subject.hpp>

namespace pendula {

std::vector<std::size_t> state_columns(const Subject& subject) {
  std::vector<std::size_t> columns;
  for (const Role role : {Role::coordinate, Role::rate}) {
    const auto first = static_cast<std::ptrdiff_t>(columns.size());
    for (const Quantity& quantity : subject.quantities()) {
      if (quantity.role != role) continue;
      for (std::size_t k = 0; k < quantity.size(); ++k) columns.push_back(quantity.column(k));
    }
    // A quantity gathers the columns of one name. The coordinates of a system are in the order of the columns.
    if (dynamic_cast<const SystemSubject*>(&subject) != nullptr) std::sort(columns.begin() + first, columns.end());
  }
  return columns;
}

}  // namespace pendula
