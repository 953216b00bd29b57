#include <algorithm>
#include <cstddef>
#include <iostream>
#include <nlohmann/json.hpp>
#include <pendula/numeric/number_text.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cli/commands.hpp"
#include "io/errors.hpp"
#include "io/generator.hpp"
#include "io/toolchain.hpp"

namespace pendula::cli {
namespace {

using Json = nlohmann::ordered_json;
using TableRow = std::vector<std::string>;

/// Asks the generator about a model. Throws io::InputError.
template <class Ask>
Json answer(const char* command, Ask ask) {
  try {
    return Json::parse(ask());
  } catch (const io::ModelError& error) {
    throw io::InputError(std::string(command) + ": " + error.what());
  }
}

std::string text(const Json& object, const char* key) {
  return object[key].get<std::string>();
}

/// Prints rows in columns; the first row has headings.
void print(const std::vector<TableRow>& rows) {
  constexpr std::size_t gap = 2;
  std::vector<std::size_t> widths(rows.front().size());
  for (const TableRow& row : rows) {
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], row[k].size() + gap);
  }
  for (const TableRow& row : rows) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) line += row[k] + std::string(widths[k] - row[k].size(), ' ');
    std::cout << line.substr(0, line.find_last_not_of(' ') + 1) << '\n';
  }
}

/// Prints a list of the model, unless it is empty; row_of(entry) gives the cells before the remark.
template <class RowOf>
void print_list(const Json& model, const char* list, TableRow head, RowOf row_of) {
  head.emplace_back();
  std::vector<TableRow> rows{std::move(head)};
  for (const Json& entry : model[list]) {
    rows.push_back(row_of(entry));
    rows.back().push_back(text(entry, "remark"));
  }
  if (rows.size() == 1) return;
  std::cout << '\n';
  print(rows);
}

/// The default of a parameter, or "must be given".
std::string default_of(const Json& parameter) {
  const Json& value = parameter["default"];
  return value.is_null() ? "must be given" : shortest(value.get<double>());
}

std::string limits_of(const Json& parameter) {
  const std::string positive = parameter["positive"] ? "> 0" : "";
  const std::string each = parameter["per_link"] ? "one a link" : "";
  return positive + (positive.empty() || each.empty() ? "" : ", ") + each;
}

std::string listed(const Json& names) {
  std::string all;
  for (const Json& name : names) all += (all.empty() ? "" : ", ") + name.get<std::string>();
  return all;
}

void print_model(const Json& model) {
  std::cout << text(model, "model") << ": " << text(model, "about") << '\n';
  print_list(model, "coordinates", {"coordinate", "unit", "rate", "momentum"}, [](const Json& each) {
    return TableRow{text(each, "name"), text(each, "unit"), text(each, "rate"), text(each, "momentum")};
  });
  print_list(model, "parameters", {"parameter", "unit", "default", ""}, [](const Json& each) {
    return TableRow{text(each, "name"), text(each, "unit"), default_of(each), limits_of(each)};
  });
  print_list(model, "inputs", {"input", "unit"}, [](const Json& each) {
    return TableRow{text(each, "name"), text(each, "unit")};
  });
  print_list(model, "motions", {"motion", "unit", "without drives"}, [](const Json& each) {
    return TableRow{text(each, "name"), text(each, "unit"), shortest(each["default"].get<double>())};
  });
  print_list(model, "constraints", {"constraint", "unit", "of"}, [](const Json& each) {
    return TableRow{text(each, "name"), text(each, "unit"), text(each, "of")};
  });
  print_list(model, "switches", {"steps end where it is 0"},
             [](const Json& each) { return TableRow{text(each, "value")}; });
  print_list(model, "points", {"point", "columns"}, [](const Json& each) {
    return TableRow{text(each, "name"), listed(each["columns"])};
  });
  if (!model["constraints"].empty()) {
    std::cout << '\n'
              << "degrees of freedom: " << model["degrees_of_freedom"] << ", if no constraint follows from others\n";
  }
  std::cout << '\n' << "file  " << text(model, "file") << '\n';
  if (model["has_links"]) std::cout << "links " << model["links"] << "; --links N tells it of N\n";
}

}  // namespace

ExitStatus describe(const DescribeOptions& options) {
  const Json model = answer("describe", [&] {
    return io::describe_model({options.model, options.links}, io::Toolchain::of_this_program());
  });
  if (options.json) {
    std::cout << model.dump() << '\n';
  } else {
    print_model(model);
  }
  return done;
}

ExitStatus models(bool json) {
  const Json models = answer("models", [] { return io::describe_models(io::Toolchain::of_this_program()); });
  if (json) {
    std::cout << models.dump() << '\n';
    return done;
  }
  std::vector<TableRow> rows{{"model", "coordinates", ""}};
  for (const Json& model : models) {
    constexpr std::size_t most = 3;
    const Json& all = model["coordinates"];
    std::string coordinates;
    for (std::size_t k = 0; k < std::min(all.size(), most); ++k) {
      coordinates += (coordinates.empty() ? "" : ", ") + text(all[k], "name");
    }
    if (model["has_links"] || all.size() > most) coordinates += ", ...";
    rows.push_back({text(model, "model"), coordinates, text(model, "about")});
  }
  print(rows);
  return done;
}

}  // namespace pendula::cli
