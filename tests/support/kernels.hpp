#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <pendula/kernels/planar_1.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/planar_3.hpp>
#include <pendula/kernels/planar_4.hpp>
#include <pendula/kernels/spatial_1.hpp>
#include <pendula/kernels/spatial_2.hpp>
#include <pendula/kernels/spatial_3.hpp>

#include "support/random_chain.hpp"

namespace pendula::test {

/// The kernels that typed tests are compiled for: all committed ones; one of each space under sanitizers, which look at
/// code and not at numbers, and take a compiler minutes for each.
#ifdef PENDULA_FEW_KERNELS
using CommittedKernels = ::testing::Types<kernels::Planar2, kernels::Spatial2>;
#else
using CommittedKernels = ::testing::Types<kernels::Planar1, kernels::Planar2, kernels::Planar3, kernels::Planar4,
                                          kernels::Spatial1, kernels::Spatial2, kernels::Spatial3>;
#endif

struct KernelName {
  template <class Kernel>
  static std::string GetName(int) {
    return std::string(Kernel::name);
  }
};

/// A chain's numbers as its kernel takes them.
template <class Kernel, class Space>
typename Kernel::template Parameters<double> parameters_of(const Chain<Space>& chain) {
  typename Kernel::template Parameters<double> parameters;
  const ChainSystem numbers(plain(chain, {}), Space::torque_components);
  Kernel::template read_parameters<double>(numbers.plain().parameters, parameters);
  return parameters;
}

/// One seeded draw of everything that a kernel's entry points take.
template <class Kernel>
struct KernelInputs {
  using Space = SpaceOf<Kernel>;
  using Vector = typename Kernel::template Vector<double>;

  Random random;
  Chain<Space> chain;
  typename Kernel::template Parameters<double> parameters;
  typename Kernel::template Torque<double> torque;
  Vector q, v, a;

  explicit KernelInputs(unsigned seed)
      : random(seed),
        chain(random_chain<Space>(random, Kernel::links, true)),
        parameters(parameters_of<Kernel>(chain)) {
    chain.torque(0, torque);
    const State<Space> state = random_state<Space>(random, Kernel::links);
    q = state.q;
    v = state.v;
    a = random.matrix<Vector>(Kernel::coordinates, 1, -3, 3);
  }
};

/// The same parameters in another number type.
template <class Kernel, class Real>
typename Kernel::template Parameters<Real> parameters_as(const typename Kernel::template Parameters<double>& from) {
  typename Kernel::template Parameters<Real> to;
  Kernel::cast_parameters(from, to);
  return to;
}

/// The same matrix in another number type, element by element: not every Real converts through Eigen's cast.
template <class To, class From>
To matrix_as(const From& from) {
  To to;
  for (Eigen::Index j = 0; j < from.cols(); ++j) {
    for (Eigen::Index i = 0; i < from.rows(); ++i) to(i, j) = typename To::Scalar(from(i, j));
  }
  return to;
}

/// The largest entry of a − b, relative to the largest one of b, or to 1 if that is larger.
template <class A, class B>
double relative_difference(const A& a, const B& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
}

}  // namespace pendula::test
