#pragma once

#include <pendula/kernels/planar_3.hpp>
#include <pendula/kernels/planar_5.hpp>
#include <pendula/pendula.hpp>

/// Last bob of the double pendulum with m = l = 1, g = 9.81, released at rest from horizontal, after ten seconds.
Eigen::Vector2d last_bob_after_ten_seconds();
