#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <casadi_table.hpp>
#include <cmath>
#include <functions.hpp>
#include <kernel_equations.hpp>
#include <pendula/kernels/driven_chain_2.hpp>
#include <pendula/kernels/joint_springs_2.hpp>
#include <pendula/kernels/planar_1.hpp>
#include <pendula/kernels/planar_2.hpp>
#include <pendula/kernels/planar_3.hpp>
#include <pendula/kernels/planar_4.hpp>
#include <pendula/kernels/rods_2.hpp>
#include <pendula/kernels/spatial_1.hpp>
#include <pendula/kernels/spatial_2.hpp>
#include <pendula/kernels/spatial_3.hpp>
#include <pendula/numeric/sincos.hpp>
#include <random>
#include <string>

namespace bench {
namespace {

namespace kernels = pendula::kernels;

using Lanes = pendula::Pack<8>;

constexpr double allowed_difference = 1e-12;  // measured: 9.6e-15

// So few that the processor learns libm's branches for all of their angles, as it does where angles change smoothly.
constexpr std::size_t count = 8;

/// Arguments and results of one call, nothing of which the compiler knows.
template <class Kernel, class Real = double>
struct Call {
  using Vector = typename Kernel::template Vector<Real>;
  using Matrix = typename Kernel::template Matrix<Real>;

  Vector q, v, a;  ///< v is p in momentum form
  typename Kernel::template Inputs<Real> inputs;
  Vector first, second;  ///< the residual; rates and forces; sines and cosines
  Matrix by_q, by_v, by_a;
};

/// Random numbers in all arguments, the same for every function of a kernel.
template <class Kernel>
class Arguments {
 public:
  static constexpr std::size_t numbers = static_cast<std::size_t>(pendula::parameter_count<Kernel>());

  Arguments() {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> positive(0.5, 2), any(-3, 3);
    for (double& number : plain) number = positive(random);
    for (auto& call : calls) {
      for (Eigen::Index i = 0; i < Kernel::coordinates; ++i) {
        call.q[i] = any(random);
        call.v[i] = any(random);
        call.a[i] = any(random);
      }
      for (Eigen::Index i = 0; i < call.inputs.size(); ++i) call.inputs.data()[i] = any(random);
    }
    time = positive(random);
  }

  template <class Real>
  typename Kernel::template Parameters<Real> parameters() const {
    typename Kernel::template Parameters<Real> parameters;
    Kernel::template read_parameters<Real>(plain.data(), parameters);
    if constexpr (pendula::holds_time<Kernel>) parameters.time = Real(time);
    return parameters;
  }

