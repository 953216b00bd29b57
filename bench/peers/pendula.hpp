#pragma once

#include <contestant.hpp>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>

namespace bench {

/// The problem as pendula's chain.
inline pendula::Chain<pendula::Planar> chain_of(const Problem& problem) {
  return pendula::Chain<pendula::Planar>({.masses = Eigen::VectorXd::Constant(problem.links, problem.mass),
                                          .lengths = Eigen::VectorXd::Constant(problem.links, problem.length),
                                          .gravity = problem.gravity});
}

/// Runs through the public factory, as a program that knows n only at run time would.
std::unique_ptr<Run> make_pendula(const Problem& problem, const pendula::RunOptions& options, int steps, double step);

}  // namespace bench
