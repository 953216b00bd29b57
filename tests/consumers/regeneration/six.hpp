#pragma once

#include <pendula/kernels/planar_6.hpp>

using Six = pendula::kernels::Planar6;

/// Potential energy of six links  [J].
double height_of_six(const Six::Parameters<double>& chain, const Six::Vector<double>& q);