  std::array<double, numbers> plain;
  double time;
  std::array<Call<Kernel>, count> calls;
};

/// What one call takes, in nanoseconds.
template <class Calls, class Function>
void measure(benchmark::State& state, Calls& calls, const Function& function) {
  for (auto _ : state) {
    for (auto& call : calls) {
      function(call);
      benchmark::DoNotOptimize(&call);
    }
    benchmark::ClobberMemory();
  }
  state.counters["nanoseconds"] =
      benchmark::Counter(count * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

// --- Residuals

// Not inlined, as CasADi's function is not: what depends on parameters only would leave the loop.
template <class Kernel>
[[gnu::noinline]] void residual(const typename Kernel::template Parameters<double>& parameters, Call<Kernel>& call) {
  Kernel::residual(parameters, call.q, call.v, call.a, call.inputs, call.first);
}

template <class Kernel>
[[gnu::noinline]] void residual_with_jacobians(const typename Kernel::template Parameters<double>& parameters,
                                               Call<Kernel>& call) {
  Kernel::residual_with_jacobians(parameters, call.q, call.v, call.a, call.inputs, call.first, call.by_q, call.by_v,
                                  call.by_a);
}

template <class Kernel>
void evaluate(const CasadiFunction& function, const Arguments<Kernel>& arguments, Call<Kernel>& call) {
  const double* from[] = {call.q.data(),          call.v.data(),      call.a.data(),
                          arguments.plain.data(), call.inputs.data(), &arguments.time};
  double* to[] = {call.first.data(), call.by_q.data(), call.by_v.data(), call.by_a.data()};
  function.evaluate(from, to, nullptr, nullptr, 0);
}

template <class A, class B>
double distance(const A& ours, const B& theirs) {
  const double size = ours.cwiseAbs().maxCoeff();
  return size > 0 ? (ours - theirs).cwiseAbs().maxCoeff() / size : theirs.cwiseAbs().maxCoeff();
}

/// The largest difference of any result in any call, relative to the largest number in it.
template <class Kernel>
double disagreement(const CasadiFunction& function, const Arguments<Kernel>& arguments) {
  const auto parameters = arguments.template parameters<double>();
  double largest = 0;
  for (Call<Kernel> ours : arguments.calls) {
    for (auto* matrix : {&ours.by_q, &ours.by_v, &ours.by_a}) matrix->setZero();
    Call<Kernel> theirs = ours;
    evaluate(function, arguments, theirs);
    if (function.what == "residual") {
      residual<Kernel>(parameters, ours);
    } else {
      residual_with_jacobians<Kernel>(parameters, ours);
    }
    largest = std::max({largest, distance(ours.first, theirs.first), distance(ours.by_q, theirs.by_q),
                        distance(ours.by_v, theirs.by_v), distance(ours.by_a, theirs.by_a)});
  }
  return largest;
}

std::string name_of(const char* kind, std::string_view kernel, std::string_view what, const std::string& who) {
  return kind + ("/" + std::string(kernel)) + "/" + std::string(what) + "/" + who;
}

template <class Kernel>
void add_ours(const char* what,
              void (*function)(const typename Kernel::template Parameters<double>&, Call<Kernel>& call)) {
  benchmark::RegisterBenchmark(name_of("function", Kernel::name, what, "pendula").c_str(),
                               [function](benchmark::State& state) {
                                 Arguments<Kernel> arguments;
                                 const auto parameters = arguments.template parameters<double>();
                                 measure(state, arguments.calls, [&](auto& call) { function(parameters, call); });
                               });
}

template <class Kernel>
void add_residuals() {
  add_ours<Kernel>("residual", residual<Kernel>);
  add_ours<Kernel>("residual_with_jacobians", residual_with_jacobians<Kernel>);
  for (const CasadiFunction& function : casadi_functions) {
    if (function.kernel != Kernel::name) continue;
    const auto run = [&function](benchmark::State& state) {
      Arguments<Kernel> arguments;
      const double difference = disagreement(function, arguments);
      if (!(difference <= allowed_difference)) return state.SkipWithError("gives something else");
      measure(state, arguments.calls, [&](auto& call) { evaluate(function, arguments, call); });
      state.counters["difference"] = difference;
    };
    const std::string who = "CasADi, " + std::string(function.form);
    benchmark::RegisterBenchmark(name_of("function", Kernel::name, function.what, who).c_str(), run);
  }
}

// --- Momentum form

template <class Kernel, class Real>
[[gnu::noinline]] PENDULA_IN_REGISTERS void momentum_form(const typename Kernel::template Parameters<Real>& parameters,
                                                          Call<Kernel, Real>& call) {
  Kernel::template hamiltonian_form<Real>(parameters, call.q, call.v, call.inputs, call.first, call.second);
}

template <class Kernel, class Real>
[[gnu::noinline]] PENDULA_IN_REGISTERS void sines(const typename Kernel::template Parameters<Real>&,
                                                  Call<Kernel, Real>& call) {
  using pendula::sincos;
  for (Eigen::Index i = 0; i < Kernel::coordinates; ++i) {
    const Real angle = call.q[i];  // copied: libm is called once only where no result may lie on the argument
    Real sine, cosine;
    sincos(angle, sine, cosine);
    benchmark::DoNotOptimize(sine);
    benchmark::DoNotOptimize(cosine);
  }
}

/// The calls in numbers of another type: in lanes, those of the next calls stand beside each.
template <class Kernel, class Real>
std::array<Call<Kernel, Real>, count> calls_of(const Arguments<Kernel>& arguments) {
  std::array<Call<Kernel, Real>, count> calls;
  for (std::size_t k = 0; k < count; ++k) {
    const auto in_lanes = [&](auto number) {
      if constexpr (std::is_same_v<Real, double>) {
        return number(arguments.calls[k]);
      } else {
        alignas(pendula::pack_alignment) double each[Real::size];
        for (std::size_t j = 0; j < Real::size; ++j) each[j] = number(arguments.calls[(k + j) % count]);
        return Real::load(each);
      }
    };
    for (Eigen::Index i = 0; i < Kernel::coordinates; ++i) {
      calls[k].q[i] = in_lanes([i](const auto& call) { return call.q[i]; });
      calls[k].v[i] = in_lanes([i](const auto& call) { return call.v[i]; });
    }
    for (Eigen::Index i = 0; i < calls[k].inputs.size(); ++i) calls[k].inputs.data()[i] = Real(0.0);
  }
  return calls;
}

template <class Kernel, class Real>
void add_form(const char* numbers, const std::string& what,
              void (*function)(const typename Kernel::template Parameters<Real>&, Call<Kernel, Real>&)) {
  benchmark::RegisterBenchmark(name_of("form", Kernel::name, numbers, what).c_str(),
                               [function](benchmark::State& state) {
                                 const Arguments<Kernel> arguments;
                                 auto calls = calls_of<Kernel, Real>(arguments);
                                 const auto parameters = arguments.template parameters<Real>();
                                 measure(state, calls, [&](auto& call) { function(parameters, call); });
                               });
}

template <class Kernel>
void add_forms() {
  add_form<Kernel, double>("scalar", "whole", momentum_form<Kernel, double>);
  add_form<Kernel, double>("scalar", "sines", sines<Kernel, double>);
  add_form<Kernel, Lanes>("lanes", "whole", momentum_form<Kernel, Lanes>);
  add_form<Kernel, Lanes>("lanes", "sines", sines<Kernel, Lanes>);
}

template <class... Kernels>
void add_all_residuals() {
  (add_residuals<Kernels>(), ...);
}

}  // namespace

void register_functions() {
  add_all_residuals<kernels::Planar1, kernels::Planar2, kernels::Planar3, kernels::Planar4, kernels::Spatial1,
                    kernels::Spatial2, kernels::Spatial3, kernels::CartChain2, kernels::SpringPendulum, kernels::Furuta,
                    kernels::SwingingAtwood, kernels::DrivenChain2, kernels::Rods2, kernels::JointSprings2>();
  add_forms<kernels::Planar2>();
  add_forms<kernels::Planar3>();
  add_forms<kernels::Planar4>();
}

}  // namespace bench
