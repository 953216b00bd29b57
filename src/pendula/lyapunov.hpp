#pragma once

#include <pendula/pendula.h>

#include <cstddef>
#include <pendula/c_error.hpp>
#include <pendula/model.hpp>
#include <pendula/run/lyapunov_spectrum.hpp>
#include <pendula/simulation.hpp>
#include <pendula/system/motion.hpp>
#include <stdexcept>
#include <stop_token>
#include <string>

namespace pendula {

/// How long to follow a motion for its exponents, and with which options.
struct LyapunovOptions {
  double duration = 1000;      ///< s
  int count = 0;               ///< number of leading exponents; 0: all
  SimulationOptions run = {};  // NOLINT(readability-redundant-member-init): left out in designated initializers
  std::stop_token stop = {};   ///< ends the run; exponents are those of the time until then
};

/// The Lyapunov exponents of a motion, by the exact derivatives of its steps. Throws std::invalid_argument if there are
/// fewer exponents, and for methods whose steps have no derivative; RunFailed if the mathematics fails.
inline LyapunovSpectrum lyapunov(const Model& model, const Motion& start, const LyapunovOptions& options = {}) {
  model.require(start);
  const auto all = static_cast<int>(2 * model.coordinates());
  if (options.count < 0 || options.count > all) {
    throw std::invalid_argument("count: expected 1 to " + std::to_string(all) + " exponents, got " +
                                std::to_string(options.count));
  }
  const pendula_options plain = detail::plain(options.run);
  std::stop_token stop = options.stop;
  pendula_tangents tangents{};
  tangents.model = model.get();
  tangents.time = start.time;
  tangents.q = start.q.data();
  tangents.v = start.v.data();
  tangents.duration = options.duration;
  tangents.options = &plain;
  tangents.count = static_cast<std::size_t>(options.count == 0 ? all : options.count);
  tangents.stop = detail::stop_function(stop);
  tangents.context = &stop;
  const auto count = static_cast<Eigen::Index>(tangents.count);
  LyapunovSpectrum found{Eigen::VectorXd(count), Eigen::VectorXd(count)};
  pendula_spectrum rest{};
  detail::require(pendula_lyapunov(&tangents, found.exponents.data(), found.errors.data(), &rest));
  found.sum = rest.sum;
  found.duration = rest.duration;
  found.ftle = rest.ftle;
  found.megno = rest.megno;
  return found;
}

}  // namespace pendula
