#include <algorithm>
#include <charconv>
#include <limits>
#include <pendula/system/kernel_text.hpp>
#include <stdexcept>
#include <utility>

namespace pendula {
namespace {

/// Returns the text before the first `end`, and removes it and `end`. Without an `end` returns all, and leaves a text
/// whose data() is null.
std::string_view cut(std::string_view& text, char end) {
  const std::size_t at = text.find(end);
  const std::string_view before = text.substr(0, at);
  text = at == std::string_view::npos ? std::string_view() : text.substr(at + 1);
  return before;
}

constexpr int many = 1'000'000;   // upper bound of counts
constexpr int most_rows = 65535;  // of arrays of series

}  // namespace

bool KernelText::next() {
  if (rest_.empty()) return false;
  ++line_;
  words_ = cut(rest_, '\n');
  kind_ = cut(words_, '\t');
  return true;
}

std::string_view KernelText::word() {
  if (at_end()) fail("another word", "the end of the line");
  return cut(words_, '\t');
}

int KernelText::whole(int least, int most) {
  const std::string_view text = word();
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < least || number > most) {
    fail("a whole number from " + std::to_string(least) + " to " + std::to_string(most), text);
  }
  return number;
}

double KernelText::number() {
  const std::string_view text = word();
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) fail("a number", text);
  return number;
}

void KernelText::fail(const std::string& expected, std::string_view got) const {
  throw std::invalid_argument("line " + std::to_string(line_) + ": expected " + expected + ", got " +
                              std::string(got.substr(0, 80)));
}

void KernelDescription::Flags::push_back(bool flag) {
  auto flags = std::make_unique<bool[]>(count_ + 1);
  std::copy_n(flags_.get(), count_, flags.get());
  flags[count_++] = flag;
  flags_ = std::move(flags);
}

bool KernelDescription::take(KernelText& text) {
  const std::string_view kind = text.kind();
  if (kind == "name") {
    name_ = text.word();
  } else if (kind == "model") {
    model_ = text.word();
  } else if (kind == "links") {
    links_ = text.whole(1, many);
  } else if (kind == "depends_on_time") {
    depends_on_time_ = text.flag();
  } else if (kind == "constant_masses") {
    constant_masses_ = text.flag();
  } else if (kind == "coordinate") {
    coordinates_.push_back(text.word());
    coordinate_units_.push_back(text.word());
    is_angle_.push_back(text.flag());
    is_periodic_.push_back(text.flag());
  } else if (kind == "parameter") {
    parameters_.push_back(text.word());
    parameter_units_.push_back(text.word());
    parameter_sizes_.push_back(text.whole(1, many));
    parameter_defaults_.push_back(text.number());
    is_positive_.push_back(text.flag());
    is_per_link_.push_back(text.flag());
  } else if (kind == "input") {
    inputs_.push_back(text.word());
    input_units_.push_back(text.word());
  } else if (kind == "point") {
    points_.push_back(text.word());
    point_sizes_.push_back(text.whole(2, 3));
    point_kinds_.push_back(text.word());
  } else if (kind == "connection") {
    connection_kinds_.push_back(text.word());
    const int last = static_cast<int>(points_.size()) - 1;
    for (int end = 0; end < 2; ++end) connection_ends_.push_back(text.whole(-1, last));
  } else if (kind == "argument") {
    argument_is_base_.push_back(text.flag());
  } else if (kind == "switch") {
    switches_.push_back(text.word());
  } else if (kind == "constraint") {
    constraints_.push_back(text.word());
    constraint_units_.push_back(text.word());
    constraint_is_of_rates_.push_back(text.flag());
  } else if (kind == "series") {
    series_.has_momenta = text.flag();
    series_.sums = text.whole(0, many);
    series_.operands = text.whole(0, most_rows);
    series_.kept = text.whole(0, most_rows);
  } else if (kind == "sum") {
    const int first = text.whole(0, series_.operands - 1), second = text.whole(0, series_.operands - 1);
    sums_.push_back({static_cast<unsigned short>(first), static_cast<unsigned short>(second)});
  } else {
    return false;
  }
  if (!text.at_end()) text.fail("the end of the line", text.word());
  return true;
}

SystemInfo KernelDescription::info() const {
  if (name_.empty() || model_.empty() || links_ == 0 || coordinates_.empty()) {
    throw std::invalid_argument(
        "expected a name, a model, links and coordinates, got a description without one of them");
  }
  if (sums_.size() != static_cast<std::size_t>(series_.sums)) {
    throw std::invalid_argument("expected " + std::to_string(series_.sums) + " sums of series, got " +
                                std::to_string(sums_.size()));
  }
  return {name_,
          model_,
          links_,
          coordinates_,
          coordinate_units_,
          is_angle_.all(),
          is_periodic_.all(),
          parameters_,
          parameter_units_,
          parameter_sizes_,
          parameter_defaults_,
          is_positive_.all(),
          is_per_link_.all(),
          inputs_,
          input_units_,
          points_,
          point_sizes_,
          depends_on_time_,
          constant_masses_,
          argument_is_base_.all(),
          switches_,
          series_,
          point_kinds_,
          connection_kinds_,
          connection_ends_,
          sums_,
          constraints_,
          constraint_units_,
          constraint_is_of_rates_.all()};
}

}  // namespace pendula
