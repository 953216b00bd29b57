#include <benchmark/benchmark.h>

#include <chrono>
#include <contestant.hpp>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <race.hpp>
#include <references.hpp>
#include <regex>
#include <span>
#include <sstream>
#include <systems.hpp>

namespace bench {
namespace {

constexpr double allowed_floors = 10;

/// One setting of one contestant on one problem.
struct Trial {
  double setting, milliseconds, error;
};

double seconds_of(Run& run) {
  const auto begin = std::chrono::steady_clock::now();
  run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// The best of a few runs, about 20 ms of them.
Trial attempt(const Contestant& contestant, const Problem& problem, const Reference& reference, double setting) {
  const std::unique_ptr<Run> run = contestant.make(problem, setting);
  double best = seconds_of(*run);
  for (double spent = best; spent < 0.02;) {
    const double again = seconds_of(*run);
    best = std::min(best, again);
    spent += again;
  }
  return {setting, best * 1e3, error_of(run->end(), reference)};
}

/// From coarse to fine, a few settings past the first that is good enough, and on while they get no dearer: finer steps
/// take less time where coarse ones are cut up or end in Newton's iteration.
std::vector<Trial> scan(const Contestant& contestant, const Problem& problem, const Reference& reference,
                        double longest) {
  constexpr double dearer = 1.3;
  std::vector<Trial> trials;
  int good = 0;
  double cheapest = std::numeric_limits<double>::infinity();
  for (const double setting : contestant.settings(problem)) {
    const Trial& trial = trials.emplace_back(attempt(contestant, problem, reference, setting));
    if (trial.error <= allowed_floors * reference.floor) {
      ++good;
      cheapest = std::min(cheapest, trial.milliseconds);
    }
    if ((good > 4 && trial.milliseconds > dearer * cheapest) || trial.milliseconds > longest * 1e3) break;
  }
  return trials;
}

/// The cheapest trial that is good enough; failing that, the most accurate.
const Trial& choose(const std::vector<Trial>& trials, const Reference& reference) {
  const auto good = [&](const Trial& trial) { return trial.error <= allowed_floors * reference.floor; };
  return *std::min_element(trials.begin(), trials.end(), [&](const Trial& a, const Trial& b) {
    if (good(a) != good(b)) return good(a);
    return good(a) ? a.milliseconds < b.milliseconds : a.error < b.error;
  });
}

void enter(const Contestant& contestant, const Problem& problem, const Reference& reference, double setting,
           const std::string& who) {
  const auto race = [=](benchmark::State& state) {
    const std::unique_ptr<Run> run = contestant.make(problem, setting);
    for (auto _ : state) (*run)();
    state.counters["error"] = error_of(run->end(), reference);
    state.counters["floor"] = reference.floor;
    state.counters["setting"] = setting;
  };
  const std::string name = "race/" + std::string(problem.name) + "/" + who;
  benchmark::RegisterBenchmark(name.c_str(), race)->Unit(benchmark::kMillisecond);
}

std::vector<Contestant> everybody() {
  std::vector<Contestant> contestants;
  add_pendula(contestants);
  add_gsl(contestants);
  add_odeint(contestants);
  add_cvode(contestants);
  add_mujoco(contestants);
  return contestants;
}

nlohmann::json json_of(const std::vector<Trial>& trials) {
  auto list = nlohmann::json::array();
  for (const Trial& trial : trials) {
    const nlohmann::json error = std::isfinite(trial.error) ? nlohmann::json(trial.error) : nlohmann::json(nullptr);
    list.push_back({{"setting", trial.setting}, {"milliseconds", trial.milliseconds}, {"error", error}});
  }
  return list;
}

/// A chain, for contestants that do not run here.
nlohmann::json chain_json(const Problem& problem) {
  return {{"links", problem.links},
          {"mass", problem.mass},
          {"length", problem.length},
          {"gravity", problem.gravity},
          {"angle", problem.angle}};
}

/// A system likewise: numbers in the order of its kernel, which is that of its model.
nlohmann::json system_json(const Problem& problem) {
  const SystemStart& start = system_start(problem);
  const auto info = with_kernel(problem, []<class Kernel>() { return pendula::info_of<Kernel>(); });
  const pendula::SystemNumbers numbers = numbers_of(start, info);
  auto sines = nlohmann::json::array();
  for (const pendula::InputSine& sine : numbers.sines) {
    sines.push_back({sine.input, sine.amplitude, sine.frequency, sine.phase});
  }
  return {{"kernel", problem.kernel},
          {"parameters", numbers.parameters},
          {"inputs", numbers.inputs},
          {"sines", sines},
          {"q", start.q},
          {"v", start.v}};
}

/// A problem, and its end in decimals, which have more digits than a double.
nlohmann::json json_of(const Problem& problem, const Reference& reference) {
  nlohmann::json entry = problem.kernel.empty() ? chain_json(problem) : system_json(problem);
  auto end = nlohmann::json::array();
  for (const long double value : reference.values) {
    std::ostringstream digits;
    digits << std::setprecision(std::numeric_limits<long double>::max_digits10) << value;
    end.push_back(digits.str());
  }
  std::vector<double> sizes;
  for (const long double size : sizes_of(reference.values, reference.units)) sizes.push_back(static_cast<double>(size));
  entry.update({{"duration", problem.duration},
                {"floor", reference.floor},
                {"end", end},
                {"sizes", sizes},
                {"trials", nlohmann::json::object()}});
  return entry;
}

void register_field(std::span<const Problem> problems, const std::vector<Contestant>& contestants,
                    const std::string& file, double longest) {
  auto kept = nlohmann::json::object();
  for (const Problem& problem : problems) {
    const Reference& reference = reference_of(problem, references);
    nlohmann::json& entry = kept[std::string(problem.name)] = json_of(problem, reference);
    for (const Contestant& contestant : contestants) {
      if (!contestant.enters(problem)) continue;
      std::vector<Trial> trials;
      try {
        trials = scan(contestant, problem, reference, longest);
      } catch (const std::exception& error) {
        std::cerr << problem.name << ", " << contestant.name << ": " << error.what() << '\n';
        continue;
      }
      const Trial& chosen = choose(trials, reference);
      std::cerr << problem.name << ", " << contestant.name << ": " << contestant.knob << ' ' << chosen.setting << ", "
                << chosen.milliseconds << " ms, error " << chosen.error / reference.floor << " floors\n";
      entry["trials"][contestant.name] = {{"knob", contestant.knob}, {"runs", json_of(trials)}};
      enter(contestant, problem, reference, chosen.setting, contestant.name);
      if (contestant.name == "GSL rk8pd") enter(contestant, problem, reference, 1e-12, "GSL rk8pd 1e-12");
    }
  }
  std::ofstream(file) << kept.dump(1) << '\n';
}

}  // namespace

void register_races(const std::string& file, double longest, const std::string& who) {
  std::vector<Contestant> contestants = everybody();
  const std::regex wanted(who);
  std::erase_if(contestants, [&](const Contestant& each) { return !std::regex_search(each.name, wanted); });
  register_field(problems, contestants, file, longest);
}

void register_kernel_races(const std::string& file, double longest) {
  std::vector<Contestant> contestants;
  add_kernels(contestants);
  register_field(kernel_problems, contestants, file, longest);
}

}  // namespace bench
