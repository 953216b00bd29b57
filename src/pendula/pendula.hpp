#pragma once

/// Everything a program needs to simulate pendulum chains and other models: Simulation, propagate, lyapunov, Model. A
/// generated kernel, <pendula/kernels/planar_2.hpp>, becomes a Model by <pendula/own_model.hpp>. Solvers and steppers
/// to combine oneself are in the folders beside this file.

#include <pendula/chain/chain.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/lyapunov.hpp>
#include <pendula/model.hpp>
#include <pendula/propagate.hpp>
#include <pendula/simulation.hpp>
#include <pendula/system/motion.hpp>
#include <pendula/system/options.hpp>
#include <pendula/version.hpp>
