#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/scenario_keys.hpp"

namespace pendula::cli {

struct CommandLine;

/// An example: a command line, and what it does.
struct Example {
  std::string_view command;  ///< empty for the program as a whole
  std::string_view call;
  std::string_view what;
};

/// Examples of a command, in an order in which they can be run.
std::vector<Example> examples_of(std::string_view command);

/// The version and the instruction set.
std::string version_text();

/// An option or argument as it is typed: `-o, --output FILE`.
std::string typed(const CLI::Option& option);

/// Options of a command, or its arguments.
std::vector<const CLI::Option*> options_of(const CLI::App& command);
std::vector<const CLI::Option*> arguments_of(const CLI::App& command);

/// `pendula simulate [OPTIONS] SCENARIO`.
std::string usage(const CLI::App& command);

/// The heading of a table: `[chain]`, `[[event]]`.
std::string heading(const io::ScenarioTable& table);

/// Tables of a scenario that a command reads.
std::vector<const io::ScenarioTable*> tables_of(std::string_view command);

/// The values of a key, its unit and its default: `number > 0; s; must be given`.
std::string terms(const io::ScenarioKey& key);

inline constexpr std::string_view exit_status =
    "0 done; 1 the computation failed, rows already computed are kept; 2 the input was wrong; 3 members of an ensemble "
    "are missing, and --resume goes on.";
inline constexpr std::string_view environment =
    "PENDULA_ARCH asks for a lesser instruction set than the best that the processor has; CC and CFLAGS compile "
    "models; "
    "XDG_CACHE_HOME has the folder that keeps their kernels.";

/// The help of the program or of a command.
std::string help_text(const CommandLine& line, const CLI::App& asked);

/// All keys of scenarios.
std::string scenario_help();

/// All keys of summaries.
std::string summary_help();

struct CommandLine;

/// The manual page pendula(1), in the macros of man(7).
std::string manual_page(const CommandLine& line);

}  // namespace pendula::cli
