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

/// The options of a run, or those of an explicit method where lanes come to the same errors sooner by that. Of a Gauss
/// run by a tolerance those are Taylor series where the chain is short; else Fehlberg's pair, by a tolerance of more
/// than a few last digits, where nothing is looked for step by step, and the run is over before the energy, which an
/// explicit method loses step by step, is off by more than the motion.
RunOptions quickest_in_lanes(const RunSetup& setup);

/// The same for the leading exponent of a run, however long that is: the longer, the smaller the tolerance, so that no
/// more of the energy is lost in all. How much longer is known of chains.
RunOptions quickest_with_tangents(const RunSetup& setup);

/// How members are moved.
enum class MemberMethod {
  asked,    ///< as their options tell
  quickest  ///< as quickest_in_lanes tells; who cannot be moved so, as their options tell, in lanes where that goes
};

/// The options by which a run goes in lanes.
RunOptions lane_options(const RunSetup& setup, MemberMethod method);

/// Runs that nobody observes, as `Run` does one: many in lanes where they can go there, the others one by one. Those
/// that are to be estimated are looked at again, those in lanes by others in lanes. A report depends on its setup
/// alone, to the last bit; of a run that was stopped it says that and nothing else. Throws as Run.
std::vector<RunReport> run_members(
    std::span<const RunSetup> setups, const std::function<bool()>& stop = [] { return false; },
    MemberMethod method = MemberMethod::asked);

/// The leading Lyapunov exponents of those of the runs that go in lanes, each over the whole of its duration, with one
/// tangent; of others, and of those that could not be moved so, none. Empty where it was stopped. Who loses too much
/// energy by a method that was not asked for tries a hundredth of the tolerance, and then goes as its options tell.
std::vector<std::optional<LyapunovSpectrum>> exponents_in_lanes(
    std::span<const RunSetup> setups, const std::function<bool()>& stop = [] { return false; },
    MemberMethod method = MemberMethod::asked);

}  // namespace pendula
