// Taylor series of generated kernels against Gauss by tolerance: the cheapest run within ten floors of the reference.

#include <dlfcn.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <contestant.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <peers/pendula.hpp>
#include <pendula/chain/chain.hpp>
#include <pendula/chain/state.hpp>
#include <pendula/run/integrator.hpp>
#include <pendula/run/schedule.hpp>
#include <pendula/system/c_kernel.hpp>
#include <references.hpp>
#include <stdexcept>
#include <string>
#include <systems.hpp>
#include <vector>

namespace bench {
namespace {

/// The table of a kernel in C, that a shared object has.
std::shared_ptr<const pendula::SystemTable> load(const std::string& file) {
  void* const object = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (object == nullptr) throw std::invalid_argument(dlerror());
  return pendula::table_of(*static_cast<const pendula::CKernel*>(dlsym(object, "pendula_kernel")), nullptr);
}

/// log2 x and 2^x to 1e-4: for step sizes.
double log2_near(double x) {
  const auto bits = std::bit_cast<std::int64_t>(x);
  const auto m = std::bit_cast<double>((bits & 0xfffffffffffffLL) | 0x3ff0000000000000LL);
  const double p = -2.153620718 + m * (3.047884161 + m * (-1.051875031 + m * 0.158248749));
  return static_cast<double>((bits >> 52) - 1023) + p;
}

/// Steps by the series of one motion.
class SeriesRun : public Run {
 public:
  SeriesRun(const pendula::SystemTable& kernel, const pendula::SystemNumbers& numbers, const std::vector<double>& q,
            const std::vector<double>& v, double duration, double tolerance)
      : kernel_(kernel), parameters_(numbers.parameters), n_(q.size()), q_(q), v_(v), duration_(duration) {
    order_ = std::clamp(static_cast<int>(std::lround(4 - 1.25 * std::log10(tolerance))), 6, most_order);
    log_reach_ = std::log2(tolerance) / order_;
    row_ = pendula::series_state_row(n_, 1);
  }

  void operator()() override {
    at_ = {nullptr, parameters_.data(), &time_, inputs_.data()};
    std::fill(std::begin(state_), std::end(state_), 0.0);
    std::fill(std::begin(low_), std::end(low_), 0.0);
    std::copy(q_.begin(), q_.end(), state_);
    std::copy(v_.begin(), v_.end(), state_ + n_);
    if (kernel_.info.series.has_momenta) kernel_.of_1.momentum_from_velocity(at_, q_.data(), v_.data(), state_ + n_);
    time_ = late_ = 0;
    steps_ = 0;
    const pendula::SeriesRows rows{&unit_, state_, kept_, operands_};
    while (time_ < duration_) {
      kernel_.of_1.series_start(at_, rows);
      kernel_.of_1.series_next(at_, rows, 1, order_ - 1);
      double h = step_size();
      const bool last = time_ + h >= duration_;
      if (last) h = (duration_ - time_) - late_;
      sum(h);
      const double step = h + late_, then = time_ + step;
      late_ = step - (then - time_);
      time_ = last ? duration_ : then;
      if (++steps_ > 10'000'000) break;
    }
  }

  EndState end() override {
    std::vector<double> v(n_);
    if (kernel_.info.series.has_momenta) {
      kernel_.of_1.velocity_from_momentum(at_, state_, state_ + n_, v.data());
    } else {
      std::copy(state_ + n_, state_ + 2 * n_, v.begin());
    }
    return {{state_, state_ + n_}, v};
  }

  long steps() const { return steps_; }
  int order() const { return order_; }

 private:
  static constexpr int most_order = 32;
  using Four = double __attribute__((vector_size(32), may_alias));

  double size_of(int k) const {
    double size = 0;
    const double* const row = state_ + static_cast<std::size_t>(k) * row_;
    for (std::size_t i = 0; i < n_; ++i) {
      const double rate = kernel_.info.series.has_momenta ? (k + 1) * row[row_ + i] : row[n_ + i];
      size = std::max(size, std::max(std::abs(row[i]), std::abs(rate)));
    }
    return size;
  }

