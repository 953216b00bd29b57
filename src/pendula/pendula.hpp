#pragma once

/// Everything a program needs to move pendulum chains; generated kernels are included one by one,
/// <pendula/kernels/planar_2.hpp>.

#include <pendula/chain.hpp>
#include <pendula/gauss/chain_solver.hpp>
#include <pendula/gauss/dense_newton.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/integrator.hpp>
#include <pendula/invariants.hpp>
#include <pendula/momenta.hpp>
#include <pendula/options.hpp>
#include <pendula/outcome.hpp>
#include <pendula/simulation.hpp>
#include <pendula/state.hpp>
