#include "chain.hpp"

#include <stdexcept>

using namespace pendula;

Eigen::Vector2d last_bob_after_ten_seconds() {
  const Chain<Planar> chain({.masses = Eigen::Vector2d::Ones(), .lengths = Eigen::Vector2d::Ones()});
  const auto integrator = make_integrator(chain, {.stages = 6});
  const auto start = State<Planar>::from_angles(Eigen::Vector2d::Constant(std::acos(0.0)));
  const auto result = simulate(*integrator, start, {.step = 5e-3, .duration = 10}, [](const auto&) {});
  if (!result.outcome) throw std::runtime_error(message(result.outcome));
  return bob_positions(chain, integrator->state()).rightCols<1>();
}
