#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cli/commands.hpp"

namespace pendula::cli {

/// The values that a word of the command line may have, for completion: a file with one of these endings (any, if there
/// are none), one of these words, or a key of the scenario.
// NOLINTBEGIN(readability-redundant-member-init): left out in designated initializers
struct Expected {
  std::vector<std::string_view> endings = {};
  std::vector<std::string_view> words = {};
  bool is_file = false;
  bool is_key = false;
};  // NOLINTEND(readability-redundant-member-init)

/// Topics of help besides commands.
inline constexpr std::string_view scenario_topic = "scenario", summary_topic = "summary";

struct HelpOptions {
  std::string topic;  ///< a command or a topic; empty for the program
  bool json = false;  ///< the topic as a JSON Schema
  bool man = false;   ///< all of it as a manual page
};

/// The definition of the command line, and its parsed options.
struct CommandLine {
  CommandLine();
  CommandLine(const CommandLine&) = delete;  // options have pointers to their values
  CommandLine& operator=(const CommandLine&) = delete;

  CLI::App app;
  CLI::App* simulate;
  CLI::App* ensemble;
  CLI::App* lyapunov;
  CLI::App* linearize;
  CLI::App* plot;
  CLI::App* map;
  CLI::App* gallery;
  CLI::App* lab;
  CLI::App* exports;
  CLI::App* models;
  CLI::App* describe;
  CLI::App* new_model;
  CLI::App* check;
  CLI::App* build;
  CLI::App* kernels;
  CLI::App* help;
  CLI::App* completion;
  SimulateOptions simulate_options;
  EnsembleOptions ensemble_options;
  LyapunovOptions lyapunov_options;
  LinearizeOptions linearize_options;
  PlotOptions plot_options;
  MapOptions map_options;
  std::string gallery_folder;
  LabOptions lab_options;
  ExportOptions export_options;
  bool models_as_json = false;
  DescribeOptions describe_options;
  std::string model_name;
  CheckOptions check_options;
  BuildOptions build_options;
  HelpOptions help_options;
  std::string shell;
  std::map<const CLI::Option*, Expected> expected;

 private:
  void add_simulate();
  void add_ensemble();
  void add_lyapunov();
  void add_linearize();
  void add_pictures();
  void add_models();
  void add_export();
  void add_help();
  CLI::Option* takes(CLI::Option* option, const char* type, Expected what);
  CLI::Option* takes_file(CLI::Option* option, std::vector<std::string_view> endings);
  CLI::Option* takes_words(CLI::Option* option, const char* type, std::vector<std::string_view> words);
  void add_scenario(CLI::App* command, std::string& scenario);
  void add_set(CLI::App* command, std::vector<std::string>& overrides);
  void add_links(CLI::App* command, std::optional<int>& links);
};

/// ` (did you mean …?)` with an option of `app` or a command that is near to an unknown word.
std::string likely_meant(const CLI::App& app, const std::string& word);

/// Throws io::InputError on `--set KEY VALUE`, which is one word, KEY=VALUE.
void require_one_word(const std::vector<std::string>& words);

/// The scripts of shells ask by `pendula completion --words WORD...`.
inline constexpr std::string_view candidates_flag = "--words";

/// Candidates for the last of the words after `pendula`, a line each, some with a tab and a description; or `:files`
/// and the endings of files.
std::string candidates(const CommandLine& line, std::span<const std::string> words);

/// A script for bash, zsh or fish that asks the program for candidates.
std::string completion_script(std::string_view shell);

}  // namespace pendula::cli
