#include "io/system_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/assembly.hpp>
#include <pendula/run/library.hpp>
#include <set>

#include "io/nearest_name.hpp"

namespace pendula::io {
namespace {

/// Names, separated by commas, for messages.
std::string listed(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text.empty() ? "none" : text;
}

/// The keys of system.parameters, without the parameters that the run sets: those that tell pieces of functions.
std::vector<ScenarioKey> parameter_keys(const SystemInfo& info) {
  std::vector<ScenarioKey> keys(info.own_parameters());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    keys[k].name = info.parameters[k];
    keys[k].unit = info.parameter_units[k];
    if (info.is_positive[k]) keys[k].bound = positive;
    if (std::isfinite(info.parameter_defaults[k])) keys[k].otherwise = info.parameter_defaults[k];
  }
  return keys;
}

/// Parameters by name, from the table or from the model's defaults.
std::vector<double> read_parameters(const Section& system, const SystemInfo& info) {
  const std::vector<ScenarioKey> keys = parameter_keys(info);
  const Section given(system, "parameters", keys);
  std::vector<double> numbers;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const int size = info.parameter_sizes[k];
    if (std::holds_alternative<Required>(keys[k].otherwise)) {
      given.require(keys[k].name, "a number [" + std::string(keys[k].unit) + "], which the model has no default for");
    }
    const Eigen::VectorXd each = info.is_per_link[k] ? given.per_link(keys[k].name, {size, "the model", system.where()})
                                                     : Eigen::VectorXd::Constant(size, given.number(keys[k].name));
    numbers.insert(numbers.end(), each.begin(), each.end());
  }
  return numbers;
}

void read_drive(const Section& table, const SystemInfo& info, SystemNumbers& numbers) {
  const bool has_numbers = table.find("constant") || table.find("amplitude");
  if (table.find("value") && !has_numbers) return;
  const Entry entry = table.require("input", "the name of an input of the model: " + listed(info.inputs));
  if (info.inputs.empty())
    entry.fail("no constant and no amplitude, since the model has no inputs, only motions by value");
  const std::size_t input = entry.choice(info.inputs);
  const std::string_view unit = info.input_units[input];
  numbers.inputs[input] += table.number("constant", unit);
  const double amplitude = table.number("amplitude", unit);
  if (amplitude == 0) return;
  numbers.sines.push_back(
      {static_cast<int>(input), amplitude, table.require("frequency").number(), table.number("phase")});
}

SystemNumbers read_numbers(const Section& system, const SystemInfo& info) {
  SystemNumbers numbers{read_parameters(system, info), std::vector<double>(info.inputs.size(), 0.0), {}};
  for (const Section& table : system.each("drive")) read_drive(table, info, numbers);
  return numbers;
}

/// A name without its index, theta for theta_1; empty if it has none.
std::string_view family(std::string_view name) {
  const std::size_t index = index_of(name).size();
  return index == 0 ? std::string_view() : name.substr(0, name.size() - index);
}

/// The keys of [start]: coordinates, rates and momenta by name, and theta for the array theta_1, theta_2, ….
class StartTable {
 public:
  StartTable(const Section& root, const SystemInfo& info) : info_(info) {
    std::set<std::string> known;
    for (const std::string_view coordinate : info.coordinates) {
      for (const std::string& stem : {std::string(coordinate), std::string(family(coordinate))}) {
        if (stem.empty()) continue;
        known.insert({stem, rate_name(stem), momentum_of(stem)});
      }
    }
    if (!info.constraints.empty()) known.insert(std::string(assemble_key));
    names_.assign(known.begin(), known.end());
    keys_.resize(names_.size());
    for (std::size_t k = 0; k < keys_.size(); ++k) keys_[k].name = names_[k];
    table_.emplace(root, "start", keys_);
  }

  /// The coordinates; those not given are 0.
  Eigen::VectorXd positions() const {
    return read([](std::string_view stem) { return std::string(stem); },
                [](std::string_view unit) { return std::string(unit); });
  }
  Eigen::VectorXd rates() const {
    return read(rate_name, [](std::string_view unit) { return rate_unit(unit); });
  }
  /// The momenta. Their units follow from that: a momentum times the rate of its coordinate is an energy.
  Eigen::VectorXd momenta() const {
    return read(momentum_of, [](std::string_view unit) { return "N m s/" + std::string(unit); });
  }

