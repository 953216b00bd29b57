#pragma once

#include <memory>
#include <pendula/chain/chain.hpp>
#include <pendula/explicit/explicit_tableau.hpp>
#include <pendula/system/options.hpp>
#include <pendula/system/plain_integrator.hpp>
#include <pendula/system/plain_system.hpp>
#include <pendula/system/system_table.hpp>
#include <stdexcept>
#include <string>

namespace pendula {

/// Explicit methods on rods, for any number of links. They pass poles. Throws std::invalid_argument for a tolerance
/// ≤ 0, and for Taylor series of chains with damping, torques or drives.
template <class Space>
std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Space>& chain, const RunOptions& options);

extern template std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Planar>&, const RunOptions&);
extern template std::unique_ptr<PlainIntegrator> make_explicit_chain(const Chain<Spatial>&, const RunOptions&);

/// The same on the coordinates of a generated kernel.
std::unique_ptr<PlainIntegrator> make_explicit_system(const SystemTable& table, const PlainSystem& plain,
                                                      const RunOptions& options);

namespace detail {

/// Returns make.of<Method>() for a method of explicit_tableau.hpp, or make.by_series().
template <class Make>
std::unique_ptr<PlainIntegrator> make_explicit(const RunOptions& options, const Make& make) {
  if (is_adaptive(options.method) && !(options.tolerance > 0)) {
    throw std::invalid_argument("tolerance: expected a positive number, got " + std::to_string(options.tolerance));
  }
  switch (options.method) {
    case Method::rk4:
      return make.template of<ClassicalRungeKutta>();
    case Method::dopri5:
      return make.template of<DormandPrince5>();
    case Method::fehlberg78:
      return make.template of<Fehlberg8>();
    case Method::taylor:
      return make.by_series();
    case Method::gauss:
    case Method::radau:
      break;
  }
  throw std::invalid_argument("method: expected an explicit one, got " + std::string(name_of(options.method)));
}

}  // namespace detail

}  // namespace pendula
