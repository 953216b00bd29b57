#pragma once

#include <array>
#include <cstddef>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/system_subject.hpp>
#include <string>
#include <vector>

namespace pendula::view {

/// One coordinate of what is moved, and where a row has it.
struct Coordinate {
  std::string name, unit;
  bool is_angle = false;
  std::size_t column = 0, rate_column = 0;
};

/// One point of what is moved: its components stand in a row one after the other, from `column` on.
struct Point {
  std::string name;
  std::size_t column = 0;
  int components = 2;
  double mass = 0;           ///< kg; 0 where it is not known
  std::string kind = "bob";  ///< what it is drawn as, a kind of SystemInfo::point_kinds
};

/// What acts on it from outside, and where a row has it.
struct ActingInput {
  std::string name, unit;
  std::size_t column = 0;
};

/// Something drawn between two points, by number; -1 is the origin.
struct Connection {
  std::string kind;  ///< "spring", "thread" or "pulleys"
  int from = -1, to = -1;
};

/// What joins the points.
enum class Rods {
  none,
  in_order,  ///< the origin with the first, each with the next
  rigid,     ///< the same, but only those whose distance stays what it is during the run: seen by the page
};

/// What a page is told besides the rows: what moves, and how it may be drawn.
struct Scene {
  std::string title;     ///< of the page: a scenario's name, say
  std::string subject;   ///< one line, "4 links in space"
  std::string scenario;  ///< its text, to copy from the page
  std::string version;   ///< of pendula
  std::vector<std::string> columns;
  std::vector<Coordinate> coordinates;
  std::vector<ActingInput> inputs;
  std::vector<Point> points;
  std::vector<Connection> connections;
  Rods rods = Rods::none;
  std::vector<double> lengths;  ///< of a chain's rods [m]: its points need not be stored, its angles tell them
  bool loaded = false;          ///< whether energy may come from outside, or go there
  std::string time_unit = "s", length_unit = "m";
  std::string laboratory;        ///< the link of a laboratory to go on in, without a state; empty: the page offers none
  std::string laboratory_model;  ///< JSON, what the laboratory begins with of a model (lab_model); empty of a chain

  /// Of the space that the points are in: 2 or 3, 0 without points.
  int dimension() const;
};

namespace detail {

/// A chain from plain numbers; `dof` angles a link.
Scene chain_scene(std::vector<std::string> columns, std::size_t dof, const Eigen::VectorXd& masses,
                  const Eigen::VectorXd& lengths);

}  // namespace detail

/// What a chain is; title, scenario and version are the caller's.
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

/// What points are drawn as, and what is between them, for pictures that are made from a file: JSON, {"kinds": ["cart",
/// …], "connections": [["spring", 0, 1], …]}. Empty of a chain.
std::string drawing_of(const Scene& scene);

/// The same of any other system, whose rods are what stays rigid.
Scene scene_of(const SystemSubject& subject);

}  // namespace pendula::view
