#include "view/scene.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

namespace pendula::view {

int Scene::dimension() const {
  int dimension = 0;
  for (const Point& point : points) dimension = std::max(dimension, std::min(point.components, 3));
  return dimension == 1 ? 2 : dimension;
}

namespace detail {

Scene chain_scene(std::vector<std::string> columns, std::size_t dof, const Eigen::VectorXd& masses,
                  const Eigen::VectorXd& lengths) {
  Scene scene;
  const auto links = static_cast<std::size_t>(masses.size());
  scene.subject =
      std::to_string(links) + (links == 1 ? " link" : " links") + (dof == 1 ? " in the plane" : " in space");
  scene.columns = std::move(columns);
  for (std::size_t link = 0; link < links; ++link) {
    for (std::size_t a = 0; a < dof; ++a) {
      const std::size_t column = 1 + 2 * dof * link + a;
      scene.coordinates.push_back({scene.columns[column], "rad", true, column, column + dof});
    }
  }
  for (std::size_t link = 0; link < links; ++link) {
    const auto i = static_cast<Eigen::Index>(link);
    const std::size_t column = 1 + 2 * dof * links + (dof + 1) * link;
    scene.points.push_back({"bob_" + std::to_string(link + 1), column, static_cast<int>(dof + 1), masses[i]});
  }
  scene.rods = Rods::in_order;
  scene.lengths.assign(lengths.begin(), lengths.end());
  return scene;
}

}  // namespace detail

std::string point_kind(const SystemInfo& info, std::size_t k) {
  return info.point_kinds.empty() ? "bob" : std::string(info.point_kinds[k]);
}

std::vector<Connection> connections_of(const SystemInfo& info) {
  std::vector<Connection> connections;
  connections.reserve(info.connection_kinds.size());
  for (std::size_t k = 0; k < info.connection_kinds.size(); ++k) {
    connections.push_back(
        {std::string(info.connection_kinds[k]), info.connection_ends[2 * k], info.connection_ends[2 * k + 1]});
  }
  return connections;
}

std::string drawing_of(const Scene& scene) {
  using nlohmann::json;
  if (scene.rods != Rods::rigid) return json{{"loaded", scene.loaded}}.dump();
  json kinds = json::array(), connections = json::array();
  for (const Point& point : scene.points) kinds.push_back(point.kind);
  for (const Connection& each : scene.connections) connections.push_back({each.kind, each.from, each.to});
  return json{{"kinds", kinds}, {"connections", connections}, {"loaded", scene.loaded}}.dump();
}

Scene scene_of(const SystemSubject& subject) {
  const SystemInfo& info = subject.info();
  const std::size_t count = info.coordinates.size();
  Scene scene;
  scene.subject =
      std::string(info.model) + ", " + std::to_string(count) + (count == 1 ? " coordinate" : " coordinates");
  scene.columns = subject.columns();
  for (std::size_t k = 0; k < count; ++k) {
    scene.coordinates.push_back({std::string(info.coordinates[k]), std::string(info.coordinate_units[k]),
                                 info.is_angle[k], 1 + k, 1 + count + k});
  }
  std::size_t column = 1 + 2 * count;
  for (std::size_t k = 0; k < info.inputs.size(); ++k) {
    scene.inputs.push_back({std::string(info.inputs[k]), std::string(info.input_units[k]), column++});
  }
  for (std::size_t k = 0; k < info.points.size(); ++k) {
    scene.points.push_back({std::string(info.points[k]), column, info.point_sizes[k], 0, point_kind(info, k)});
    column += static_cast<std::size_t>(info.point_sizes[k]);
  }
  scene.connections = connections_of(info);
  scene.rods = Rods::rigid;
  scene.loaded = subject.loaded();
  return scene;
}

}  // namespace pendula::view
