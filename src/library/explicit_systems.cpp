#include <pendula/explicit/explicit_steps.hpp>
#include <pendula/explicit/explicit_system.hpp>
#include <pendula/explicit/single_integrator.hpp>
#include <pendula/explicit/system_accelerations.hpp>
#include <pendula/system/member_systems.hpp>
#include <pendula/taylor/series_steps.hpp>
#include <stdexcept>
#include <string>

#include "library/explicit_methods.hpp"

namespace pendula {
namespace {

struct Make {
  const SystemTable& table;
  const PlainSystem& plain;
  const RunOptions& options;

  template <class Method>
  std::unique_ptr<PlainIntegrator> of() const {
    using Steps = ExplicitSteps<SystemAccelerations<double>, Method>;
    using Subject = ExplicitSystem<MemberSystems<double>, Method>;
    return std::make_unique<SingleIntegrator<Steps, Subject>>(Subject(table, plain, options.tolerance),
                                                              options.tolerance);
  }
  std::unique_ptr<PlainIntegrator> by_series() const {
    if (table.of_1.series_next == nullptr) {
      throw std::invalid_argument("method: expected another one than taylor, got taylor and the kernel " +
                                  std::string(table.info.name) + ", which has no series");
    }
    using Subject = ExplicitSystem<MemberSystems<double>, TaylorSeries>;
    using Steps = SeriesSteps<double>;
    return std::make_unique<SingleIntegrator<Steps, Subject>>(Subject(table, plain, options.tolerance),
                                                              options.tolerance, Steps::Options{options.tolerance});
  }
};

}  // namespace

std::unique_ptr<PlainIntegrator> make_explicit_system(const SystemTable& table, const PlainSystem& plain,
                                                      const RunOptions& options) {
  return detail::make_explicit(options, Make{table, plain, options});
}

}  // namespace pendula