  std::optional<Entry> first_momentum() const { return first(momentum_of); }
  std::optional<Entry> first_rate() const { return first(rate_name); }
  const std::string& where() const { return table_->where(); }

  /// Which coordinates and rates constraints are met by: those that it lists, or else those that it does not give.
  FreeNumbers free() const {
    const std::size_t count = info_.coordinates.size();
    if (const std::optional<Entry> list = table_->find(assemble_key)) return listed_in(*list);
    FreeNumbers free{std::vector<bool>(count), std::vector<bool>(count)};
    for (std::size_t k = 0; k < count; ++k) {
      const std::string own(info_.coordinates[k]), stem(family(own));
      const auto is_given = [&](auto name) { return find(name, own) || (!stem.empty() && find(name, stem)); };
      free.coordinates[k] = !is_given([](std::string_view name) { return std::string(name); });
      free.rates[k] = !is_given([](std::string_view name) { return rate_name(name); }) && !first_momentum();
    }
    return free;
  }

  /// The entry of coordinate k: its own, or that of its array.
  std::optional<Entry> entry_of(std::size_t k) const {
    if (const auto own = table_->find(info_.coordinates[k])) return own;
    const std::string_view stem = family(info_.coordinates[k]);
    return stem.empty() ? std::nullopt : table_->find(stem);
  }

 private:
  FreeNumbers listed_in(const Entry& list) const {
    const std::size_t count = info_.coordinates.size();
    FreeNumbers free{std::vector<bool>(count), std::vector<bool>(count)};
    if (!list.is_array()) list.fail("names of coordinates and rates");
    for (std::size_t k = 0; k < list.size(); ++k) {
      const Entry name = list.element(k);
      bool is_known = false;
      for (std::size_t i = 0; i < count; ++i) {
        if (name.text() == info_.coordinates[i]) free.coordinates[i] = is_known = true;
        if (name.text() == rate_name(info_.coordinates[i])) free.rates[i] = is_known = true;
      }
      if (!is_known) name.fail("a coordinate or a rate of the model");
    }
    return free;
  }

  static constexpr std::string_view assemble_key = "assemble";

  static std::string momentum_of(std::string_view stem) { return std::string("p_").append(stem); }

  /// Rates may also have their older names.
  template <class Name>
  std::optional<Entry> find(Name name, const std::string& stem) const {
    const std::string key = name(stem), old = stem + "_dot";
    std::optional<Entry> entry = table_->find(key);
    if (key == old || key != present_name(old)) return entry;
    const std::optional<Entry> before = table_->find(old);
    if (entry && before) before->fail("nothing beside " + entry->name() + ", which is the same");
    return entry ? entry : before;
  }

  template <class Name>
  std::optional<Entry> first(Name name) const {
    for (const std::string_view coordinate : info_.coordinates) {
      for (const std::string& stem : {std::string(coordinate), std::string(family(coordinate))}) {
        if (stem.empty()) continue;
        if (const auto entry = find(name, stem)) return entry;
      }
    }
    return std::nullopt;
  }

  template <class Name, class UnitOf>
  Eigen::VectorXd read(Name name, UnitOf unit_of) const {
    Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(info_.coordinates.size()));
    for (std::size_t k = 0; k < info_.coordinates.size(); ++k) {
      const std::string unit = unit_of(info_.coordinate_units[k]);
      const std::string own(info_.coordinates[k]), stem(family(own));
      if (const auto entry = find(name, own)) {
        values[static_cast<Eigen::Index>(k)] = entry->number(unit);
      } else if (const auto all = stem.empty() ? std::nullopt : find(name, stem)) {
        const int count = members(stem);
        const Eigen::VectorXd each = all->per_link({count, "the model", all->where()}, unit);
        values[static_cast<Eigen::Index>(k)] = each[number_of(k, stem)];
      }
    }
    return values;
  }

  int members(std::string_view stem) const {
    return static_cast<int>(std::ranges::count_if(info_.coordinates, [&](auto name) { return family(name) == stem; }));
  }
  Eigen::Index number_of(std::size_t k, std::string_view stem) const {
    return std::count_if(info_.coordinates.begin(), info_.coordinates.begin() + static_cast<std::ptrdiff_t>(k),
                         [&](auto name) { return family(name) == stem; });
  }

  const SystemInfo& info_;
  std::vector<std::string> names_;
  std::vector<ScenarioKey> keys_;
  std::optional<Section> table_;
};

