// Many motions at once.

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <pendula/ensemble/propagate.hpp>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "prepared.hpp"

namespace pendula::python {
namespace {

/// What became of the members of an ensemble: ends (members x state), how (RunEnd), energy errors, and why not to trust
/// a member ("" where nothing speaks against it).
using Propagated = nb::typed<nb::tuple, Array, std::vector<int>, Vector, std::vector<std::string>>;

Propagated propagate_all(const Prepared& made, const Starts& starts, double duration, int threads, bool estimate) {
  const std::size_t members = starts.shape(0), size = starts.shape(1);
  const auto coordinates = static_cast<Eigen::Index>(size / 2);
  std::vector<EnsembleMember> all;
  for (std::size_t k = 0; k < members; ++k) {
    const Eigen::Map<const Eigen::VectorXd> row(starts.data() + k * size, static_cast<Eigen::Index>(size));
    all.push_back({made.subject, Motion(0, row.head(coordinates), row.tail(coordinates))});
  }
  std::vector<double> ends(starts.data(), starts.data() + members * size), errors(members);
  std::vector<int> how(members);
  std::vector<std::string> doubts(members);
  interruptibly([&](const std::stop_token& stop) {
    EnsembleSchedule schedule;
    schedule.options = made.run;
    schedule.duration = duration;
    schedule.estimate = estimate;
    schedule.threads = threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    schedule.stop = [&] { return stop.stop_requested(); };
    propagate(all, schedule, [&](std::size_t k, const RunReport& report) {
      how[k] = static_cast<int>(report.end);
      errors[k] = report.energy_error.largest;
      if (!report.warnings.empty()) doubts[k] = report.warnings.front();
      if (report.last.q.size() == 0) return;
      std::ranges::copy(state_of(report.last), ends.begin() + static_cast<std::ptrdiff_t>(k * size));
    });
  });
  return nb::make_tuple(array_of(std::move(ends), size), how, vector_of(std::move(errors)), doubts);
}

}  // namespace

void define_ensembles(nb::module_& module) {
  module.def("propagate", &propagate_all);
}

}  // namespace pendula::python
