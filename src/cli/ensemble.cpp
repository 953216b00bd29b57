#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/version.hpp>
#include <string>
#include <thread>
#include <vector>

#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/ranks.hpp"
#include "io/ensemble_job.hpp"
#include "io/ensemble_output.hpp"
#include "io/errors.hpp"
#include "io/journal.hpp"

namespace pendula::cli {
namespace {

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

io::EnsembleSource source_of(const EnsembleOptions& options) {
  return {io::read_scenario_text(options.scenario), options.overrides, options.command,
          io::Toolchain::of_this_program()};
}

/// An ensemble from its scenario to its file.
class EnsembleSession {
 public:
  EnsembleSession(const EnsembleOptions& options, Ranks& ranks)
      : options_(options),
        ranks_(ranks),
        job_(
            source_of(options),
            [told = options.tells_progress()](const std::string& what) {
              if (told) std::cerr << "pendula: " << what << '\n';
            },
            [this] { return guard_.interrupted(); }),
        output_({options.output, options.shard, options.resume}, job_.head()) {}

  ExitStatus run() {
    output_.require_writable(options_.scenario);
    job_.require_members();
    if (ranks_.all(output_.is_complete())) return leave_alone();
    const std::vector<std::int64_t> missing = output_.find_missing([&](bool mine) { return ranks_.all(mine); });
    if (ranks_.rank() == 0 && output_.replaces() && !options_.quiet)
      std::cerr << "pendula: replacing " << options_.output << '\n';
    const auto began = Clock::now();
    work(missing);
    seconds_ = std::chrono::duration<double>(Clock::now() - began).count();
    ranks_.all(true);  // all ranks have written their members
    return ranks_.rank() == 0 ? finish() : done;
  }

 private:
  std::int64_t count() const { return job_.head().plan.count; }

  ExitStatus leave_alone() const {
    if (ranks_.rank() != 0) return done;
    if (!options_.quiet) std::cerr << "pendula: " << options_.output << ": has all members already\n";
    output_.remove_journals();
    return done;
  }

  void work(const std::vector<std::int64_t>& missing) {
    io::Journal journal(output_.folder(), job_.head().kind());
    ranks_.all(true);  // no rank reads the journals any more
    EnsembleProgress progress(count(), output_.already(), options_.tells_progress() && ranks_.size() == 1);
    const auto claim = [&]() -> std::optional<std::int64_t> {
      const std::int64_t k = guard_.interrupted() ? -1 : ranks_.claim();
      if (k < 0 || k >= static_cast<std::int64_t>(missing.size())) return std::nullopt;
      return missing[static_cast<std::size_t>(k)];
    };
    io::run_chunks(job_, threads(), claim, [&](const io::DoneChunk& chunk) {
      journal.add(chunk);
      progress.add(chunk.members.size());
    });
    journal.sync();
  }

  int threads() const {
    if (options_.threads > 0) return options_.threads;
    return ranks_.size() > 1 ? 1 : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  }

  ExitStatus finish() {
    const std::optional<io::EnsembleTally> tally = output_.write();
    if (!tally) return leave_alone();
    tally_ = *tally;
    const bool complete = tally_.done == count();
    if (complete) warnings_ = job_.warnings(tally_);
    for (const std::string& warning : warnings_) std::cerr << "pendula: warning: " << warning << '\n';
    tell();
    if (!complete) {
      std::cerr << "pendula: " << options_.output << ": " << count() - tally_.done << " of " << count()
                << " members are missing; to go on, say the same with --resume\n";
      return unfinished;
    }
    return tally_.failed() == count() ? failed : done;
  }

  void tell() const {
    const std::int64_t moved = tally_.done - output_.already();
    nlohmann::ordered_json statuses = nlohmann::ordered_json::object();
    for (std::size_t k = 0; k < io::member_statuses.size(); ++k) {
      if (tally_.statuses[k] > 0) statuses[std::string(io::member_statuses[k])] = tally_.statuses[k];
    }
    if (options_.json) {
      const nlohmann::ordered_json json{{"pendula", version},
                                        {"scenario", job_.name()},
                                        {"output", options_.output},
                                        {"members", count()},
                                        {"members_done", tally_.done},
                                        {"complete", tally_.done == count()},
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
    if (options_.quiet) return;
    std::cout << "members            " << tally_.done << (tally_.done < count() ? " of " + std::to_string(count()) : "")
              << '\n';
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
  io::EnsembleJob job_;
  io::EnsembleOutput output_;
  InterruptGuard guard_;
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
