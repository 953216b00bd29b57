#include <pendula/run/lyapunov.hpp>

#include <pendula/pendula.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <pendula/run/integrator.hpp>
#include <pendula/run/run_failed.hpp>
#include <pendula/system/options.hpp>
#include <stdexcept>
#include <string>

#include "front/errors.hpp"
#include "front/model.hpp"
#include "front/options.hpp"

namespace pendula::front {
namespace {

void require_count(const pendula_tangents& tangents) {
  const std::size_t all = 2 * tangents.model->coordinates;
  if (tangents.count >= 1 && tangents.count <= all) return;
  throw std::invalid_argument("count: expected 1 to " + std::to_string(all) + " exponents, got " +
                              std::to_string(tangents.count));
}

}  // namespace

extern "C" pendula_status pendula_lyapunov(const pendula_tangents* tangents, double* exponents, double* errors,
                                           pendula_spectrum* rest) {
  return guarded([&] {
    require_count(*tangents);
    if (!(tangents->duration > 0) || std::isinf(tangents->duration)) {
      throw std::invalid_argument("duration: expected a number > 0, got " + std::to_string(tangents->duration));
    }
    const pendula_model& model = *tangents->model;
    const RunOptions options = options_of(tangents->options);
    const Motion start = motion_of(model, tangents->time, tangents->q, tangents->v);
    const std::unique_ptr<Integrator> integrator = model.subject->make_integrator(options);
    std::function<bool()> stop = [] { return false; };
    if (tangents->stop != nullptr) stop = [tangents] { return tangents->stop(tangents->context) != 0; };
    const LyapunovRun found = find_lyapunov_spectrum(
        *integrator, start, longest_step(options), tangents->duration, static_cast<int>(tangents->count),
        [](const LyapunovProgress&) {}, stop);
    require(found.result.outcome, *model.subject);
    std::ranges::copy(found.exponents, exponents);
    if (errors != nullptr) std::ranges::copy(found.errors, errors);
    if (rest != nullptr) *rest = {found.sum, found.duration, found.ftle, found.megno};
    return found.result.stopped ? PENDULA_STOPPED : PENDULA_OK;
  });
}

}  // namespace pendula::front
