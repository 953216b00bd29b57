#include "io/scenario.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <iostream>
#include <limits>
#include <pendula/chain/momenta.hpp>
#include <pendula/numeric/number_text.hpp>
#include <stdexcept>
#include <utility>

#include "io/system_reader.hpp"
#include "io/toml_reader.hpp"

namespace pendula::io {
namespace {

using Names = std::span<const std::string_view>;

constexpr std::array<std::string_view, 7> section_names = {"chain",  "system", "start",   "run",
                                                           "output", "event",  "ensemble"};
constexpr std::array<std::string_view, 9> chain_keys = {"space",   "links",  "masses", "lengths", "gravity",
                                                        "damping", "torque", "units",  "drive"};
constexpr std::array<std::string_view, 4> drive_keys = {"link", "amplitude", "frequency", "phase"};
constexpr std::array<std::string_view, 2> angle_keys = {"theta", "phi"};
constexpr std::array<std::string_view, 2> rate_keys = {"theta_dot", "phi_dot"};
constexpr std::array<std::string_view, 2> momentum_keys = {"p_theta", "p_phi"};
constexpr std::array<std::string_view, 6> start_keys = {"theta", "phi", "theta_dot", "phi_dot", "p_theta", "p_phi"};
constexpr std::array<std::string_view, 10> run_keys = {"method", "stages",    "form",     "solver",   "iteration",
                                                       "step",   "tolerance", "accuracy", "duration", "estimate"};
constexpr std::array<std::string_view, 4> output_keys = {"every", "interval", "times", "checkpoint"};

/// Where each key belongs, to tell those who put it elsewhere.
constexpr std::array<std::string_view, 50> all_keys = {"chain.space",
                                                       "chain.links",
                                                       "chain.masses",
                                                       "chain.lengths",
                                                       "chain.gravity",
                                                       "chain.damping",
                                                       "chain.torque",
                                                       "chain.units",
                                                       "chain.drive",
                                                       "chain.drive.link",
                                                       "chain.drive.amplitude",
                                                       "chain.drive.frequency",
                                                       "chain.drive.phase",
                                                       "system.model",
                                                       "system.links",
                                                       "system.parameters",
                                                       "system.drive",
                                                       "system.drive.input",
                                                       "system.drive.constant",
                                                       "system.drive.amplitude",
                                                       "system.drive.frequency",
                                                       "start.theta",
                                                       "start.phi",
                                                       "start.theta_dot",
                                                       "start.phi_dot",
                                                       "start.p_theta",
                                                       "start.p_phi",
                                                       "run.method",
                                                       "run.stages",
                                                       "run.form",
                                                       "run.solver",
                                                       "run.iteration",
                                                       "run.step",
                                                       "run.tolerance",
                                                       "run.accuracy",
                                                       "run.duration",
                                                       "run.estimate",
                                                       "output.every",
                                                       "output.interval",
                                                       "output.times",
                                                       "output.checkpoint",
                                                       "event.name",
                                                       "event.when",
                                                       "event.direction",
                                                       "event.stop",
                                                       "ensemble.axis",
                                                       "ensemble.random",
                                                       "ensemble.count",
                                                       "ensemble.seed",
                                                       "ensemble.keep"};

constexpr std::array<std::string_view, 2> space_names = {Planar::name, Spatial::name};
constexpr std::array<std::string_view, 2> unit_systems = {"SI", "natural"};

/// The sections of a document that every scenario has, each with known keys only.
struct RunSections {
  explicit RunSections(const toml::table& document)
      : root(Entry(document, ""), section_names, all_keys),
        run(root, "run", run_keys, all_keys),
        output(root, "output", output_keys, all_keys) {}

  Section root, run, output;
};

/// The same of a chain.
struct Sections : RunSections {
  explicit Sections(const toml::table& document)
      : RunSections(document), chain(root, "chain", chain_keys, all_keys), start(root, "start", start_keys, all_keys) {}

