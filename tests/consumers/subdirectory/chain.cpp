#include "chain.hpp"

#include <cmath>

using namespace pendula;

Eigen::Vector2d last_bob_after_ten_seconds() {
  const Chain<Planar> chain({.masses = Eigen::Vector2d::Ones(), .lengths = Eigen::Vector2d::Ones()});
  Simulation run(chain, State<Planar>::from_angles(Eigen::Vector2d::Constant(std::acos(0.0))),
                 {.stages = 6, .step = 5e-3});
  run.advance_to(10);
  return {run["x_2"], run["y_2"]};
}
