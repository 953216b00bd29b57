#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <pendula/ensemble/run_members.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/doubts.hpp>
#include <pendula/run/library.hpp>
#include <pendula/version.hpp>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/kept.hpp"
#include "cli/members.hpp"
#include "cli/ranks.hpp"
#include "cli/terminal_line.hpp"
#include "io/ensemble_file.hpp"
#include "io/ensemble_plan.hpp"
#include "io/file_format.hpp"
#include "io/input_error.hpp"
#include "io/journal.hpp"
#include "io/link_target.hpp"
#include "io/natural_units.hpp"
#include "io/output_error.hpp"
#include "io/provenance.hpp"

namespace pendula::cli {
namespace {

namespace fs = std::filesystem;

using Clock = std::chrono::steady_clock;

/// A progress line on standard error: members done, rate, remaining time.
class EnsembleProgress {
 public:
  EnsembleProgress(std::int64_t members, std::int64_t done, bool wanted)
      : members_(members), before_(done), done_(done), line_(wanted) {}

  /// May be called by any thread.
  void add(std::int64_t members) {
    const std::scoped_lock lock(guard_);
    done_ += members;
    line_.draw([this](double seconds) {
      const double rate = static_cast<double>(done_ - before_) / seconds;
      return std::to_string(done_) + " of " + std::to_string(members_) + " members   " + rounded(rate, 3) +
             " members/s   " + rest_text(static_cast<double>(members_ - done_) / rate) + " left";
    });
  }

 private:
  std::int64_t members_, before_, done_;
  TerminalLine line_;
  std::mutex guard_;
};

/// Members in a chunk. It depends on the ensemble alone, so that a resumed one has the same; a few for each lane.
std::int64_t chunk_of(std::int64_t members, bool in_lanes) {
  return std::clamp<std::int64_t>(members / 128, in_lanes ? 32 : 1, 512);
}

template <class Scenario>
Kept kept_of(const Scenario& scenario, const io::EnsemblePlan& plan) {
  return Kept(plan, *io::subject_of(scenario), scenario.events);
}

/// An ensemble from its scenario to its file.
class EnsembleSession {
 public:
  EnsembleSession(const EnsembleOptions& options, Ranks& ranks)
      : options_(options),
        ranks_(ranks),
        scenarios_(options.scenario, options.overrides, options.json),
        plan_(io::parse_ensemble(scenarios_.text().text, scenarios_.text().name, options.overrides)),
        kept_(std::visit([&](const auto& scenario) { return kept_of(scenario, plan_); }, scenarios_.base())),
        head_{origin(), plan_, kept_.columns(), chunk_of(plan_.count, go_in_lanes()), natural_units()},
        folder_(io::link_target(options.output) + ".parts") {}

  ExitStatus run() {
    require_output();
    require_members();
    if (ranks_.all((options_.resume || options_.shard) && io::is_complete(options_.output, head_)))
      return leave_alone();
    const std::vector<std::int64_t> missing = find_missing();
    tell_what_is_replaced();
    const auto began = Clock::now();
    work(missing);
    seconds_ = std::chrono::duration<double>(Clock::now() - began).count();
    ranks_.all(true);  // all ranks have written their members
    return ranks_.rank() == 0 ? finish() : done;
  }

 private:
  bool go_in_lanes() {
    const auto goes = [&](const auto& scenario) {
      const RunSetup setup = member_setup(scenario);
      return lane_kind(setup).has_value() || (plan_.chooses_method && lane_kind(setup, quickest_in_lanes(setup)));
    };
    return std::visit(goes, scenarios_.base());
  }

  std::optional<io::NaturalUnits> natural_units() {
    return std::visit([](const auto& scenario) { return scenario.natural; }, scenarios_.base());
  }

  io::RunOrigin origin() const {
    io::RunOrigin origin;
    origin.version = version;
    origin.instruction_set = library().instruction_set;
    const std::string& name = scenarios_.text().name;
    origin.title = fs::path(name).stem().string() + ": " + std::to_string(plan_.count) + " members";
    origin.command = options_.command;
    origin.scenario_name = io::public_name(name);
    origin.scenario = scenarios_.text().text;
    origin.overrides = scenarios_.overrides();
    origin.model = scenarios_.model();
    return origin;
  }

