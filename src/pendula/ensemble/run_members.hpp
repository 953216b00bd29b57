#pragma once

#include <functional>
#include <optional>
#include <pendula/ensemble/lane_kind.hpp>
#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/system/options.hpp>
#include <span>
#include <vector>

namespace pendula {

/// The options of a run, or those of an explicit method that has the same error in less time in lanes. A Gauss run with
/// a tolerance goes by Taylor series if few links, or a small kernel, make these cheap. Otherwise it goes by Fehlberg's
/// pair if the tolerance is not extreme, there are no events, and the run is so short that the energy which an explicit
/// method loses stays below the error of the motion.
RunOptions quickest_in_lanes(const RunSetup& setup);

/// The same for the leading exponent of a run of any length. Longer runs have a smaller tolerance, so that they lose no
/// more energy in all. Only chains have a known length in swings.
RunOptions quickest_with_tangents(const RunSetup& setup);

/// The options by which a run goes in lanes: by quickest_in_lanes if its method is to be chosen.
RunOptions lane_options(const RunSetup& setup);

/// Moves runs without observers, each as `Run` does: in lanes if possible, else one by one. Runs with an estimate get
/// second looks; those in lanes get them in lanes. Where a substituted method fails, the options that were asked for
/// are used. A report depends on its setup alone, to the last bit; that of a stopped run says only so. Throws as Run.
std::vector<RunReport> run_members(
    std::span<const RunSetup> setups, const std::function<bool()>& stop = [] { return false; });

/// The leading Lyapunov exponent of each run that goes in lanes, over its whole duration; nullopt for any other run.
/// The vector is empty if `stop` ended the work. A run whose method was chosen, and which loses too much energy, is
/// repeated with a hundredth of the tolerance (not below a least one), and then with its own options.
std::vector<std::optional<LyapunovSpectrum>> exponents_in_lanes(
    std::span<const RunSetup> setups, const std::function<bool()>& stop = [] { return false; });

}  // namespace pendula
