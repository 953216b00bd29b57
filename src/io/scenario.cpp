#include "io/scenario.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/chain/momenta.hpp>
#include <pendula/numeric/number_text.hpp>
#include <stdexcept>
#include <utility>

#include "io/end_reader.hpp"
#include "io/section.hpp"
#include "io/system_reader.hpp"

namespace pendula::io {
namespace {

using Names = std::span<const std::string_view>;

constexpr std::array<std::string_view, 2> angle_keys = {"theta", "phi"};
constexpr std::array<std::string_view, 2> rate_keys = {"theta_dot", "phi_dot"};
constexpr std::array<std::string_view, 2> momentum_keys = {"p_theta", "p_phi"};

/// The tables of a document that every scenario has.
struct RunSections {
  explicit RunSections(const toml::table& document) : root(document), run(root, "run"), output(root, "output") {}

  void measure_in(const BaseUnits& base) {
    for (Section* section : {&root, &run, &output}) section->measure_in(base);
  }

  Section root, run, output;
};

/// The tables of a chain's document.
struct Sections : RunSections {
  explicit Sections(const toml::table& document) : RunSections(document), chain(root, "chain"), start(root, "start") {}

  void measure_in(const BaseUnits& base) {
    RunSections::measure_in(base);
    for (Section* section : {&chain, &start}) section->measure_in(base);
  }

