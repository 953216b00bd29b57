#include "io/signal_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <string_view>
#include <system_error>
#include <utility>

#include "io/errors.hpp"
#include "io/feedback_reader.hpp"
#include "io/files.hpp"
#include "io/nearest_name.hpp"
#include "io/quantity_text.hpp"
#include "io/section.hpp"

namespace pendula::io {
namespace {

/// Columns of a CSV file of measurements.
struct NumberTable {
  std::string file;
  std::vector<std::vector<double>> columns;  ///< in the order asked for
  std::vector<std::int64_t> lines;           ///< line of each row, counted from 1

  /// `file:line` of a row.
  std::string place(std::size_t row) const { return line_place(file, lines[row]); }
};

constexpr std::size_t most_text = std::size_t{1} << 30;

std::string_view without_quotes(std::string_view cell) {
  cell = trimmed(cell);
  const bool is_quoted = cell.size() >= 2 && cell.front() == '"' && cell.back() == '"';
  return is_quoted ? cell.substr(1, cell.size() - 2) : cell;
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    cells.push_back(without_quotes(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return cells;
}

std::string listed(const std::vector<std::string_view>& names) {
  constexpr std::size_t few = 12;
  std::string text;
  for (std::size_t k = 0; k < std::min(few, names.size()); ++k) {
    text += (text.empty() ? "" : ", ") + printable(names[k]);
  }
  return text + (names.size() > few ? ", ..." : "");
}

double number_in(std::string_view cell, const std::string& place, const std::string& column) {
  const std::string_view digits = cell.starts_with('+') ? cell.substr(1) : cell;
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc() && end == digits.data() + digits.size() && std::isfinite(value)) return value;
  throw InputError(place + ": " + column + ": expected a finite number, got " +
                   (cell.empty() ? "nothing" : toml_string(cell)));
}

/// Calls take(line, number) for every line that is not blank.
template <class Take>
void for_lines(std::string_view text, Take take) {
  std::int64_t number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (!trimmed(line).empty()) take(line, number);
  }
}

/// Reads some columns by their names, which are in the first line; skips blank lines. Throws InputError with file, line
/// and column.
NumberTable read_number_table(const std::filesystem::path& file, const std::vector<std::string>& columns) {
  const InputFile read = read_input_file(file, most_text);
  NumberTable table{file.string(), std::vector<std::vector<double>>(columns.size()), {}};
  if (!read.problem.empty()) {
    throw InputError(table.file + ": expected a CSV file that can be read, got: " + read.problem);
  }
  std::string_view text = read.text;
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  std::vector<std::size_t> places;
  std::size_t width = 0;
  for_lines(text, [&](std::string_view line, std::int64_t number) {
    const std::vector<std::string_view> cells = cells_of(line);
    const std::string place = line_place(table.file, number);
    if (places.empty()) {
      for (const std::string& column : columns) {
        const auto found = std::ranges::find(cells, column);
        if (found == cells.end()) {
          std::string problem = place;
          problem += ": expected the column ";
          problem += column;
          problem += " in the first line, got ";
          problem += listed(cells);
          problem += did_you_mean(nearest_name(column, cells));
          throw InputError(problem);
        }
        places.push_back(static_cast<std::size_t>(found - cells.begin()));
      }
      width = cells.size();
      return;
    }
    if (cells.size() != width) {
      throw InputError(place + ": expected " + std::to_string(width) + " numbers, as the first line has names, got " +
                       std::to_string(cells.size()));
    }
    for (std::size_t k = 0; k < places.size(); ++k) {
      table.columns[k].push_back(number_in(cells[places[k]], place, columns[k]));
    }
    table.lines.push_back(number);
  });
  if (table.lines.empty()) throw InputError(table.file + ": expected names in the first line, and rows; got none");
  return table;
}

constexpr const char* times_column = "t";

void read_file(const Section& table, const Entry& file, const std::filesystem::path& folder, SignalPlan& plan) {
  for (const char* key : {"times", "values"}) {
    if (const auto beside = table.find(key)) beside->fail("nothing beside file");
  }
  const auto column = table.find("column");
  const std::filesystem::path given = file.text();
  const NumberTable numbers = read_number_table(given.is_absolute() ? given : folder / given,
                                                {times_column, column ? column->text() : plan.input});
  plan.signal.times = numbers.columns[0];
  plan.signal.values = numbers.columns[1];
  for (std::size_t k = 1; k < numbers.lines.size(); ++k) {
    const double before = plan.signal.times[k - 1], time = plan.signal.times[k];
    if (time > before) continue;
    throw InputError(numbers.place(k) + ": t: expected a time after " + shortest(before) + ", got " + shortest(time));
  }
}

void read_arrays(const Section& table, std::string_view unit, SignalPlan& plan) {
  const Entry times = table.require("times", "a file, or times and values"), values = table.require("values");
  if (const auto column = table.find("column")) column->fail("nothing without file");
  if (times.size() == 0) times.fail("an array of times, one at least");
  if (values.size() != times.size()) {
    values.fail("as many numbers as times has, " + std::to_string(times.size()));
  }
  for (std::size_t k = 0; k < times.size(); ++k) {
    const double time = times.element(k).number();
    if (k > 0 && time <= plan.signal.times.back()) times.element(k).fail("a time after the one before it");
    plan.signal.times.push_back(time);
    plan.signal.values.push_back(values.element(k).number(unit));
  }
}

}  // namespace

std::vector<SignalPlan> read_signals(const Section& system, const std::filesystem::path& folder,
                                     const SystemInfo* info) {
  std::vector<SignalPlan> plans;
  for (const Section& table : system.each("signal")) {
    SignalPlan plan;
    const Entry input = table.require("input");
    plan.input = input.text();
    plan.input_place = input.place();
    plan.signal.is_held = table.truth("hold");
    if (const auto file = table.find("file")) {
      read_file(table, *file, folder, plan);
    } else {
      read_arrays(table, unit_of_input(info, plan.input), plan);
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

std::vector<Signal> signals_of(const std::vector<SignalPlan>& plans, const Subject& subject) {
  std::vector<Signal> signals;
  for (const SignalPlan& plan : plans) {
    signals.push_back(plan.signal);
    signals.back().input = input_named(plan.input, plan.input_place, subject);
  }
  return signals;
}

}  // namespace pendula::io