  Section chain, start;
};

double number(const Section& section, std::string_view key, double otherwise, Sign sign = Sign::any) {
  const std::optional<Entry> entry = section.find(key);
  return entry ? entry->number(sign) : otherwise;
}

/// An option's value by its name.
template <class Option>
Option choice(const Section& section, std::string_view key, Option otherwise) {
  const std::optional<Entry> entry = section.find(key);
  return entry ? static_cast<Option>(entry->choice(names_of<Option>)) : otherwise;
}

/// Whether an array has one element a link; in space a torque [x, y, z] is one vector for all.
template <class Space>
bool tells_links(const Entry& entry) {
  if (Space::torque_components == 1 || entry.key() != "chain.torque") return entry.is_array();
  return entry.is_array() && (entry.size() == 0 || entry.element(0).is_array());
}

/// Number of links: from the key `links`, or else from the first array.
template <class Space>
LinkCount link_count(const Sections& sections) {
  if (const auto entry = sections.chain.find("links")) {
    return {static_cast<int>(entry->integer(1, max_links)), entry->key(), entry->place()};
  }
  const std::array<std::pair<const Section*, std::string_view>, 10> arrays = {{
      {&sections.chain, "masses"},
      {&sections.chain, "lengths"},
      {&sections.chain, "damping"},
      {&sections.chain, "torque"},
      {&sections.start, "theta"},
      {&sections.start, "phi"},
      {&sections.start, "theta_dot"},
      {&sections.start, "phi_dot"},
      {&sections.start, "p_theta"},
      {&sections.start, "p_phi"},
  }};
  for (const auto& [section, key] : arrays) {
    const std::optional<Entry> entry = section->find(key);
    if (!entry || !tells_links<Space>(*entry)) continue;
    if (entry->size() == 0) entry->fail("at least one link");
    if (entry->size() > max_links) entry->fail("at most " + std::to_string(max_links) + " links");
    return {static_cast<int>(entry->size()), entry->key(), entry->place()};
  }
  sections.chain.require("links", "a number of links, which no array tells");
  return {};
}

/// Keys without a default come first, so that a file that lacks one is not told about the number of links.
void require_keys(const Sections& sections) {
  sections.chain.require("masses", "the masses of the bobs");
  sections.chain.require("lengths", "the lengths of the rods");
  sections.start.require("theta", "the angles at the start");
}

/// One number a link, or `otherwise` for all where the key is not there.
Eigen::VectorXd per_link(const Section& section, std::string_view key, const LinkCount& count, double otherwise,
                         Sign sign = Sign::any, Units units = {}) {
  const std::optional<Entry> entry = section.find(key);
  return entry ? entry->per_link(count, sign, units) : Eigen::VectorXd::Constant(count.links, otherwise);
}

/// Constant torque on each link: in the plane a number, in space a vector, or one of them for all links.
template <class Space>
Torque<Space, Eigen::Dynamic> constant_torque(const Section& chain, const LinkCount& count) {
  Torque<Space, Eigen::Dynamic> torque(Space::torque_components, count.links);
  const std::optional<Entry> entry = chain.find("torque");
  if constexpr (Space::torque_components == 1) {
    torque = per_link(chain, "torque", count, 0).transpose();
  } else if (!entry || (entry->is_number() && entry->number() == 0)) {
    torque.setZero();
  } else if (entry->is_array() && !tells_links<Space>(*entry)) {
    torque.colwise() = Eigen::Vector3d(entry->vector(3));
  } else if (entry->size() == static_cast<std::size_t>(count.links)) {
    for (Eigen::Index i = 0; i < torque.cols(); ++i) {
      torque.col(i) = entry->element(static_cast<std::size_t>(i)).vector(3);
    }
  } else {
    entry->fail("0, one vector [x, y, z] for all links, or " + std::to_string(count.links) + " of them");
  }
  return torque;
}

template <class Space>
Drive<Space> read_drive(const Section& table, const LinkCount& count) {
  Drive<Space> drive;
  drive.link = static_cast<int>(
                   table.require("link", "a link from 1 to " + std::to_string(count.links)).integer(1, count.links)) -
               1;
  if constexpr (Space::torque_components == 1) {
    drive.amplitude[0] = table.require("amplitude", "a torque").number();
  } else {
    drive.amplitude = table.require("amplitude", "a torque [x, y, z]").vector(3);
  }
  drive.frequency = table.require("frequency", "an angular frequency").number();
  drive.phase = number(table, "phase", drive.phase);
  return drive;
}

template <class Space>
std::vector<Drive<Space>> read_drives(const Section& chain, const LinkCount& count) {
  std::vector<Drive<Space>> drives;
  const std::optional<Entry> entry = chain.find("drive");
  if (!entry) return drives;
  if (!entry->is_array()) entry->fail("[[chain.drive]] tables");
  for (std::size_t i = 0; i < entry->size(); ++i) {
    drives.push_back(read_drive<Space>(Section(entry->element(i), drive_keys), count));
  }
  return drives;
}

template <class Space>
ChainParameters<Space> read_chain(const Section& chain, const LinkCount& count) {
  ChainParameters<Space> parameters;
  parameters.masses = chain.find("masses")->per_link(count, Sign::positive);
  parameters.lengths = chain.find("lengths")->per_link(count, Sign::positive);
  parameters.gravity = number(chain, "gravity", parameters.gravity);
  parameters.damping = per_link(chain, "damping", count, 0, Sign::not_negative);
  parameters.torque = constant_torque<Space>(chain, count);
  parameters.drives = read_drives<Space>(chain, count);
  return parameters;
}

std::optional<Entry> natural_requested(const Section& chain) {
  const std::optional<Entry> units = chain.find("units");
  return units && units->choice(unit_systems) == 1 ? units : std::nullopt;
}

/// Passes to natural units where the scenario asks for them.
template <class Space>
std::optional<NaturalUnits> make_natural(const Section& chain, ChainParameters<Space>& parameters) {
  const std::optional<Entry> requested = natural_requested(chain);
  if (!requested) return std::nullopt;
  if (parameters.gravity <= 0) {
    const std::optional<Entry> gravity = chain.find("gravity");
    (gravity ? *gravity : *requested).fail("a number > 0, which natural units need");
  }
  const NaturalUnits units = natural_units(parameters);
  if (!std::isnormal(units.energy()) || !std::isnormal(units.damping())) {
    requested->fail("masses, lengths and gravity whose natural units a double can hold");
  }
  parameters = in_units(units, std::move(parameters));
  return units;
}

/// One number a link of each coordinate, (dof·n); 0 where a key is not there.
template <class Space>
Coordinates<Space, Eigen::Dynamic> read_coordinates(const Section& start, Names keys, const LinkCount& count,
                                                    Units units) {
  Coordinates<Space, Eigen::Dynamic> values(Space::dof * count.links);
  for (int a = 0; a < Space::dof; ++a) {
    values.segment(a * count.links, count.links) =
        per_link(start, keys[static_cast<std::size_t>(a)], count, 0, Sign::any, units);
  }
  return values;
}

/// The first key of [start] out of `keys` that is there.
std::optional<Entry> first_of(const Section& start, Names keys) {
  for (const std::string_view key : keys) {
    if (std::optional<Entry> entry = start.find(key)) return entry;
  }
  return std::nullopt;
}

/// The rates that go with the momenta in [start].
template <class Space>
Coordinates<Space, Eigen::Dynamic> rates_from_momenta(const Section& start, const LinkCount& count,
                                                      const Chain<Space>& chain,
                                                      const Coordinates<Space, Eigen::Dynamic>& q) {
  const Entry given = *first_of(start, momentum_keys);
  if (const auto rate = first_of(start, rate_keys)) rate->fail("no rates beside the momenta " + given.key());
  const auto p = read_coordinates<Space>(start, momentum_keys, count, {});
  try {
    return pendula::rates_from_momenta(chain, q, p);
  } catch (const std::invalid_argument& error) {
    throw InputError(start.find("p_phi")->place() + ": " + error.what());
  }
}

/// time_unit  what rates without a unit are in  [s]
template <class Space>
State<Space> read_start(const Section& start, const LinkCount& count, const Chain<Space>& chain, double time_unit) {
  if (Space::dof == 1) {
    constexpr std::array<std::string_view, 3> spatial_keys = {"phi", "phi_dot", "p_phi"};
    if (const auto entry = first_of(start, spatial_keys)) entry->fail("no such key in a planar scenario");
  }
  const std::array<Unit, 2> angles = {{{"rad", 1}, {"deg", degree}}};
  const std::array<Unit, 2> rates = {{{"rad/s", time_unit}, {"deg/s", degree * time_unit}}};
  const auto q = read_coordinates<Space>(start, angle_keys, count, angles);
  if (first_of(start, momentum_keys)) return {0, q, rates_from_momenta(start, count, chain, q)};
  return {0, q, read_coordinates<Space>(start, rate_keys, count, rates)};
}

/// Of each key once.
std::vector<std::string> degree_warnings(const Section& start) {
  std::vector<std::string> warnings;
  for (const std::string_view key : angle_keys) {
    const std::optional<Entry> entry = start.find(key);
    const std::optional<std::string> warning = entry ? warning_of_degrees(*entry) : std::nullopt;
    if (warning) warnings.push_back(*warning);
  }
  return warnings;
}

/// An error that something is asked for: no method tells smaller ones from rounding.
double error_number(const Section& run, std::string_view key, double otherwise) {
  constexpr double finest = 1e-16;
  const double error = number(run, key, otherwise, Sign::positive);
  if (error < finest && error != otherwise) run.find(key)->fail("a number of at least " + shortest(finest));
  return error;
}

RunOptions read_run(const Section& run) {
  RunOptions options;
  options.method = choice(run, "method", options.method);
  const auto stages = run.find("stages");
  if (stages) {
    options.stages = static_cast<int>(options.method == Method::radau ? stages->integer(2, 3) : stages->integer(1, 8));
  }
  options.form = choice(run, "form", options.form);
  options.solver = choice(run, "solver", options.solver);
  options.iteration = choice(run, "iteration", options.iteration);
  options.step = number(run, "step", options.step, Sign::positive);
  options.tolerance = error_number(run, "tolerance", options.tolerance);
  if (!is_explicit(options.method) && !run.find("step")) {
    options.step = 0;
    if (!stages) options.stages = stages_for(options.method, options.tolerance);
  }
  return options;
}

/// Of the program's own choice where nothing says how long steps are. Throws InputError beside a tolerance, which
/// follows from it.
Accuracy read_accuracy(const Section& run, const RunOptions& options) {
  const auto accuracy = run.find("accuracy");
  if (accuracy && run.find("tolerance")) accuracy->fail("nothing beside run.tolerance, which follows from it");
  const bool is_asked = !is_explicit(options.method) && !run.find("step") && !run.find("tolerance");
  return {error_number(run, "accuracy", is_asked ? options.tolerance : 0), !run.find("stages").has_value()};
}

double read_duration(const Section& run, const RunOptions& options) {
  const double duration = number(run, "duration", 10, Sign::not_negative);
  if (is_adaptive(options) || duration / options.step <= max_steps) return duration;
  const std::string expected = "a step of at least " + shortest(duration / max_steps) + " for this duration";
  const std::optional<Entry> step = run.find("step");
  (step ? *step : *run.find("duration")).fail(expected);
}

/// Keys of [run] that are there and mean nothing to the method: a warning, since a scenario may keep the settings of
/// several methods side by side.
std::vector<std::string> unused_keys(const Section& run, const RunOptions& options) {
  const Method method = options.method;
  std::vector<std::string> warnings;
  const auto check = [&](std::string_view key, bool used) {
    const std::optional<Entry> entry = run.find(key);
    if (!entry || used) return;
    const bool steps_are_given = (key == "tolerance" || key == "accuracy") && !is_explicit(method);
    warnings.push_back(entry->place() + ": has no effect with " +
                       (steps_are_given ? "run.step" : "method " + std::string(name_of(method))));
  };
  for (const std::string_view key : {"stages", "form", "solver", "iteration"}) check(key, !is_explicit(method));
  check("step", !is_adaptive(method));
  check("tolerance", is_adaptive(options));
  check("accuracy", is_adaptive(options));
  return warnings;
}

template <class Space>
Chain<Space> build_chain(const Section& section, ChainParameters<Space> parameters) {
  try {
    return Chain<Space>(std::move(parameters));
  } catch (const std::invalid_argument& error) {
    throw InputError(section.where() + ": " + error.what());
  }
}

/// Times of [output].
RowTimes read_row_times(const Section& section, double duration) {
  const auto interval = section.find("interval"), listed = section.find("times");
  if (interval && listed) listed->fail("nothing beside output.interval");
  RowTimes rows;
  rows.interval = number(section, "interval", 0, Sign::positive);
  if (rows.interval > 0 && duration / rows.interval > max_steps) {
    interval->fail("an interval that time can tell, at least " + shortest(duration / max_steps));
  }
  if (!listed) return rows;
  if (listed->size() == 0) listed->fail("times in s, one at least");
  for (std::size_t k = 0; k < listed->size(); ++k) {
    const double time = listed->element(k).number();
    const double least = k == 0 ? 0 : rows.times.back();
    if (!(time >= least) || time > duration || (k > 0 && time == least)) {
      listed->element(k).fail("a time after the one before it, from 0 to run.duration");
    }
    rows.times.push_back(time);
  }
  return rows;
}

/// What [run] and [output] say.
void read_plan(const RunSections& sections, RunPlan& plan) {
  plan.run = read_run(sections.run);
  plan.accuracy = read_accuracy(sections.run, plan.run);
  plan.duration = read_duration(sections.run, plan.run);
  if (const auto estimate = sections.run.find("estimate")) plan.estimate = estimate->truth();
  const std::vector<std::string> unused = unused_keys(sections.run, plan.run);
  plan.warnings.insert(plan.warnings.end(), unused.begin(), unused.end());
  const auto every = sections.output.find("every");
  if (is_adaptive(plan.run)) plan.every = 1;
  if (every) plan.every = every->integer(1, std::numeric_limits<std::int64_t>::max());
  plan.rows = read_row_times(sections.output, plan.duration);
  if (every && plan.rows.any()) plan.warnings.push_back(every->place() + ": has no effect where rows are at times");
  plan.events = read_events(sections.root);
  plan.checkpoint = number(sections.output, "checkpoint", plan.checkpoint, Sign::positive);
  for (const std::string_view key : run_keys) {
    if (const auto entry = sections.run.find(key)) plan.places[std::string(key)] = entry->place();
  }
}

template <class Space>
Scenario<Space> read(const Sections& sections) {
  require_keys(sections);
  const LinkCount count = link_count<Space>(sections);
  ChainParameters<Space> parameters = read_chain<Space>(sections.chain, count);
  const std::optional<NaturalUnits> natural = make_natural(sections.chain, parameters);
  const Chain<Space> chain = build_chain(sections.chain, std::move(parameters));
  Scenario<Space> scenario(chain, read_start(sections.start, count, chain, natural ? natural->time : 1));
  read_plan(sections, scenario);
  scenario.natural = natural;
  for (std::string& warning : degree_warnings(sections.start)) scenario.warnings.push_back(std::move(warning));
  scenario.places["links"] = count.place;
  return scenario;
}

/// Longest scenario that is read: ten numbers for each of `max_links` fit in, a device that never ends does not.
constexpr std::size_t max_text = std::size_t{256} << 20;

[[noreturn]] void reject_file(const std::string& name, const std::string& why) {
  throw InputError(name + ": expected a scenario file that can be read, got: " + why);
}

std::string read_stream(std::istream& stream, const std::string& name) {
  std::string text;
  std::vector<char> block(std::size_t{1} << 16);
  do {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_text) reject_file(name, "more than " + std::to_string(max_text >> 20) + " MiB");
  } while (stream);
  if (stream.bad()) reject_file(name, "a read error");
  return text;
}

std::string read_text(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) reject_file(file.string(), "a folder");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) reject_file(file.string(), std::strerror(errno));
  return read_stream(stream, file.string());
}

