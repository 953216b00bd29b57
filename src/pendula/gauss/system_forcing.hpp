#pragma once

#include <algorithm>
#include <cstddef>
#include <pendula/gauss/tableau.hpp>
#include <pendula/system/accelerations_in_time.hpp>
#include <pendula/system/forcing_look.hpp>
#include <pendula/system/system_model.hpp>
#include <span>

namespace pendula {

/// How long the steps of a system may be for their stages to see what depends on time.
template <System S>
class SystemForcing {
 public:
  SystemForcing(Family family, int stages)
      : SystemForcing(tableau_of<Eigen::Dynamic>(family, stages), order_of(family, stages)) {}

  /// The longest step up to h from where `look` says that the system is: by a pair of state and pace, the motion
  /// changing in 1/pace. Inputs that are sines turn by no more than stages sum up: one that is weak and turns often
  /// within a step shows in no stage what it does.
  template <class Look>
  double followed(const SystemModel<S>& model, double h, double tolerance, Look&& look) {
    const double fastest = model.fastest_drive();
    if (fastest > 0) h = std::min(h, turn_.within(tolerance) / fastest);
    if constexpr (holds_time<S>) {
      const auto [at, pace] = look();
      const auto& state = at;  // no binding: Clang 14 captures none
      return look_.resolved(state.time, h, pace, tolerance, state.v, sizes_of(state.q),
                            [&](std::span<const double> times, double* found) {
                              accelerations_in_time(model, times, state.q, state.v, found);
                            });
    }
    return h;
  }

 private:
  using Vector = typename S::template Vector<double>;

  // Of angles a radian at least.
  static Vector sizes_of(const Vector& q) {
    Vector sizes = q.cwiseAbs();
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      if (S::coordinate_is_angle[static_cast<std::size_t>(k)]) sizes[k] = std::max(1.0, sizes[k]);
    }
    return sizes;
  }

  SystemForcing(const Tableau<Eigen::Dynamic, double>& tableau, int order)
      : turn_(tableau.stages(), order),
        look_({tableau.c.data(), static_cast<std::size_t>(tableau.stages())},
              {tableau.b.data(), static_cast<std::size_t>(tableau.stages())},
              static_cast<std::size_t>(S::coordinates)) {}

  SineTurn turn_;
  ForcingLook look_;
};

}  // namespace pendula