  double step_size() const {
    const int last = order_ - (kernel_.info.series.has_momenta ? 1 : 0);
    const double base = log2_near(size_of(0));
    double log_radius = 1e3;
    for (int k = last - 3; k <= last; ++k) {
      log_radius = std::min(log_radius, (base - log2_near(std::max(size_of(k), 1e-300))) / k);
    }
    return std::exp2(log_radius + log_reach_);
  }

  /// Horner in four strands, which do not wait for one another; rows beyond the order are zero.
  void sum(double h) {
    const double h2 = h * h, h4 = h2 * h2;
    for (std::size_t at = 0; at < row_; at += 4) {
      const auto row = [&](int k) {
        return *reinterpret_cast<const Four*>(state_ + static_cast<std::size_t>(k) * row_ + at);
      };
      int k = (order_ + 3) / 4 * 4;
      Four r0 = row(k - 3), r1 = row(k - 2), r2 = row(k - 1), r3 = row(k);
      for (k -= 4; k > 0; k -= 4) {
        r0 = r0 * h4 + row(k - 3);
        r1 = r1 * h4 + row(k - 2);
        r2 = r2 * h4 + row(k - 1);
        r3 = r3 * h4 + row(k);
      }
      const Four x = (r0 + r1 * h) + (r2 + r3 * h) * h2;
      Four& low = *reinterpret_cast<Four*>(low_ + at);
      Four& old = *reinterpret_cast<Four*>(state_ + at);
      const Four change = x * h + low, now = old + change;
      low = change - (now - old);
      old = now;
    }
  }

  const pendula::SystemTable& kernel_;
  std::vector<double> parameters_, inputs_ = std::vector<double>(64, 0.0);
  std::size_t n_, row_;
  std::vector<double> q_, v_;
  double duration_, time_ = 0, late_ = 0, unit_ = 1, log_reach_;
  int order_;
  long steps_ = 0;
  pendula::Conditions at_{};
  alignas(64) double state_[(most_order + 5) * 16], low_[16], kept_[256], operands_[(most_order + 2) * 128];
};

/// Steps of the library's own choice, as the program takes them.
class LibraryRun : public Run {
 public:
  LibraryRun(const Problem& problem, std::unique_ptr<pendula::Integrator> integrator, pendula::Motion start)
      : problem_(problem), start_(std::move(start)), integrator_(std::move(integrator)) {}

  void operator()() override {
    outcome_ = integrator_->start(start_);
    while (outcome_ && integrator_->time() < problem_.duration) {
      outcome_ = integrator_->step(problem_.duration - integrator_->time());
    }
  }

  EndState end() override {
    if (!outcome_) return failed(problem_);
    const auto state = integrator_->state();
    return {{state.q.begin(), state.q.end()}, {state.v.begin(), state.v.end()}};
  }

