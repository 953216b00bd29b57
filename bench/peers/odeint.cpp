#include <boost/numeric/odeint.hpp>
#include <contestant.hpp>
#include <equations.hpp>
#include <limits>

namespace bench {
namespace {

namespace odeint = boost::numeric::odeint;

template <class Equations>
class OdeintRun : public Run {
  using State = typename Equations::State;
  using Stepper = odeint::runge_kutta_fehlberg78<State, double, State, double, odeint::array_algebra>;

 public:
  OdeintRun(const Problem& problem, double tolerance) : problem_(problem), tolerance_(tolerance), equations_(problem) {}

  void operator()() override {
    const auto derivative = [this](const State& y, State& dy, double) { equations_.derivative(y.data(), dy.data()); };
    y_ = Equations::start(problem_);
    try {
      odeint::integrate_adaptive(odeint::make_controlled(tolerance_, tolerance_, Stepper()), derivative, y_, 0.,
                                 problem_.duration, 1e-3);
    } catch (const odeint::odeint_error&) {  // no progress
      y_.fill(std::numeric_limits<double>::quiet_NaN());
    }
  }

  EndState end() override {
    EndState end;
    equations_.end(y_.data(), end);
    return end;
  }

 private:
  Problem problem_;
  double tolerance_;
  Equations equations_;
  State y_{};
};

template <template <class, int> class Equations>
std::unique_ptr<Run> make(const Problem& problem, double tolerance) {
  return with_links(problem.links, [&]<int N>() -> std::unique_ptr<Run> {
    return std::make_unique<OdeintRun<Equations<double, N>>>(problem, tolerance);
  });
}

}  // namespace

void add_odeint(std::vector<Contestant>& contestants) {
  const auto always = [](const Problem&) { return true; };
  const auto fine = [](const Problem&) { return tolerances(5, 15, 4); };
  contestants.push_back({"odeint fehlberg78", "tolerance", always, fine, make<DenseEquations>});
  contestants.push_back({"odeint fehlberg78, our O(n) dynamics", "tolerance", always, fine, make<RecursiveEquations>});
}

}  // namespace bench