  /// Throws io::InputError if the output could not be written.
  void require_output() const {
    std::error_code unknown;
    if (options_.output == "-") io::reject_output(options_.output, "standard output");
    io::require_format(options_.output, io::FileFormat::hdf5, "an ensemble (HDF5)");
    if (fs::is_directory(options_.output, unknown)) io::reject_output(options_.output, "a folder");
    if (fs::exists(options_.output, unknown) && !fs::is_regular_file(options_.output, unknown)) {
      io::reject_output(options_.output, "a device, a pipe or a socket, whose place a file would take");
    }
    if (fs::exists(options_.output, unknown) && access(options_.output.c_str(), W_OK) != 0) {
      io::reject_output(options_.output, options_.output, errno);
    }
    if (fs::equivalent(options_.output, options_.scenario, unknown)) {
      throw io::InputError(options_.output + ": expected a file for the ensemble, got the scenario itself");
    }
  }

  /// Says that a file is replaced, unless shards share it, or an interrupted ensemble has left it.
  void tell_what_is_replaced() const {
    std::error_code unknown;
    if (ranks_.rank() != 0 || options_.resume || options_.shard || !fs::exists(options_.output, unknown)) return;
    std::cerr << "pendula: replacing " << options_.output << '\n';
  }

  /// The file is complete already: another shard has just written it, or it was there before.
  ExitStatus leave_alone() const {
    if (ranks_.rank() != 0) return done;
    std::cerr << "pendula: " << options_.output << ": has all members already\n";
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
    return done;
  }

  /// Throws io::InputError if none of some evenly chosen members has a valid scenario: then a key is wrong, not a
  /// number.
  void require_members() {
    constexpr std::int64_t most = 64;
    const std::int64_t count = std::min(most, plan_.count);
    std::string first;
    for (std::int64_t k = 0; k < count; ++k) {
      const std::int64_t member = k * (plan_.count / count);
      try {
        scenarios_.of_member(plan_, member);
        return;
      } catch (const io::InputError& error) {
        if (first.empty()) first = error.what();
      }
    }
    throw io::InputError(first);
  }

  /// Chunks of this shard that are not done. Throws io::InputError if there are journals without --resume, or of
  /// another ensemble.
  std::vector<std::int64_t> find_missing() {
    std::error_code unknown;
    const bool is_begun = fs::is_directory(folder_, unknown) && !fs::is_empty(folder_, unknown);
    if (is_begun && !options_.resume && !options_.shard) {
      throw io::InputError(folder_ +
                           ": expected --resume, or no such folder, got what an ensemble that was not finished "
                           "left; to begin anew, delete it");
    }
    if (options_.resume && !fs::is_directory(folder_, unknown) && !fs::exists(options_.output, unknown)) {
      throw io::InputError(folder_ + ": expected what an ensemble has left, to go on with, got nothing");
    }
    const std::vector<bool> there = io::done_chunks(folder_, head_);
    const bool none = std::ranges::none_of(there, [](bool is) { return is; });
    const bool same = ranks_.all(!is_begun || !none || io::journals_are_of(folder_, head_.kind()));
    if (!same) {
      throw io::InputError(folder_ +
                           ": expected the journals of this ensemble, got those of another scenario, program "
                           "or instruction set");
    }
    std::vector<std::int64_t> missing;
    for (std::int64_t k = 0; k < head_.chunks(); ++k) {
      const bool is_there = there[static_cast<std::size_t>(k)];
      if (is_there) already_ += head_.members_of(k).size();
      if (!is_there && (!options_.shard || k % options_.shard->of == options_.shard->number - 1)) missing.push_back(k);
    }
    return missing;
  }

  void work(const std::vector<std::int64_t>& missing) {
    io::Journal journal(folder_, head_.kind());
    ranks_.all(true);  // no rank reads the journals any more
    const MemberRuns members(scenarios_, plan_, kept_, guard_);
    EnsembleProgress progress(plan_.count, already_, !options_.json && ranks_.size() == 1);
    const auto claim = [&]() -> std::optional<Chunk> {
      const std::int64_t k = guard_.interrupted() ? -1 : ranks_.claim();
      if (k < 0 || k >= static_cast<std::int64_t>(missing.size())) return std::nullopt;
      return head_.members_of(missing[static_cast<std::size_t>(k)]);
    };
    try {
      for_each_chunk(threads(), claim, [&](const Chunk& chunk) {
        journal.add(members.run(chunk));
        progress.add(chunk.size());
      });
    } catch (const Interrupted&) {
      // the journal has what is done
    }
    journal.sync();
  }

  int threads() const {
    if (options_.threads > 0) return options_.threads;
    return ranks_.size() > 1 ? 1 : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  }