/// Throws InputError if the mass matrix is singular, so that momenta have no rates. The rate of the coordinate without
/// inertia is infinite then, those of coupled ones are NaN.
void require_inertia(const StartTable& table, const SystemSubject& system, const Eigen::VectorXd& q) {
  if (system.has_inertia(q)) return;
  const Eigen::VectorXd rates = system.rates(0, q, Eigen::VectorXd::Ones(q.size()));
  std::string got = "a singular one";
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (std::isinf(rates[k])) {
      got = "no inertia in " + std::string(system.info().coordinates[static_cast<std::size_t>(k)]);
    }
  }
  throw InputError(table.where(), "start", "coordinates where the mass matrix is not singular", got);
}

/// Puts the start on the constraints, and keeps by name what was found, and from where.
void put_together(const StartTable& table, const SystemSubject& system, SystemScenario& scenario) {
  const SystemInfo& info = system.info();
  if (info.constraints.empty()) return;
  Motion& start = scenario.start;
  const Eigen::VectorXd guess = start.q;
  const FreeNumbers free = table.free();
  if (const std::string left = assemble(system, free, start); !left.empty()) {
    throw InputError(table.where(), "start", "coordinates and rates that keep the constraints",
                     left + " left over; from other guesses of what is found (assemble) it may close");
  }
  const bool finds_places = !std::ranges::all_of(info.constraint_is_of_rates, std::identity());
  for (std::size_t k = 0; k < info.coordinates.size() && finds_places; ++k) {
    if (!free.coordinates[k]) continue;
    scenario.assembled.emplace_back(info.coordinates[k], start.q[static_cast<Eigen::Index>(k)]);
    scenario.guesses.emplace_back(info.coordinates[k], guess[static_cast<Eigen::Index>(k)]);
  }
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    if (!free.rates[k]) continue;
    scenario.assembled.emplace_back(rate_name(info.coordinates[k]), start.v[static_cast<Eigen::Index>(k)]);
  }
}

void read_start(const Section& root, const SystemSubject& system, SystemScenario& scenario) {
  const StartTable table(root, system.info());
  Motion& start = scenario.start = Motion(0, table.positions(), table.rates());
  require_inertia(table, system, start.q);
  if (const std::optional<Entry> momentum = table.first_momentum()) {
    if (const auto rate = table.first_rate()) rate->fail("no rates beside the momenta " + momentum->name());
    start.v = system.rates(0, start.q, table.momenta());
  }
  put_together(table, system, scenario);
  const int all = static_cast<int>(system.info().constraints.size());
  scenario.constraints = independent_constraints(system, start);
  if (scenario.constraints < all) {
    scenario.warnings.push_back(
        std::to_string(all - scenario.constraints) + " of the " + std::to_string(all) +
        " constraints follow from the others at the start: there is one motion, and many forces "
        "that make it, of which small ones are told");
  }
}

/// Warnings of angles that were probably meant in degrees, one for each key.
std::vector<std::string> degree_warnings(const Section& root, const SystemInfo& info) {
  const StartTable table(root, info);
  std::vector<std::string> warnings;
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    const std::optional<Entry> entry = table.entry_of(k);
    if (!info.is_angle[k] || !entry) continue;
    const std::optional<std::string> warning = warning_of_degrees(*entry);
    if (warning && std::ranges::find(warnings, *warning) == warnings.end()) warnings.push_back(*warning);
  }
  return warnings;
}

