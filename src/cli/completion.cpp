#include "cli/command_line.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "cli/help.hpp"

namespace pendula::cli {
namespace {

constexpr std::string_view bash_script =
    R"shell(# Completion of pendula for bash: the program itself tells what may come.
_pendula() {
  local words=() word i
  for ((i = 1; i <= COMP_CWORD; ++i)); do # bash takes KEY=VALUE apart
    word=${COMP_WORDS[i]}
    if ((${#words[@]})) && [[ $word == =* || (${words[-1]} == *= && -n $word) ]]; then
      words[-1]+=$word
    else
      words+=("$word")
    fi
  done
  local current=${words[-1]} lines
  mapfile -t lines < <("${COMP_WORDS[0]}" completion --words "${words[@]}" 2>/dev/null)
  COMPREPLY=()
  if [[ ${lines[0]-} == :files* ]]; then
    local ending file
    [[ $current == -*=* ]] && current=${current#*=}
    while IFS= read -r file; do
      if [[ -d $file ]]; then
        COMPREPLY+=("$file")
        continue
      fi
      for ending in ${lines[0]#:files}; do
        [[ $file == *"$ending" ]] && COMPREPLY+=("$file")
      done
    done < <(compgen -f -- "$current")
    compopt -o filenames
    return
  fi
  local before=${current%"${current##*=}"}
  for word in "${lines[@]%%$'\t'*}"; do
    COMPREPLY+=("${word#"$before"}")
  done
  [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *= ]] && compopt -o nospace
}
complete -F _pendula pendula
)shell";

constexpr std::string_view zsh_script = R"shell(#compdef pendula
# Completion of pendula for zsh: the program itself tells what may come.
_pendula() {
  local -a lines names shown open open_shown
  local line name
  lines=("${(@f)$("${words[1]}" completion --words "${(@)words[2,CURRENT]}" 2>/dev/null)}")
  if [[ ${lines[1]} == :files* ]]; then
    local -a endings=(${=lines[1]#:files})
    compset -P '-*='
    _files -g "${(j: :)${(@)endings/#/*}}"
    return
  fi
  for line in "${lines[@]}"; do
    [[ -n $line ]] || continue
    name=${line%%$'\t'*}
    [[ $line == *$'\t'* ]] && line="$name  -- ${line#*$'\t'}"
    if [[ $name == *= ]]; then
      open+=("$name") open_shown+=("$line")
    else
      names+=("$name") shown+=("$line")
    fi
  done
  (( ${#names} )) && compadd -l -d shown -a names
  (( ${#open} )) && compadd -Q -l -S '' -d open_shown -a open
}
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
  _pendula "$@"
else
  compdef _pendula pendula
fi
)shell";

constexpr std::string_view fish_script =
    R"shell(# Completion of pendula for fish: the program itself tells what may come.
function __pendula_candidates
    set -l before (commandline -opc)
    set -l current (commandline -ct)
    set -l lines (command $before[1] completion --words $before[2..-1] "$current" 2>/dev/null)
    if not string match -q ':files*' -- "$lines[1]"
        printf '%s\n' $lines
        return
    end
    set -l endings (string split -n ' ' -- (string replace ':files' '' -- $lines[1]))
    for line in (__fish_complete_path (string replace -r '^-[^=]*=' '' -- $current))
        set -l file (string split -m 1 \t -- $line)[1]
        if string match -q '*/' -- $file
            echo $file
        else
            for ending in $endings
                string match -q "*$ending" -- $file; and echo $file
            end
        end
    end
end
complete -c pendula -f -a '(__pendula_candidates)'
)shell";

std::string one_line(std::string_view word, std::string_view what) {
  return std::string(word) + (what.empty() ? "" : '\t' + std::string(what)) + '\n';
}

/// The option that a word names, with or without a value (--option=…).
const CLI::Option* option_named(const CLI::App& app, std::string_view word) {
  for (const CLI::Option* option : options_of(app)) {
    for (const std::string& name : option->get_lnames()) {
      if (word == "--" + name) return option;
    }
    for (const std::string& name : option->get_snames()) {
      if (word == "-" + name) return option;
    }
  }
  return nullptr;
}

bool takes_value(const CLI::Option* option) {
  return option != nullptr && option->get_type_size() != 0;
}

/// Keys of the scenario that the command reads; after a key its values, if there are few.
std::string key_lines(std::string_view command, std::string_view begin, const std::string& before) {
  std::string text;
  const auto add = [&](const std::string& word, std::string_view what) {
    if (word.starts_with(begin)) text += one_line(before + word, what);
  };
  const std::size_t equals = begin.find('=');
  if (equals != std::string_view::npos) {
    const std::string key(begin.substr(0, equals + 1));
    const io::ScenarioKey* const known = io::find_key(begin.substr(0, equals));
    if (known == nullptr) return text;
    for (const std::string_view choice : known->choices) add(key + std::string(choice), "");
    if (known->type == io::KeyType::truth) add(key + "true", ""), add(key + "false", "");
    return text;
  }
  for (const io::ScenarioTable* table : tables_of(command)) {
    if (table->name.empty()) continue;
    const bool repeats = io::find_key(table->name)->type == io::KeyType::tables;
    for (const io::ScenarioKey& key : table->keys) {
      add(std::string(table->name) + (repeats ? "[1]." : ".") + std::string(key.name) + "=", key.hint);
    }
  }
  return text;
}

/// Candidates for the value of an option or argument, those that begin with `begin`.
std::string value_lines(const CommandLine& line, const CLI::App& command, const CLI::Option* option,
                        std::string_view begin, const std::string& before = "") {
  const auto found = line.expected.find(option);
  if (found == line.expected.end()) return {};
  const Expected& expected = found->second;
  if (expected.is_key) return key_lines(command.get_name(), begin, before);
  if (expected.is_file) {
    std::string text = ":files";
    for (const std::string_view ending : expected.endings) text += ' ' + std::string(ending);
    return text + '\n';
  }
  std::string text;
  for (const std::string_view word : expected.words) {
    if (word.starts_with(begin)) text += one_line(before + std::string(word), "");
  }
  return text;
}

std::string option_lines(const CLI::App& app, std::string_view begin) {
  std::string text;
  for (const CLI::Option* option : options_of(app)) {
    for (const std::string& name : option->get_lnames()) {
      if (("--" + name).starts_with(begin)) text += one_line("--" + name, option->get_description());
    }
  }
  return text;
}

std::string command_lines(const CLI::App& app, std::string_view begin) {
  std::string text;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_name().starts_with(begin)) text += one_line(command->get_name(), command->get_description());
  }
  return text;
}

/// The argument after `given` ones.
const CLI::Option* next_argument(const CLI::App& command, std::size_t given) {
  const std::vector<const CLI::Option*> arguments = arguments_of(command);
  if (given < arguments.size()) return arguments[given];
  return !arguments.empty() && arguments.back()->get_expected_max() > 1 ? arguments.back() : nullptr;
}

}  // namespace

std::string candidates(const CommandLine& line, std::span<const std::string> words) {
  const std::string_view current = words.back();
  const CLI::App* command = nullptr;
  const CLI::Option* waiting = nullptr;  // an option without its value yet
  std::size_t given = 0;                 // number of arguments so far
  for (const std::string& word : words.first(words.size() - 1)) {
    if (command == nullptr) {
      const auto is_named = [&](const CLI::App* app) { return app->get_name() == word; };
      const std::vector<const CLI::App*> named = line.app.get_subcommands(is_named);
      if (!named.empty()) command = named.front();
    } else if (waiting != nullptr) {
      waiting = nullptr;
    } else if (const CLI::Option* option = option_named(*command, word)) {
      if (takes_value(option)) waiting = option;
    } else if (!word.starts_with("--")) {
      ++given;
    }
  }
  if (command == nullptr)
    return current.starts_with('-') ? option_lines(line.app, current) : command_lines(line.app, current);
  if (waiting != nullptr) return value_lines(line, *command, waiting, current);
  const std::size_t equals = current.find('=');
  if (current.starts_with("--") && equals != std::string_view::npos) {
    return value_lines(line, *command, option_named(*command, current.substr(0, equals)), current.substr(equals + 1),
                       std::string(current.substr(0, equals + 1)));
  }
  if (current.starts_with('-')) return option_lines(*command, current);
  return value_lines(line, *command, next_argument(*command, given), current);
}

std::string completion_script(std::string_view shell) {
  return std::string(shell == "bash" ? bash_script : shell == "zsh" ? zsh_script : fish_script);
}

}  // namespace pendula::cli
