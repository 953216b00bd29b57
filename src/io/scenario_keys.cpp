#include "io/scenario_keys.hpp"

#include <algorithm>
#include <pendula/chain/space.hpp>
#include <pendula/numeric/number_text.hpp>
#include <pendula/system/options.hpp>
#include <vector>

namespace pendula::io {
namespace {

using enum KeyType;
using Names = std::span<const std::string_view>;

constexpr std::int64_t any_most = std::numeric_limits<std::int64_t>::max();
constexpr RunOptions options;

constexpr ScenarioKey a_number(std::string_view name, std::string_view unit, Bound bound, Otherwise otherwise,
                               std::string_view hint) {
  return {.name = name, .type = number, .unit = unit, .otherwise = otherwise, .hint = hint, .bound = bound};
}

constexpr ScenarioKey each_link(std::string_view name, std::string_view unit, Bound bound, Otherwise otherwise,
                                std::string_view hint) {
  return {.name = name, .type = per_link, .unit = unit, .otherwise = otherwise, .hint = hint, .bound = bound};
}

constexpr ScenarioKey an_integer(std::string_view name, std::int64_t least, std::int64_t most, Otherwise otherwise,
                                 std::string_view hint) {
  return {.name = name, .type = integer, .otherwise = otherwise, .hint = hint, .least = least, .most = most};
}

constexpr ScenarioKey one_of(std::string_view name, Names choices, Otherwise otherwise, std::string_view hint) {
  return {.name = name, .type = choice, .otherwise = otherwise, .hint = hint, .choices = choices};
}

constexpr ScenarioKey another(std::string_view name, KeyType type, Otherwise otherwise, std::string_view hint) {
  return {.name = name, .type = type, .otherwise = otherwise, .hint = hint};
}

/// A key that a resumed run may change.
constexpr ScenarioKey changeable(ScenarioKey key) {
  key.may_change = true;
  return key;
}

constexpr InWords none{"none"};
constexpr Required required;

constexpr std::array<ScenarioKey, 7> document = {
    another("chain", table, none, "what hangs there: a chain"),
    another("system", table, none, "any other system, in place of [chain]"),
    another("start", table, none, "where it starts"),
    another("run", table, none, "how it is moved"),
    another("output", table, none, "which rows are kept"),
    another("event", tables, none, "instants to find on the way"),
    another("ensemble", table, none, "many members, with other numbers in some keys"),
};

constexpr std::array<std::string_view, 2> spaces = {Planar::name, Spatial::name};
constexpr std::array<std::string_view, 2> unit_systems = {"SI", "natural"};

constexpr std::array<ScenarioKey, 12> chain = {
    one_of("space", spaces, required, "planar (y up) or spatial (z up)"),
    an_integer("links", 1, max_links, InWords{"the length of the first array"},
               "the number of links, where no array tells it"),
    each_link("masses", "kg", positive, required, "the masses of the bobs"),
    each_link("lengths", "m", positive, required, "the lengths of the rods"),
    a_number("gravity", "m/s^2", any_number, 9.81, "acceleration of gravity, downwards"),
    each_link("damping", "N m s/rad", not_negative, 0.0, "slows each link by this times its angular velocity"),
    {.name = "torque", .type = torque, .unit = "N m", .otherwise = 0.0, .hint = "constant torque on each link"},
    one_of("units", unit_systems, unit_systems[0], "of all other tables and of all output"),
    another("end", table, InWords{"the last bob hangs free"}, "what holds the last bob"),
    another("drive", tables, none, "torques amplitude sin(frequency t + phase), each on one link"),
    another("feedback", tables, none, "torques that follow from the motion"),
    another("signal", tables, none, "torques from measured numbers"),
};

/// A key with a number an axis.
constexpr ScenarioKey each_axis(std::string_view name, std::string_view unit, Otherwise otherwise,
                                std::string_view hint) {
  return {.name = name, .type = numbers, .unit = unit, .otherwise = otherwise, .hint = hint};
}

constexpr std::array<ScenarioKey, 5> chain_end = {
    each_axis("at", "m", InWords{"must be given without ring"}, "where it is held: [x, y], in space [x, y, z]"),
    another("ring", truth, false, "whether it is held at the pivot, in place of at"),
    each_axis("amplitude", "m", InWords{"it rests"},
              "how far it moves along each axis: amplitude sin(frequency t + phase)"),
    each_axis("frequency", "rad/s", InWords{"must be given with an amplitude"}, "angular frequencies of that"),
    each_axis("phase", "rad", InWords{"0 along each axis"}, "phases of that at t = 0"),
};

constexpr std::array<ScenarioKey, 4> chain_drive = {
    an_integer("link", 1, max_links, required, "the link that it acts on, 1 at the pivot"),
    {.name = "amplitude", .type = torque, .unit = "N m", .hint = "a torque"},
    a_number("frequency", "rad/s", any_number, required, "an angular frequency"),
    a_number("phase", "rad", any_number, 0.0, "phase at t = 0"),
};

constexpr std::array<ScenarioKey, 6> system = {
    another("model", text, required, "a model file, or the name of a built-in model"),
    an_integer("links", 1, 64, InWords{"1, for the model to say"}, "number of links, where the model has some"),
    another("parameters", names, InWords{"those of the model"}, "a table by name"),
    another("drive", tables, none, "constant + amplitude sin(frequency t + phase) + value, added to an input"),
    another("feedback", tables, none, "what follows from the motion, added to an input"),
    another("signal", tables, none, "measured numbers, added to an input"),
};

constexpr std::array<ScenarioKey, 6> system_drive = {
    another("input", text, required, "the name of an input or a motion of the model"),
    another("value", text, none, "an expression of the time t alone, as \"t < 1 ? 0.5 : 0\""),
    a_number("constant", "", any_number, 0.0, "in the unit of the input"),
    a_number("amplitude", "", any_number, 0.0, "in the unit of the input"),
    a_number("frequency", "rad/s", any_number, InWords{"must be given with an amplitude"}, "an angular frequency"),
    a_number("phase", "rad", any_number, 0.0, "phase at t = 0"),
};

/// Keys of signals, but for what inputs are.
constexpr std::array<ScenarioKey, 6> signal_of(std::string_view inputs) {
  return {
      another("input", text, required, inputs),
      another("file", text, none, "a CSV file with names in its first line and a column t, in s"),
      another("column", text, InWords{"the name of the input"}, "the column of the file"),
      {.name = "times", .type = numbers, .unit = "s", .otherwise = none, .hint = "in place of file: ascending times"},
      another("values", numbers, none, "a number at each of the times, in the unit of the input"),
      another("hold", truth, false, "whether it is held from time to time; else it is linear in between"),
  };
}

constexpr auto system_signal = signal_of("the name of an input of the model");
constexpr auto chain_signal = signal_of("a torque: \"torque_1\", in space \"torque_x_1\"");

constexpr std::array<ScenarioKey, 4> system_feedback = {
    another("input", text, required, "the name of an input of the model"),
    another("value", text, required, "an expression in the columns of the motion, as \"-12*x - 9*x_dot\""),
    a_number("sample", "s", positive, InWords{"continuous"}, "time from sample to sample, in between it is held"),
    a_number("limit", "", positive, none,
             "the largest size of the value, in the unit of the input, of sampled feedback"),
};

constexpr std::array<ScenarioKey, 4> chain_feedback = {
    another("input", text, required, "a torque: \"torque_1\", in space \"torque_x_1\""),
    another("value", text, required, "an expression in the columns of the motion, as \"-2*theta_dot_1\""),
    a_number("sample", "s", positive, required, "time from sample to sample, in between it is held"),
    a_number("limit", "N m", positive, none, "the largest size of the value"),
};

constexpr std::array<std::string_view, 2> shapes = {"angles", "hanging"};

constexpr std::array<ScenarioKey, 7> start = {
    one_of("shape", shapes, shapes[0], "by angles, or as a chain hangs at rest between the pivot and its end"),
    each_link("theta", "rad", any_number, InWords{"must be given, unless it hangs"},
              "the angles at the start, from the downward vertical"),
    each_link("phi", "rad", any_number, 0.0, "angles around the vertical, in space only"),
    each_link("theta_dot", "rad/s", any_number, 0.0, "rates of theta"),
    each_link("phi_dot", "rad/s", any_number, 0.0, "rates of phi, in space only"),
    each_link("p_theta", "N m s", any_number, InWords{"rates are given"},
              "conjugate momenta of theta, in place of rates"),
    each_link("p_phi", "N m s", any_number, InWords{"rates are given"}, "conjugate momenta of phi, in space only"),
};

/// Smaller errors cannot be told from rounding.
constexpr Bound errors{smallest_tolerance, false};

/// Those of Method, then "auto".
constexpr auto methods = [] {
  std::array<std::string_view, names_of<Method>.size() + 1> names;
  std::ranges::copy(names_of<Method>, names.begin());
  names.back() = "auto";
  return names;
}();

constexpr std::array<ScenarioKey, 10> run = {
    one_of("method", methods, methods.back(),
           "Gauss-Legendre, Radau IIA where damping is stiff, or an explicit method; auto: Taylor series or Gauss "
           "steps, with step, stages, form, solver or iteration always Gauss"),
    an_integer("stages", 1, 8, InWords{"2 with a step, else as many as the tolerance wants"},
               "of gauss; of radau 2 or 3"),
    one_of("form", names_of<Form>, name_of(options.form), "of gauss: symplectic in momenta, or in velocities"),
    one_of("solver", names_of<Solver>, name_of(options.solver),
           "of gauss: O(n) along the chain, or a kernel for this number of links"),
    one_of("iteration", names_of<Iteration>, name_of(options.iteration), "of gauss: how stage equations are solved"),
    a_number("step", "s", positive, InWords{"steps follow from accuracy or tolerance; of rk4 1e-3"}, "constant steps"),
    a_number("tolerance", "1", errors, options.tolerance,
             "error of the motion relative to its size; of explicit methods error a step"),
    a_number("accuracy", "1", errors, InWords{"1e-9 without step and tolerance"},
             "error of every row and event, in place of step and tolerance"),
    changeable(a_number("duration", "s", not_negative, 10.0, "length of the run")),
    another("estimate", truth, true, "whether to look how far rows can be trusted"),
};

constexpr std::array<ScenarioKey, 5> output = {
    an_integer("every", 1, any_most, InWords{"of constant steps, so that rows are as interval would have them"},
               "steps from row to row"),
    a_number("interval", "s", positive, InWords{"a round number: 400 to 5000 rows; the last state is one, too"},
             "time from row to row, in place of every"),
    {.name = "times",
     .type = numbers,
     .unit = "s",
     .otherwise = none,
     .hint = "times of rows, ascending, in place of every"},
    another("columns", columns, none, "further columns of every file, as { height = \"1 - cos(theta_1)\" }"),
    changeable(a_number("checkpoint", "s", positive, 60.0, "wall time between places that a run can go on from")),
};

constexpr std::array<std::string_view, 3> directions = {"up", "down", "both"};

constexpr std::array<ScenarioKey, 4> event = {
    another("name", text, required, "a name of letters, digits, _ and -"),
    another("when", text, required, "an expression that crosses zero where the event is, as \"x_1 - 0.5\""),
    one_of("direction", directions, directions[2], "which way it crosses zero"),
    another("stop", truth, false, "whether the run ends there"),
};

constexpr std::array<std::string_view, 2> member_methods = {"run", "auto"};

constexpr std::array<ScenarioKey, 7> ensemble = {
    another("axis", tables, none, "axes of a grid, either these"),
    another("random", tables, none, "keys that are drawn for every member, or these"),
    another("list", tables, none, "keys whose values are listed for every member"),
    an_integer("count", 1, most_members, InWords{"must be given with random keys, where there are no lists"},
               "how many members, an integer >= 1"),
    an_integer("seed", 0, any_most, std::int64_t{1}, "of what is drawn"),
    one_of("method", member_methods, member_methods[0],
           "that of [run]; auto: what is quickest in lanes, for motions and exponents, whatever [run] says"),
    another("keep", texts, InWords{"final, energy_error, steps and all events"},
            "a list of what to keep, such as [\"final\", \"energy_error\"]"),
};

constexpr std::string_view key_of_scenario = "a key of the scenario, such as \"start.theta[1]\"";

constexpr std::string_view list_of_numbers = "an array of finite numbers, one or more";

constexpr std::array<ScenarioKey, 5> ensemble_axis = {
    another("key", text, required, key_of_scenario),
    a_number("from", "", any_number, InWords{"must be given without values"}, "a finite number, or values"),
    a_number("to", "", any_number, InWords{"must be given with from"}, "a finite number"),
    an_integer("count", 1, most_members, InWords{"must be given with from"}, "an integer >= 1"),
    another("values", numbers, none, list_of_numbers),
};

constexpr std::array<ScenarioKey, 2> ensemble_list = {
    another("key", text, required, key_of_scenario),
    another("values", numbers, required, list_of_numbers),
};

constexpr std::array<ScenarioKey, 5> ensemble_random = {
    another("key", text, required, key_of_scenario),
    a_number("from", "", any_number, InWords{"must be given without mean and deviation"},
             "a finite number, or mean and deviation"),
    a_number("to", "", any_number, InWords{"must be given with from"}, "a finite number"),
    a_number("mean", "", any_number, InWords{"must be given with deviation"}, "a finite number"),
    a_number("deviation", "", not_negative, InWords{"must be given with mean"}, "a finite number >= 0"),
};

constexpr std::array<std::string_view, 4> commands = {"simulate", "ensemble", "lyapunov", "linearize"};
constexpr Names all_commands = commands, of_rows = Names(commands).first(2), of_members = Names(commands).subspan(1, 1);

constexpr std::array<ScenarioTable, 18> tables_of_scenarios = {{
    {"", all_commands, document},
    {"chain", all_commands, chain},
    {"chain.end", all_commands, chain_end},
    {"chain.drive", all_commands, chain_drive},
    {"chain.feedback", of_rows, chain_feedback},
    {"chain.signal", all_commands, chain_signal},
    {"system", all_commands, system},
    {"system.drive", all_commands, system_drive},
    {"system.feedback", all_commands, system_feedback},
    {"system.signal", all_commands, system_signal},
    {"start", all_commands, start},
    {"run", all_commands, run},
    {"output", of_rows, output},
    {"event", of_rows, event},
    {"ensemble", of_members, ensemble},
    {"ensemble.axis", of_members, ensemble_axis},
    {"ensemble.random", of_members, ensemble_random},
    {"ensemble.list", of_members, ensemble_list},
}};

std::vector<std::string> dotted_names() {
  std::vector<std::string> names;
  for (const ScenarioTable& table : scenario_tables()) {
    for (const ScenarioKey& key : table.keys) {
      if (!table.name.empty()) names.push_back(std::string(table.name) + "." + std::string(key.name));
    }
  }
  return names;
}

std::string alternatives(Names names) {
  std::string text;
  for (const std::string_view name : names) text.append(text.empty() ? "\"" : "\" | \"").append(name);
  return text + '"';
}

/// "number > 0".
std::string bounded(const ScenarioKey& key) {
  if (key.bound.least == any_number.least) return "number";
  return (key.bound.is_excluded ? "number > " : "number >= ") + shortest(key.bound.least);
}

/// Writes a number as a float, 10.0.
std::string with_point(double value) {
  const std::string text = shortest(value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <class... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

}  // namespace

std::span<const ScenarioTable> scenario_tables() {
  return tables_of_scenarios;
}

const ScenarioTable& table_named(std::string_view name) {
  return *std::ranges::find(tables_of_scenarios, name, &ScenarioTable::name);
}

std::string without_elements(std::string_view key) {
  std::string name;
  int depth = 0;  // depth of brackets
  for (const char c : key) {
    depth += c == '[' ? 1 : 0;
    if (depth == 0) name += c;
    depth -= c == ']' ? 1 : 0;
  }
  return name;
}

const ScenarioKey* find_key(std::string_view key) {
  const std::string name = without_elements(key);
  const std::size_t dot = name.rfind('.');
  const std::string_view in = dot == std::string::npos ? "" : std::string_view(name).substr(0, dot);
  const auto table = std::ranges::find(tables_of_scenarios, in, &ScenarioTable::name);
  if (table == tables_of_scenarios.end()) return nullptr;
  const auto found = std::ranges::find(table->keys, name.substr(dot + 1), &ScenarioKey::name);
  return found == table->keys.end() ? nullptr : &*found;
}

std::span<const std::string_view> all_keys() {
  static const std::vector<std::string> names = dotted_names();
  static const std::vector<std::string_view> views(names.begin(), names.end());
  return views;
}

bool takes_numbers(const ScenarioKey& key) {
  return key.type == number || key.type == integer || key.type == per_link || key.type == torque || key.type == numbers;
}

std::string default_text(const ScenarioKey& key) {
  return std::visit(
      Overloaded{[](Required) { return std::string(); }, [](InWords words) { return std::string(words.text); },
                 [](double value) { return with_point(value); },
                 [](std::int64_t value) { return std::to_string(value); },
                 [](bool value) { return std::string(value ? "true" : "false"); },
                 [](std::string_view value) { return '"' + std::string(value) + '"'; }},
      key.otherwise);
}

std::string type_text(const ScenarioKey& key) {
  switch (key.type) {
    case number:
      return bounded(key);
    case integer:
      return key.most < most_members ? "integer from " + std::to_string(key.least) + " to " + std::to_string(key.most)
                                     : "integer >= " + std::to_string(key.least);
    case truth:
      return "true | false";
    case text:
      return "string";
    case choice:
      return alternatives(key.choices);
    case per_link:
      return bounded(key) + ", or an array of one a link";
    case torque:
      return "number, in space [x, y, z]";
    case numbers:
      return "array of numbers";
    case texts:
      return "array of strings";
    case columns:
      return "table of expressions by name";
    case names:
      return "table of numbers by name";
    case table:
      return "table";
    case tables:
      break;
  }
  return "array of tables";
}

}  // namespace pendula::io
