#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>

#include <contestant.hpp>
#include <equations.hpp>

namespace bench {
namespace {

template <class Equations>
class GslRun : public Run {
 public:
  /// Adaptive where `steps` is 0, else that many steps of size `step`.
  GslRun(const Problem& problem, const gsl_odeiv2_step_type* type, double tolerance, unsigned long steps, double step)
      : problem_(problem),
        steps_(steps),
        step_(step),
        equations_(problem),
        system_{derivative, jacobian, 2 * Equations::links, this},
        driver_(gsl_odeiv2_driver_alloc_y_new(&system_, type, step, tolerance, tolerance), gsl_odeiv2_driver_free) {}

  void operator()() override {
    gsl_odeiv2_driver_reset_hstart(driver_.get(), step_);
    y_ = Equations::start(problem_);
    double time = 0;
    status_ = steps_ == 0 ? gsl_odeiv2_driver_apply(driver_.get(), &time, problem_.duration, y_.data())
                          : gsl_odeiv2_driver_apply_fixed_step(driver_.get(), &time, step_, steps_, y_.data());
  }

  EndState end() override {
    if (status_ != GSL_SUCCESS) return failed(problem_);
    EndState end;
    equations_.end(y_.data(), end);
    return end;
  }

 private:
  static int derivative(double, const double* y, double* dy, void* self) {
    static_cast<GslRun*>(self)->equations_.derivative(y, dy);
    return GSL_SUCCESS;
  }

  static int jacobian(double, const double* y, double* by_y, double* by_time, void* self) {
    if constexpr (requires(Equations e) { e.jacobian(y, by_y); }) {
      static_cast<GslRun*>(self)->equations_.jacobian(y, by_y);
      std::fill_n(by_time, 2 * Equations::links, 0.);
      return GSL_SUCCESS;
    }
    return GSL_EBADFUNC;
  }

  Problem problem_;
  unsigned long steps_;
  double step_;
  Equations equations_;
  typename Equations::State y_{};
  gsl_odeiv2_system system_;
  std::unique_ptr<gsl_odeiv2_driver, void (*)(gsl_odeiv2_driver*)> driver_;
  int status_ = GSL_FAILURE;
};

template <template <class, int> class Equations>
std::unique_ptr<Run> make_adaptive(const Problem& problem, double tolerance) {
  return with_links(problem.links, [&]<int N>() -> std::unique_ptr<Run> {
    return std::make_unique<GslRun<Equations<double, N>>>(problem, gsl_odeiv2_step_rk8pd, tolerance, 0UL, 1e-3);
  });
}

// About the error of rk4imp's steps in the races that it enters.
constexpr double race_newton_tolerance = 1e-10;

}  // namespace

std::unique_ptr<Run> make_rk4imp(const Problem& problem, int steps, double step, double newton_tolerance) {
  return with_links(problem.links, [&]<int N>() -> std::unique_ptr<Run> {
    return std::make_unique<GslRun<DenseEquations<double, N>>>(problem, gsl_odeiv2_step_rk4imp, newton_tolerance,
                                                               static_cast<unsigned long>(steps), step);
  });
}

void add_gsl(std::vector<Contestant>& contestants) {
  gsl_set_error_handler_off();
  const auto always = [](const Problem&) { return true; };
  const auto fine = [](const Problem&) { return tolerances(5, 15, 4); };
  contestants.push_back({"GSL rk8pd", "tolerance", always, fine, make_adaptive<DenseEquations>});
  contestants.push_back({"GSL rk8pd, our O(n) dynamics", "tolerance", always, fine, make_adaptive<RecursiveEquations>});
  contestants.push_back(
      {"GSL rk4imp", "steps", always, [](const Problem& problem) { return step_counts(problem, 2, 2, 9); },
       [](const Problem& problem, double steps) {
         return make_rk4imp(problem, static_cast<int>(steps), problem.duration / steps, race_newton_tolerance);
       }});
}

}  // namespace bench
