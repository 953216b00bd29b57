#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <pendula/chain/chain_links.hpp>
#include <pendula/ensemble/lane_exponents.hpp>
#include <pendula/ensemble/lane_runs.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/ensemble/second_looks.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/library.hpp>
#include <pendula/run/method_choice.hpp>
#include <pendula/run/run.hpp>
#include <pendula/run/system_subject.hpp>
#include <pendula/run/track.hpp>
#include <utility>

namespace pendula {

namespace detail {
namespace {

/// Links of a chain in one space; 0 for other subjects.
template <class Space>
int links_of(const Subject& subject) {
  const auto* const found = dynamic_cast<const ChainSubject<Space>*>(&subject);
  return found == nullptr ? 0 : found->chain().links();
}

/// Roughly the frequency of a chain in one space  [1/s]; nullopt for other subjects.
template <class Space>
std::optional<double> natural_pace_in(const Subject& subject) {
  const auto* const found = dynamic_cast<const ChainSubject<Space>*>(&subject);
  if (found == nullptr) return {};
  const Chain<Space>& chain = found->chain();
  return chain.links() * std::sqrt(slowest_pace_factor * std::abs(chain.gravity()) / chain.lengths().sum());
}

/// Roughly the frequency of a chain  [1/s]; infinity for other subjects.
double natural_pace(const Subject& subject) {
  const std::optional<double> planar = natural_pace_in<Planar>(subject);
  return planar ? *planar : natural_pace_in<Spatial>(subject).value_or(std::numeric_limits<double>::infinity());
}

// The length of a run in swings, or in turns if it starts fast. Up to short_run the energy that an explicit method
// loses stays below the error of the motion.
constexpr double short_run = 100;
double run_length(const RunSetup& setup) {
  return setup.duration * std::hypot(natural_pace(*setup.subject), setup.start.v.cwiseAbs().maxCoeff());
}

// Whether a run takes less time by Taylor series. Series of few links are summed in registers
// (library/lane_methods.hpp). The numbers of a kernel have to fit into the first-level cache.
bool goes_by_series(const RunSetup& setup) {
  constexpr int most_links = 3, most_operands = 30;
  const Subject& subject = *setup.subject;
  if (setup.options.tolerance < 1e-13) return false;
  const auto* const system = dynamic_cast<const SystemSubject*>(&subject);
  const SystemTable* kernel = system == nullptr ? nullptr : &system->table();
  const int links = links_of<Planar>(subject) + links_of<Spatial>(subject);
  if (subject.loaded() && links_of<Planar>(subject) > 0) kernel = series_kernel<Planar>(links, true, true);
  if (kernel != nullptr) return kernel->info.series.operands <= most_operands;
  return links <= most_links && std::isfinite(natural_pace(subject)) && !subject.loaded();
}

// The smallest tolerance of explicit steps with tangents: below it, rounding is larger.
constexpr double finest_with_tangents = 1e-13;

// The tolerance of a step (step_tolerance). Runs of about the same length have the same one, so that they go in lanes
// together.
double tolerance_of_steps(const RunSetup& setup, double finest) {
  const double length = run_length(setup);
  return step_tolerance(setup.options.tolerance, std::isfinite(length) ? length / short_run : 1, finest);
}

}  // namespace
}  // namespace detail

RunOptions quickest_in_lanes(const RunSetup& setup) {
  RunOptions options = setup.options;
  if (options.method != Method::gauss || options.step != 0) return options;
  if (detail::goes_by_series(setup)) {
    options.method = Method::taylor;
    options.tolerance = detail::tolerance_of_steps(setup, smallest_tolerance);
    return lane_kind(setup, options) ? options : setup.options;
  }
  if (options.tolerance < 1e-9 || !setup.events.empty()) return options;
  options.method = Method::fehlberg78;
  options.tolerance *= 0.01;
  const bool is_tried = lane_kind(setup, options) && detail::has_to_be_tried(*setup.subject);
  const bool is_short = lane_kind(setup) && detail::run_length(setup) <= detail::short_run;
  return is_tried || is_short ? options : setup.options;
}

RunOptions quickest_with_tangents(const RunSetup& setup) {
  RunOptions options = setup.options;
  if (options.method != Method::gauss || options.step != 0) return options;
  options.method = Method::fehlberg78;
  options.tolerance = detail::tolerance_of_steps(setup, detail::finest_with_tangents);
  const bool is_tried = tangent_lane_kind(setup, options) && detail::has_to_be_tried(*setup.subject);
  return is_tried || tangent_lane_kind(setup, setup.options) ? options : setup.options;
}

RunOptions lane_options(const RunSetup& setup) {
  return setup.chooses_method ? quickest_in_lanes(setup) : setup.options;
}

namespace detail {
namespace {

RunOptions options_asked_for(const RunSetup& setup) {
  return setup.options;
}

// The kind of lanes in which a run was tried last, and its report if it succeeded.
struct Tried {
  std::optional<LaneKind> kind;
  std::optional<RunReport> report;
  std::optional<Track> track;  // of a run that gets a second look
};

// Tries the runs without a report in lanes, if their kind differs from that of the last try. Runs with a track go in
// lanes of their own, since a track takes time in every step.
void try_in_lanes(std::span<const RunSetup> setups, RunOptions (*options_of)(const RunSetup&),
                  const std::function<bool()>& stop, std::vector<Tried>& tried) {
  RunsByKind followed, others;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    if (tried[k].report) continue;
    const auto kind = lane_kind(setups[k], options_of(setups[k]));
    if (!kind || tried[k].kind == kind) continue;
    tried[k].kind = kind;
    (setups[k].is_estimated() ? followed : others)[*kind].push_back(k);
  }
  for (const RunsByKind* kinds : {&followed, &others}) {
    for (const auto& [kind, numbers] : *kinds) {
      const std::vector<const RunSetup*> alike = chosen(setups, numbers);
      std::vector<Track*> tracks;
      for (const std::size_t k : numbers) {
        tracks.push_back(kinds == &followed ? &tried[k].track.emplace(lane_track()) : nullptr);
      }
      auto reports = run_in_lanes(kind, alike, options_of(*alike[0]), stop, tracks);
      for (std::size_t k = 0; k < numbers.size(); ++k) tried[numbers[k]].report = std::move(reports[k]);
    }
  }
}

// Takes second looks at the runs that lanes have moved to their ends.
void look_again_in_lanes(std::span<const RunSetup> setups, const std::function<bool()>& stop,
                         std::vector<Tried>& tried) {
  std::vector<Judged> judged;
  for (std::size_t k = 0; k < setups.size(); ++k) {
    Tried& one = tried[k];
    if (one.report && one.track && one.report->end != RunEnd::stopped) {
      judged.push_back({setups[k], *one.report, *one.track});
    }
  }
  look_again(judged, stop);
}

}  // namespace
}  // namespace detail

