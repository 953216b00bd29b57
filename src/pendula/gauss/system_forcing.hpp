#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <pendula/gauss/tableau.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/system_model.hpp>
#include <span>
#include <vector>

namespace pendula {

/// Limits the steps of a system so that their stages resolve forces that depend on time.
class SystemForcing {
 public:
  SystemForcing(const SystemModel& model, Family family, int stages)
      : SystemForcing(model, tableau_of<Eigen::Dynamic>(family, stages), order_of(family, stages)) {}

  /// The state of a system, (coordinates), and its pace.
  struct Here {
    double time;
    const double *q, *v;
    double pace;
  };

  /// The longest step up to h from the state that `look` returns, a Here. Within it, the phase of a sine input
  /// changes by no more than the stages can integrate: they would miss a weak sine that turns often within a step.
  template <class Look>
  double followed(double h, double tolerance, Look&& look) {
    const SystemModel& model = at_times_.model();
    const double fastest = model.fastest_drive();
    if (fastest > 0) h = std::min(h, turn_.within(tolerance) / fastest);
    if (!model.info().depends_on_time) return h;
    const Here here = look();
    for (std::size_t k = 0; k < sizes_.size(); ++k) {  // at least a radian for angles
      sizes_[k] = std::max(std::abs(here.q[k]), model.info().is_angle[k] ? 1.0 : 0.0);
    }
    return look_.resolved(
        here.time, h, here.pace, tolerance, std::span(here.v, sizes_.size()), sizes_,
        [&](std::span<const double> times, double* found) { at_times_.accelerations(times, here.q, here.v, found); });
  }

 private:
  SystemForcing(const SystemModel& model, const Tableau<Eigen::Dynamic, double>& tableau, int order)
      : at_times_(model),
        turn_(tableau.stages(), order),
        look_({tableau.c.data(), static_cast<std::size_t>(tableau.stages())},
              {tableau.b.data(), static_cast<std::size_t>(tableau.stages())}, model.coordinates()),
        sizes_(model.coordinates()) {}

  AtTimes at_times_;
  SineTurn turn_;
  ForcingLook look_;
  std::vector<double> sizes_;
};

}  // namespace pendula