/// Columns for drives of motions, which are not inputs of a kernel.
std::vector<ColumnPlan> motion_columns(const std::vector<FeedbackPlan>& drives, const SystemSubject& system) {
  std::vector<ColumnPlan> columns;
  for (const FeedbackPlan& drive : drives) {
    if (std::ranges::find(system.info().inputs, drive.input) != system.info().inputs.end()) continue;
    const auto same = std::ranges::find(columns, drive.input, &ColumnPlan::name);
    if (same == columns.end()) {
      columns.push_back({drive.input, drive.value, drive.place});
    } else {
      same->value = "(" + same->value + ") + (" + drive.value + ")";
    }
  }
  return columns;
}

/// The place in a scenario of what a model refuses: the drive of something that the model does not have, or the model.
std::string place_of(std::string_view refused, const std::vector<FeedbackPlan>& drives, const Entry& model) {
  for (const FeedbackPlan& drive : drives) {
    if (refused.ends_with("; got " + drive.input)) return drive.input_place;
    if (refused.find("the motion " + drive.input + " ") != std::string_view::npos) return drive.place;
  }
  return model.place();
}

}  // namespace

std::optional<std::string> warning_of_degrees(const Entry& entry) {
  if (entry.is_array()) {
    for (std::size_t i = 0; i < entry.size(); ++i) {
      if (auto warning = warning_of_degrees(entry.element(i))) return warning;
    }
    return std::nullopt;
  }
  if (!entry.is_number()) return std::nullopt;
  const double angle = entry.number();
  const std::string text = shortest(angle);
  constexpr std::size_t most_typed = 6;  // characters; longer numbers are multiples of pi, or the end of another run
  if (std::abs(angle) <= 2 * std::numbers::pi || text.size() > most_typed) return std::nullopt;
  return entry.place() + ": " + text + " rad is more than a turn; did you mean \"" + text + " deg\"?";
}

SystemScenario read_system(const Section& root, const std::filesystem::path& folder, const FindSystem& find) {
  if (const auto chain = root.find("chain")) chain->fail("no [chain] beside [system]");
  const Section table(root, "system");
  const Entry model = table.require("model");
  std::optional<int> links;
  if (const auto entry = table.find("links")) links = static_cast<int>(entry->integer());
  SystemScenario scenario;
  const std::vector<FeedbackPlan> drives = read_drive_values(table);
  try {
    ModelName name{model.text(), links, folder, drive_laws(drives)};
    const auto kernel = find(name);
    scenario.feedback = read_feedback(table, &kernel->info);
    scenario.signals = read_signals(table, folder, &kernel->info);
    const SystemNumbers numbers = read_numbers(table, kernel->info);
    const auto system = std::make_shared<SystemSubject>(kernel, numbers);
    std::vector<FeedbackPlan> laws = drives;
    laws.insert(laws.end(), scenario.feedback.begin(), scenario.feedback.end());
    const std::vector<InputLaw> fed = continuous_laws(scenario.feedback, *system);
    name.laws.insert(name.laws.end(), fed.begin(), fed.end());
    scenario.system = name.laws.empty() ? system
                                        : std::make_shared<SystemSubject>(fed.empty() ? kernel : find(name), numbers,
                                                                          continuous_functions(laws, system));
    scenario.columns = motion_columns(drives, *system);
  } catch (const ModelError& error) {
    throw InputError(place_of(error.what(), drives, model) + ": " + error.what());
  }
  read_start(root, *scenario.system, scenario);
  for (std::string& warning : degree_warnings(root, scenario.system->info())) {
    scenario.warnings.push_back(std::move(warning));
  }
  return scenario;
}

std::shared_ptr<const SystemTable> built_in_system(const ModelName& model) {
  const std::string name = kernel_name(model);
  if (!model.laws.empty()) throw ModelError("no kernel with feedback is in this build, which cannot make one here");
  std::vector<std::string_view> names;
  for (const SystemTable* table : library<KernelList<Models>>().tables) {
    if (table->info.name == name) return {table, [](const SystemTable*) {}};
    names.push_back(table->info.name);
  }
  throw ModelError("no kernel of the model " + name + " in this build (it has " + listed(names) + ")");
}

}  // namespace pendula::io