  /// A line about the second look at some members.
  void doubt() {
    if (tally_.untrusted == 0) return;
    const std::int64_t first = tally_.first_untrusted;
    std::string numbers;
    for (const std::string& each : plan_.overrides(first)) numbers += (numbers.empty() ? "" : ", ") + each;
    const auto advice = [](const auto& scenario) { return detail::smaller_step_advice(scenario.run); };
    warnings_.push_back("of " + std::to_string(tally_.looked_at) + " members that were looked at again " +
                        std::to_string(tally_.untrusted) +
                        " cannot be trusted, or not to the last digits (trusted = 0 in the file); the first, member " +
                        std::to_string(first) + ": " + numbers + "; " + std::visit(advice, scenarios_.base()));
  }

  /// Shards that end at the same time write one after the other.
  bool write() {
    const io::FolderLock lock(folder_);
    if (options_.shard && io::is_complete(options_.output, head_)) return false;
    tally_ = io::write_ensemble(options_.output, head_, folder_);
    std::error_code ignored;
    if (tally_.done == plan_.count) fs::remove_all(folder_, ignored);
    return true;
  }

  ExitStatus finish() {
    if (!write()) return leave_alone();
    const bool complete = tally_.done == plan_.count;
    if (complete) doubt();
    if (complete && tally_.failed() > 0) {
      warnings_.push_back(std::to_string(tally_.failed()) + " of " + std::to_string(plan_.count) +
                          " members failed; the first, member " + std::to_string(tally_.first_failure.member) + ": " +
                          tally_.first_failure.text);
    }
    for (const std::string& warning : warnings_) std::cerr << "pendula: warning: " << warning << '\n';
    tell();
    if (!complete) {
      std::cerr << "pendula: " << options_.output << ": " << plan_.count - tally_.done << " of " << plan_.count
                << " members are missing; to go on, say the same with --resume\n";
      return unfinished;
    }
    return tally_.failed() == plan_.count ? failed : done;
  }

  void tell() const {
    const std::int64_t moved = tally_.done - already_;
    nlohmann::ordered_json statuses = nlohmann::ordered_json::object();
    for (std::size_t k = 0; k < io::member_statuses.size(); ++k) {
      if (tally_.statuses[k] > 0) statuses[std::string(io::member_statuses[k])] = tally_.statuses[k];
    }
    if (options_.json) {
      const nlohmann::ordered_json json{{"pendula", version},
                                        {"scenario", scenarios_.text().name},
                                        {"output", options_.output},
                                        {"members", plan_.count},
                                        {"members_done", tally_.done},
                                        {"complete", tally_.done == plan_.count},
                                        {"statuses", statuses},
                                        {"looked_at", tally_.looked_at},
                                        {"untrusted", tally_.untrusted},
                                        {"threads", threads()},
                                        {"ranks", ranks_.size()},
                                        {"wall_seconds", seconds_},
                                        {"members_per_second", static_cast<double>(moved) / seconds_},
                                        {"warnings", warnings_}};
      std::cout << json.dump() << '\n';
      return;
    }
    std::cout << "members            " << tally_.done
              << (tally_.done < plan_.count ? " of " + std::to_string(plan_.count) : "") << '\n';
    for (const auto& [name, count] : statuses.items()) std::cout << "  " << name << "  " << count << '\n';
    std::cout << "looked at again    " << tally_.looked_at << ", " << tally_.untrusted << " of them not trusted\n";
    std::cout << "time               " << rounded(seconds_, 3) << " s, "
              << rounded(static_cast<double>(moved) / seconds_, 3) << " members a second, " << threads()
              << (threads() == 1 ? " thread" : " threads")
              << (ranks_.size() > 1 ? ", " + std::to_string(ranks_.size()) + " ranks" : "") << '\n'
              << "file               " << options_.output << '\n';
  }

  const EnsembleOptions& options_;
  Ranks& ranks_;
  MemberScenarios scenarios_;
  io::EnsemblePlan plan_;
  Kept kept_;
  io::EnsembleHead head_;
  std::string folder_;
  InterruptGuard guard_;
  std::int64_t already_ = 0;
  double seconds_ = 0;
  io::EnsembleTally tally_;
  std::vector<std::string> warnings_;
};

}  // namespace

ExitStatus ensemble(const EnsembleOptions& options) {
  Ranks ranks(options.shard.has_value());
  if (ranks.size() == 1) return EnsembleSession(options, ranks).run();
  try {
    return EnsembleSession(options, ranks).run();
  } catch (const std::exception& error) {
    std::cerr << "pendula: rank " << ranks.rank() << ": " << error.what() << '\n';
    ranks.abort(dynamic_cast<const io::InputError*>(&error) != nullptr ? wrong_input : failed);
  }
}

}  // namespace pendula::cli
