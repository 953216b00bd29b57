#pragma once

#include <array>
#include <cstddef>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <string>
#include <vector>

namespace pendula::view {

/// A coordinate, and its columns in a row.
struct Coordinate {
  std::string name, unit;
  bool is_angle = false;
  std::size_t column = 0, rate_column = 0;
};

/// A point. Its components are consecutive columns of a row, from `column` on.
struct Point {
  std::string name;
  std::size_t column = 0;
  int components = 2;
  double mass = 0;           ///< kg; 0 if unknown
  std::string kind = "bob";  ///< what it is drawn as, a kind of SystemInfo::point_kinds
};

/// An input, and its column in a row.
struct ActingInput {
  std::string name, unit;
  std::size_t column = 0;
};

/// Something drawn between two points, by number; -1 is the origin.
struct Connection {
  std::string kind;  ///< "rod", "spring", "thread" or "pulleys"
  int from = -1, to = -1;
};

/// Which points are joined by rods.
enum class Rods {
  none,
  in_order,  ///< the origin and the first, each and the next
  rigid,     ///< of these, pairs whose distance is constant during the run: the page finds them
};

/// The description of a run for a page, besides its rows: what moves, and how it is drawn.
struct Scene {
  std::string title;     ///< of the page, such as a scenario's name
  std::string subject;   ///< one line, "4 links in space"
  std::string scenario;  ///< its text, to copy from the page
  std::string version;   ///< of pendula
  std::vector<std::string> columns;
  std::vector<Coordinate> coordinates;
  std::vector<ActingInput> inputs;
  std::vector<Point> points;
  std::vector<Connection> connections;
  Rods rods = Rods::none;
  std::vector<double> lengths;  ///< of a chain's rods [m]: points follow from angles, and need not be stored
  bool loaded = false;          ///< whether loads may change the energy
  std::string time_unit = "s", length_unit = "m";
  std::string laboratory;        ///< the link of a laboratory to go on in, without a state; empty: the page offers none
  std::string laboratory_model;  ///< JSON of a model for the laboratory (lab_model); empty for a chain

  /// Dimension of the space of the points: 2 or 3, 0 without points.
  int dimension() const;
};

namespace detail {

/// The scene of a chain from plain numbers; `dof` angles a link.
Scene chain_scene(std::vector<std::string> columns, std::size_t dof, const Eigen::VectorXd& masses,
                  const Eigen::VectorXd& lengths);

}  // namespace detail

/// The scene of a chain. The caller sets title, scenario and version.
template <class Space>
Scene scene_of(const ChainSubject<Space>& subject) {
  const Chain<Space>& chain = subject.chain();
  Scene scene = detail::chain_scene(subject.columns(), Space::dof, chain.masses(), chain.lengths());
  scene.loaded = chain.loaded();
  return scene;
}

/// What point k is drawn as.
std::string point_kind(const SystemInfo& info, std::size_t k);

/// What is drawn between the points of a system.
std::vector<Connection> connections_of(const SystemInfo& info);

/// What points are drawn as, and what is between them, for pictures made from a file: JSON, {"kinds": ["cart", …],
/// "connections": [["spring", 0, 1], …]}. Empty for a chain.
std::string drawing_of(const Scene& scene);

/// The scene of any other system; its rods are Rods::rigid.
Scene scene_of(const SystemSubject& subject);

}  // namespace pendula::view
