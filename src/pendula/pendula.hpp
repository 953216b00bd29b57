#pragma once

/// Everything a program needs to move pendulum chains; generated kernels are included one by one,
/// <pendula/kernels/planar_2.hpp>.

#include <pendula/chain/chain.hpp>
#include <pendula/chain/chain_numbers.hpp>
#include <pendula/chain/chain_solver.hpp>
#include <pendula/chain/chain_variation.hpp>
#include <pendula/chain/invariants.hpp>
#include <pendula/chain/momenta.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/ensemble/propagate.hpp>
#include <pendula/gauss/lagrangian_solver.hpp>
#include <pendula/gauss/lagrangian_variation.hpp>
#include <pendula/gauss/stepper.hpp>
#include <pendula/gauss/velocity_newton.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/event.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/simulation.hpp>
#include <pendula/system/kernel_table.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/outcome.hpp>
