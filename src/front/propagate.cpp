#include <pendula/ensemble/propagate.hpp>

#include <pendula/pendula.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "front/errors.hpp"
#include "front/model.hpp"
#include "front/options.hpp"

namespace pendula::front {
namespace {

std::vector<RunSetup> members_of(const pendula_ensemble& ensemble) {
  const std::span models(ensemble.models, ensemble.model_count);
  if (models.size() != 1 && models.size() != ensemble.members) {
    throw std::invalid_argument("models: expected one, or one for each of " + std::to_string(ensemble.members) +
                                " members, got " + std::to_string(models.size()));
  }
  const std::size_t coordinates = models[0]->coordinates;
  const RunRequest asked{.options = options_of(ensemble.options), .duration = ensemble.duration, .every = 1};
  std::vector<RunSetup> members;
  for (std::size_t k = 0; k < ensemble.members; ++k) {
    const pendula_model& model = *models[models.size() == 1 ? 0 : k];
    if (model.coordinates != coordinates) throw std::invalid_argument("models: expected as many coordinates of each");
    const double* start = ensemble.starts + k * 2 * coordinates;
    members.push_back({asked, model.subject, motion_of(model, ensemble.time, start, start + coordinates)});
    members.back().judged = false;
  }
  return members;
}

pendula_status status_of(RunEnd end) {
  if (end == RunEnd::complete || end == RunEnd::event) return PENDULA_OK;
  return end == RunEnd::stopped ? PENDULA_STOPPED : PENDULA_FAILED;
}

}  // namespace

extern "C" pendula_status pendula_propagate(const pendula_ensemble* ensemble, double* ends, pendula_status* how,
                                            double* energy_errors) {
  return guarded([&] {
    if (ensemble->members == 0) return PENDULA_OK;
    if (!(ensemble->duration >= 0) || std::isinf(ensemble->duration)) {
      throw std::invalid_argument("duration: expected a number, not negative, got " +
                                  std::to_string(ensemble->duration));
    }
    const std::vector<RunSetup> members = members_of(*ensemble);
    const std::size_t coordinates = ensemble->models[0]->coordinates;
    const int threads =
        ensemble->threads > 0 ? ensemble->threads : static_cast<int>(std::thread::hardware_concurrency());
    const auto stop = [ensemble] { return ensemble->stop != nullptr && ensemble->stop(ensemble->context) != 0; };
    const auto observe = [&](std::size_t number, const RunReport& report) {
      const Motion& last = report.last.q.size() > 0 ? report.last : members[number].start;
      write(last, ends + number * 2 * coordinates, ends + (number * 2 + 1) * coordinates);
      if (how != nullptr) how[number] = status_of(report.end);
      if (energy_errors != nullptr) energy_errors[number] = report.energy_error.largest;
    };
    propagate(members, std::max(threads, 1), observe, stop);
    return stop() ? PENDULA_STOPPED : PENDULA_OK;
  });
}

}  // namespace pendula::front