  Section chain, start;
};

/// Whether an array has one element a link; in space a torque [x, y, z] is one vector for all.
template <class Space>
bool tells_links(const Entry& entry) {
  if (Space::torque_components == 1 || entry.name() != "chain.torque") return entry.is_array();
  return entry.is_array() && (entry.size() == 0 || entry.element(0).is_array());
}

/// Number of links: from the key `links`, or else from the first array.
template <class Space>
LinkCount link_count(const Sections& sections) {
  if (const auto entry = sections.chain.find("links")) {
    return {static_cast<int>(entry->integer()), entry->name(), entry->place()};
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
    return {static_cast<int>(entry->size()), entry->name(), entry->place()};
  }
  sections.chain.require("links");
  return {};
}

/// Keys without a default come first, so that a file that lacks one is not told about the number of links.
void require_keys(const Sections& sections) {
  sections.chain.require("masses");
  sections.chain.require("lengths");
  if (!hangs(sections.start)) sections.start.require("theta");
}

/// Constant torque on each link: in the plane a number, in space a vector, or one of them for all links.
template <class Space>
Torque<Space, Eigen::Dynamic> constant_torque(const Section& chain, const LinkCount& count) {
  Torque<Space, Eigen::Dynamic> torque(Space::torque_components, count.links);
  const std::optional<Entry> entry = chain.find("torque");
  if constexpr (Space::torque_components == 1) {
    torque = chain.per_link("torque", count).transpose();
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
  drive.link = static_cast<int>(table.require("link").integer(1, count.links)) - 1;
  const Entry amplitude = table.require("amplitude");
  if constexpr (Space::torque_components == 1) {
    drive.amplitude[0] = amplitude.number();
  } else {
    drive.amplitude = amplitude.vector(3);
  }
  drive.frequency = table.require("frequency").number();
  drive.phase = table.number("phase");
  return drive;
}

template <class Space>
ChainParameters<Space> read_chain(const Section& chain, const LinkCount& count) {
  ChainParameters<Space> parameters;
  parameters.masses = chain.per_link("masses", count);
  parameters.lengths = chain.per_link("lengths", count);
  parameters.gravity = chain.number("gravity");
  parameters.damping = chain.per_link("damping", count);
  parameters.torque = constant_torque<Space>(chain, count);
  return parameters;
}

std::optional<Entry> natural_requested(const Section& chain) {
  return chain.choice("units") == 1 ? chain.find("units") : std::nullopt;
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
Coordinates<Space, Eigen::Dynamic> read_coordinates(const Section& start, Names keys, const LinkCount& count) {
  Coordinates<Space, Eigen::Dynamic> values(Space::dof * count.links);
  for (int a = 0; a < Space::dof; ++a) {
    values.segment(a * count.links, count.links) = start.per_link(keys[static_cast<std::size_t>(a)], count);
  }
  return values;
}

/// The first of `keys` that [start] has.
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
  if (const auto rate = first_of(start, rate_keys)) rate->fail("no rates beside the momenta " + given.name());
  const auto p = read_coordinates<Space>(start, momentum_keys, count);
  try {
    return pendula::rates_from_momenta(chain, q, p);
  } catch (const std::invalid_argument& error) {
    throw InputError(start.find("p_phi")->place() + ": " + error.what());
  }
}

template <class Space>
State<Space> read_start(const Section& start, const LinkCount& count, const Chain<Space>& chain) {
  if (Space::dof == 1) {
    constexpr std::array<std::string_view, 3> spatial_keys = {"phi", "phi_dot", "p_phi"};
    if (const auto entry = first_of(start, spatial_keys)) entry->fail("no such key in a planar scenario");
  }
  const Coordinates<Space, Eigen::Dynamic> q = read_coordinates<Space>(start, angle_keys, count);
  if (first_of(start, momentum_keys)) return {0, q, rates_from_momenta(start, count, chain, q)};
  return {0, q, read_coordinates<Space>(start, rate_keys, count)};
}

/// Names each key once.
std::vector<std::string> degree_warnings(const Section& start) {
  std::vector<std::string> warnings;
  for (const std::string_view key : angle_keys) {
    const std::optional<Entry> entry = start.find(key);
    const std::optional<std::string> warning = entry ? warning_of_degrees(*entry) : std::nullopt;
    if (warning) warnings.push_back(*warning);
  }
  return warnings;
}

/// Whether the method is "auto", the last of the names, in words or because nothing of [run] is for one method.
bool chooses_method(const Section& run) {
  if (run.find("step") || run.choice("method") != names_of<Method>.size()) return false;
  constexpr std::array<std::string_view, 4> of_gauss = {"stages", "form", "solver", "iteration"};
  return run.find("method") || std::ranges::none_of(of_gauss, [&](auto key) { return run.find(key).has_value(); });
}

RunOptions read_run(const Section& run) {
  RunOptions options;
  if (run.choice("method") != names_of<Method>.size()) options.method = run.option<Method>("method");
  const auto stages = run.find("stages"), step = run.find("step");
  if (stages) {
    options.stages = static_cast<int>(options.method == Method::radau ? stages->integer(2, 3) : stages->integer());
  }
  options.form = run.option<Form>("form");
  options.solver = run.option<Solver>("solver");
  options.iteration = run.option<Iteration>("iteration");
  options.tolerance = run.number("tolerance");
  if (step) options.step = step->number();
  if (!is_explicit(options.method) && !step) {
    options.step = 0;
    if (!stages) options.stages = stages_for(options.method, options.tolerance);
  }
  return options;
}

/// The accuracy, or a default if nothing says how long steps are. Throws InputError if there is a tolerance, too, which
/// would follow from it.
Accuracy read_accuracy(const Section& run, const RunOptions& options) {
  const auto accuracy = run.find("accuracy");
  if (accuracy && run.find("tolerance")) accuracy->fail("nothing beside run.tolerance, which follows from it");
  const bool is_asked = !is_explicit(options.method) && !run.find("step") && !run.find("tolerance");
  const double otherwise = is_asked ? options.tolerance : 0;
  return {accuracy ? accuracy->number() : otherwise, !run.find("stages").has_value()};
}

double read_duration(const Section& run, const RunOptions& options) {
  const double duration = run.number("duration");
  if (is_adaptive(options) || duration / options.step <= max_steps) return duration;
  const std::string expected = "a step of at least " + shortest(duration / max_steps) + " for this duration";
  const std::optional<Entry> step = run.find("step");
  (step ? *step : *run.find("duration")).fail(expected);
}

/// Warns of keys of [run] that the method does not use. They are no errors, since a scenario may keep the settings of
/// several methods.
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

/// Reads the times of [output].
RowTimes read_row_times(const Section& section, double duration) {
  const auto interval = section.find("interval"), listed = section.find("times");
  if (interval && listed) listed->fail("nothing beside output.interval");
  RowTimes rows;
  if (interval) rows.interval = interval->number();
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

/// Time between rows where nothing says: a round number that gives some hundreds of them, or a hundred a unit of time
/// as long as these are a few thousand. 0 for a run that takes no time.
double usual_interval(double duration) {
  const double least = duration / std::clamp(100 * duration, 1000.0, 5000.0);
  const double power = std::floor(std::log10(least)), whole = std::pow(10, std::abs(power));
  for (const double digit : {1, 2, 5, 10}) {
    const double round = power < 0 ? digit / whole : digit * whole;  // exactly what is written so
    if (round >= least * (1 - 1e-9) && std::isnormal(round)) return round;
  }
  return 0;
}

/// Chooses rows for a plan that has none: evenly in time, and where steps are constant at their ends.
void choose_rows(RunPlan& plan) {
  plan.rows.chosen = true;
  const double interval = usual_interval(plan.duration);
  if (is_adaptive(plan.options)) {
    plan.rows.interval = interval;
  } else {
    plan.every = static_cast<std::int64_t>(std::max(1.0, std::floor(interval / plan.options.step * (1 + 1e-9))));
  }
}

/// Reads [run] and [output].
void read_plan(const RunSections& sections, RunPlan& plan) {
  plan.options = read_run(sections.run);
  plan.chooses_method = chooses_method(sections.run);
  plan.accuracy = read_accuracy(sections.run, plan.options);
  plan.duration = read_duration(sections.run, plan.options);
  plan.estimate = sections.run.truth("estimate");
  const std::vector<std::string> unused = unused_keys(sections.run, plan.options);
  plan.warnings.insert(plan.warnings.end(), unused.begin(), unused.end());
  const auto every = sections.output.find("every");
  plan.every = every ? every->integer() : 1;
  plan.rows = read_row_times(sections.output, plan.duration);
  if (!every && !plan.rows.any()) choose_rows(plan);
  if (every && plan.rows.any()) plan.warnings.push_back(every->place() + ": has no effect where rows are at times");
  plan.events = read_events(sections.root);
  for (ColumnPlan& column : read_columns(sections.output)) plan.columns.push_back(std::move(column));
  if (!plan.feedback.empty()) plan.places["feedback"] = plan.feedback.front().place;
  plan.checkpoint = sections.output.number("checkpoint");
  for (const ScenarioKey& key : table_named("run").keys) {
    if (const auto entry = sections.run.find(key.name)) plan.places[std::string(key.name)] = entry->place();
  }
}

template <class Space>
Scenario<Space> read(Sections& sections, const std::filesystem::path& folder) {
  require_keys(sections);
  const LinkCount count = link_count<Space>(sections);
  ChainParameters<Space> parameters = read_chain<Space>(sections.chain, count);
  const std::optional<NaturalUnits> natural = make_natural(sections.chain, parameters);
  if (natural) sections.measure_in({natural->mass, natural->length, natural->time});
  for (const Section& table : sections.chain.each("drive")) {
    parameters.drives.push_back(read_drive<Space>(table, count));
  }
  parameters.end = read_end<Space>(sections.chain);
  const Chain<Space> chain = build_chain(sections.chain, std::move(parameters));
  Scenario<Space> scenario(chain, read_start(sections.start, count, chain));
  scenario.feedback = read_feedback(sections.chain);
  scenario.signals = read_signals(sections.chain, folder);
  read_plan(sections, scenario);
  close_start(sections.chain, sections.start, scenario);
  scenario.natural = natural;
  for (std::string& warning : degree_warnings(sections.start)) scenario.warnings.push_back(std::move(warning));
  scenario.places["links"] = count.place;
  return scenario;
}

}  // namespace

AnyScenario read_document(const toml::table& document, std::string_view name, const FindSystem& find) {
  const std::filesystem::path folder = std::filesystem::path(name).parent_path();
  if (document.contains("system")) {
    const RunSections sections(document);
    SystemScenario scenario = read_system(sections.root, folder, find);
    read_plan(sections, scenario);
    return scenario;
  }
  Sections sections(document);
  if (!document.contains("chain")) throw InputError(std::string(name) + ": expected [chain] or [system], got neither");
  if (sections.chain.require("space").choice() == 0) return read<Planar>(sections, folder);
  return read<Spatial>(sections, folder);
}

AnyScenario parse_scenario(std::string_view text, std::string_view name, std::span<const std::string> overrides,
                           const FindSystem& find) {
  return read_document(parse_toml(text, name, overrides), name, find);
}

AnyScenario read_scenario(const std::filesystem::path& file, std::span<const std::string> overrides,
                          const FindSystem& find) {
  const ScenarioText scenario = read_scenario_text(file);
  return parse_scenario(scenario.text, scenario.name, overrides, find);
}

}  // namespace pendula::io