AnyScenario read_document(const toml::table& document, std::string_view name, const FindSystem& find) {
  if (document.contains("system")) {
    const std::filesystem::path folder = std::filesystem::path(name).parent_path();
    const RunSections sections(document);
    SystemScenario scenario = read_system(sections.root, folder, find);
    read_plan(sections, scenario);
    return scenario;
  }
  const Sections sections(document);
  const Entry space = sections.chain.require("space", "\"planar\" or \"spatial\"");
  if (space.choice(space_names) == 0) return read<Planar>(sections);
  return read<Spatial>(sections);
}

}  // namespace

AnyScenario parse_scenario(std::string_view text, std::string_view name, std::span<const std::string> overrides,
                           const FindSystem& find) {
  return read_document(parse_toml(text, name, overrides), name, find);
}

struct ScenarioDocument::Document {
  std::string name;
  toml::table root;
};

ScenarioDocument::ScenarioDocument(std::string_view text, std::string_view name, std::span<const std::string> overrides)
    : document_(std::make_unique<const Document>(Document{std::string(name), parse_toml(text, name, overrides)})) {}

ScenarioDocument::~ScenarioDocument() = default;

AnyScenario ScenarioDocument::with(std::span<const std::string> keys, std::span<const double> numbers,
                                   const FindSystem& find) const {
  toml::table changed = document_->root;
  for (std::size_t k = 0; k < keys.size(); ++k) set_number(changed, keys[k], numbers[k]);
  return read_document(changed, document_->name, find);
}

ScenarioText read_scenario_text(const std::filesystem::path& file) {
  const std::string standard_input = "standard input";
  if (file == "-") return {standard_input, read_stream(std::cin, standard_input)};
  return {file.string(), read_text(file)};
}

AnyScenario read_scenario(const std::filesystem::path& file, std::span<const std::string> overrides,
                          const FindSystem& find) {
  const ScenarioText scenario = read_scenario_text(file);
  return parse_scenario(scenario.text, scenario.name, overrides, find);
}

}  // namespace pendula::io