std::vector<RunReport> run_members(std::span<const RunSetup> setups, const std::function<bool()>& stop) {
  std::vector<detail::Tried> tried(setups.size());
  detail::try_in_lanes(setups, lane_options, stop, tried);
  detail::try_in_lanes(setups, detail::options_asked_for, stop, tried);
  detail::look_again_in_lanes(setups, stop, tried);
  std::vector<RunReport> reports;
  reports.reserve(setups.size());
  for (std::size_t k = 0; k < setups.size(); ++k) {
    std::optional<RunReport>& report = tried[k].report;
    if (!report) {
      RunSetup alone = setups[k];
      if (tried[k].kind) alone.chooses_method = false;
      report = Run(std::move(alone)).go(stop);
    }
    reports.push_back(std::move(*report));
  }
  return reports;
}

namespace detail {
namespace {

std::vector<std::optional<LyapunovSpectrum>> exponents_in_lanes(const LaneKind& kind,
                                                                std::span<const RunSetup* const> alike,
                                                                const RunOptions& options,
                                                                const std::function<bool()>& stop) {
  if (kind.kernel != nullptr) return LaneExponents<PlainSystems>(kind, alike, options, stop).go();
  if (kind.dimension == Planar::dimension) return LaneExponents<PlainChains<Planar>>(kind, alike, options, stop).go();
  return LaneExponents<PlainChains<Spatial>>(kind, alike, options, stop).go();
}

}  // namespace
}  // namespace detail

std::vector<std::optional<LyapunovSpectrum>> exponents_in_lanes(std::span<const RunSetup> setups,
                                                                const std::function<bool()>& stop) {
  std::vector<std::optional<LyapunovSpectrum>> exponents(setups.size());
  std::vector<std::optional<LaneKind>> tried(setups.size());
  const auto quickest = [](const RunSetup& setup) {
    return setup.chooses_method ? quickest_with_tangents(setup) : setup.options;
  };
  const auto finer = [&](const RunSetup& setup) {
    RunOptions options = quickest(setup);
    if (options.method != setup.options.method)
      options.tolerance = std::max(detail::finest_with_tangents, 0.01 * options.tolerance);
    return options;
  };
  const std::function<RunOptions(const RunSetup&)> attempts[] = {quickest, finer, detail::options_asked_for};
  for (const auto& options_of : attempts) {
    detail::RunsByKind kinds;
    for (std::size_t k = 0; k < setups.size(); ++k) {
      const auto kind = tangent_lane_kind(setups[k], options_of(setups[k]));
      if (!kind || exponents[k] || tried[k] == kind) continue;
      tried[k] = kind;
      kinds[*kind].push_back(k);
    }
    for (const auto& [kind, numbers] : kinds) {
      const std::vector<const RunSetup*> alike = detail::chosen(setups, numbers);
      auto found = detail::exponents_in_lanes(kind, alike, options_of(*alike[0]), stop);
      if (found.empty()) return {};
      for (std::size_t k = 0; k < numbers.size(); ++k) exponents[numbers[k]] = std::move(found[k]);
    }
  }
  return exponents;
}

}  // namespace pendula