 private:
  Problem problem_;
  pendula::Motion start_;
  std::unique_ptr<pendula::Integrator> integrator_;
  pendula::Outcome outcome_;
};

pendula::RunOptions options_of(pendula::Method method, double tolerance) {
  return {.method = method, .stages = pendula::stages_for(method, tolerance), .step = 0, .tolerance = tolerance};
}

std::unique_ptr<Run> kernel_run(const Problem& problem, const std::shared_ptr<const pendula::SystemTable>& kernel,
                                const SystemStart& start, double tolerance) {
  const auto vector = [](const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  const pendula::SystemSubject subject(kernel, numbers_of(start, kernel->info));
  return std::make_unique<LibraryRun>(problem, subject.make_integrator(options_of(pendula::Method::gauss, tolerance)),
                                      pendula::Motion{0, vector(start.q), vector(start.v)});
}

std::unique_ptr<Run> rods_run(const Problem& problem, pendula::Method method, double tolerance) {
  const auto angles = Eigen::VectorXd::Constant(problem.links, problem.angle);
  return std::make_unique<LibraryRun>(problem,
                                      pendula::make_integrator(chain_of(problem), options_of(method, tolerance)),
                                      pendula::State<pendula::Planar>::from_angles(angles));
}

struct Trial {
  double tolerance, milliseconds, error;
};

/// The best of a few runs.
Trial attempt(Run& run, const Reference& reference, double tolerance) {
  const auto seconds = [&] {
    const auto begin = std::chrono::steady_clock::now();
    run();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  double best = seconds();
  for (double spent = best; spent < 0.05;) {
    const double again = seconds();
    best = std::min(best, again);
    spent += again;
  }
  return {tolerance, best * 1e3, error_of(run.end(), reference)};
}

template <class Make>
void race(const char* who, const Reference& reference, Make make, bool all) {
  const Trial* found = nullptr;
  std::vector<Trial> trials;
  for (const double tolerance : tolerances(6, 17, 2)) {
    const std::unique_ptr<Run> run = make(tolerance);
    trials.push_back(attempt(*run, reference, tolerance));
    if (all) std::printf("    %.1e  %.4f ms  error %.1e\n", tolerance, trials.back().milliseconds, trials.back().error);
  }
  for (const Trial& trial : trials) {
    const bool good = trial.error <= 10 * reference.floor;
    if (good && (found == nullptr || trial.milliseconds < found->milliseconds)) found = &trial;
  }
  if (found == nullptr) {
    std::printf("  %-14s not within ten floors\n", who);
    return;
  }
  std::printf("  %-14s %.4f ms, tolerance %.1e, error %.1e of a floor %.1e\n", who, found->milliseconds,
              found->tolerance, found->error, reference.floor);
}

}  // namespace
}  // namespace bench

/// Runs a problem by the kernel that stands in `file`; `all` prints every tolerance.
void race_on(const std::string& name, const std::string& file, bool all) {
  using namespace bench;
  const auto* const found = std::find_if(kernel_problems.begin(), kernel_problems.end(),
                                         [&](const Problem& each) { return each.name == name; });
  if (found == kernel_problems.end()) throw std::invalid_argument("no problem " + name);
  const Problem& problem = *found;
  const auto kernel = load(file);
  const SystemStart chain{"double_pendulum", {}, {}, {Problem::angle, Problem::angle}, {0, 0}};
  const SystemStart& start = problem.kernel.empty() ? chain : system_start(problem);
  const pendula::SystemNumbers numbers = numbers_of(start, kernel->info);
  const Reference& reference = reference_of(problem, references);
  std::printf("%s, %s\n", name.c_str(), kernel->info.series.has_momenta ? "momentum form" : "second order");
  race(
      "series", reference,
      [&](double tolerance) {
        return std::make_unique<SeriesRun>(*kernel, numbers, start.q, start.v, problem.duration, tolerance);
      },
      all);
  race(
      "gauss", reference, [&](double tolerance) { return kernel_run(problem, kernel, start, tolerance); }, all);
  if (!problem.kernel.empty()) return;
  for (const auto& [who, method] :
       {std::pair{"gauss of rods", pendula::Method::gauss}, std::pair{"taylor of rods", pendula::Method::taylor}}) {
    race(
        who, reference, [&](double tolerance) { return rods_run(problem, method, tolerance); }, all);
  }
}

/// Arguments: problems and files of their kernels in turn, those of the build if there are none; --all first for every
/// tolerance.
int main(int count, char** arguments) {
  const bool all = count > 1 && std::string(arguments[1]) == "--all";
  const std::vector<std::string> given(arguments + (all ? 2 : 1), arguments + count);
  for (std::size_t k = 0; k + 1 < given.size(); k += 2) race_on(given[k], given[k + 1], all);
  if (!given.empty()) return 0;
  const std::string folder = SERIES_KERNELS;
  race_on("D", folder + "/series_double_pendulum.so", all);
  race_on("spring pendulum", folder + "/series_spring_pendulum.so", all);
  race_on("swinging atwood", folder + "/series_swinging_atwood.so", all);
}
