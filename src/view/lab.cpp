#include "view/lab.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <pendula/numeric/number_text.hpp>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "view/assets.hpp"
#include "view/encode.hpp"
#include "view/scene.hpp"

namespace pendula::view {

void LabLink::begin(std::string_view key) {
  if (!text_.empty()) text_ += '&';
  text_.append(key) += '=';
}
void LabLink::add(double number) {
  if (text_.back() != '=') text_ += ',';
  text_ += shortest(number);
}

void put_inputs(LabLink& link, std::span<const double> held, std::span<const InputSine> sines) {
  if (std::ranges::any_of(held, [](double input) { return input != 0; })) link.put("u", held);
  std::vector<double> numbers;
  for (const InputSine& sine : sines) {
    if (sine.amplitude == 0) continue;
    numbers.insert(numbers.end(), {static_cast<double>(sine.input), sine.amplitude, sine.frequency, sine.phase});
  }
  if (!numbers.empty()) link.put("s", numbers);
}

LabLink lab_link(const SystemSubject& system) {
  const SystemNumbers& numbers = system.numbers();
  const std::size_t indicators = 2 * system.info().switches.size();
  LabLink link;
  link.put("p", std::span(numbers.parameters).first(numbers.parameters.size() - indicators));
  put_inputs(link, numbers.inputs, numbers.sines);
  return link;
}

nlohmann::json lab_model(const SystemInfo& info, std::string program) {
  using nlohmann::json;
  json coordinates = json::array(), parameters = json::array(), inputs = json::array(), points = json::array();
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    coordinates.push_back({{"name", info.coordinates[k]}, {"unit", info.coordinate_units[k]}});
  }
  for (std::size_t k = 0; k < info.own_parameters(); ++k) {
    parameters.push_back({{"name", info.parameters[k]},
                          {"unit", info.parameter_units[k]},
                          {"default", info.parameter_defaults[k]},  // null where there is none
                          {"positive", info.is_positive[k]},
                          {"per_link", info.is_per_link[k]}});
  }
  for (std::size_t k = 0; k < info.inputs.size(); ++k) {
    inputs.push_back({{"name", info.inputs[k]}, {"unit", info.input_units[k]}});
  }
  for (std::size_t k = 0; k < info.points.size(); ++k) {
    json columns = json::array();
    for (int axis = 0; axis < info.point_sizes[k]; ++axis) {
      columns.push_back(std::string(info.points[k]) + '_' + "xyz"[axis]);
    }
    points.push_back({{"name", info.points[k]}, {"columns", columns}, {"kind", point_kind(info, k)}});
  }
  json connections = json::array();
  for (const Connection& each : connections_of(info)) {
    connections.push_back({{"kind", each.kind}, {"ends", {each.from, each.to}}});
  }
  return {{"model",
           {{"links", info.links},
            {"coordinates", coordinates},
            {"parameters", parameters},
            {"inputs", inputs},
            {"points", points},
            {"connections", connections}}},
          {"program", std::move(program)}};
}

std::string lab_page(const nlohmann::json& start) {
  return filled(assets::lab_page, [&](std::string_view name) {
    return name == "title" ? html_text(start.value("title", "Pendulum laboratory")) : script_json(start);
  });
}

}  // namespace pendula::view
