#include "io/trajectory.hpp"

#include <pendula/numeric/number_text.hpp>

namespace pendula::io {

void append_header(std::string& text, std::span<const std::string> columns) {
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (k > 0) text += ',';
    text += columns[k];
  }
  text += '\n';
}

void append_row(std::string& text, std::span<const double> numbers) {
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    if (k > 0) text += ',';
    append_number(text, numbers[k]);
  }
  text += '\n';
}

}  // namespace pendula::io
