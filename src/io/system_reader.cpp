#include "io/system_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/numeric/number_text.hpp>
#include <pendula/run/library.hpp>
#include <set>

#include "io/nearest_name.hpp"

namespace pendula::io {
namespace {

constexpr std::array<std::string_view, 4> system_keys = {"model", "links", "parameters", "drive"};
constexpr std::array<std::string_view, 5> drive_keys = {"input", "constant", "amplitude", "frequency", "phase"};
constexpr int most_links = 64;  // as the generator's

double number(const Section& section, std::string_view key, double otherwise) {
  const std::optional<Entry> entry = section.find(key);
  return entry ? entry->number() : otherwise;
}

/// Names as a message lists them.
std::string listed(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text.empty() ? "none" : text;
}

/// Parameters by name, from the table or from what the model says.
std::vector<double> read_parameters(const Section& system, const SystemInfo& info) {
  const std::optional<Entry> entry = system.find("parameters");
  const std::optional<Section> given =
      entry ? std::optional<Section>(std::in_place, *entry, info.parameters) : std::nullopt;
  std::vector<double> numbers;
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    const std::string name(info.parameters[k]);
    const int size = info.parameter_sizes[k];
    const Sign sign = info.is_positive[k] ? Sign::positive : Sign::any;
    const std::optional<Entry> value = given ? given->find(name) : std::nullopt;
    if (!value && !std::isfinite(info.parameter_defaults[k])) {
      const std::string what =
          "a number [" + std::string(info.parameter_units[k]) + "], which the model has no default for";
      if (given) given->require(name, what);
      throw InputError(system.where(), "system.parameters." + name, what, "no such key");
    }
    if (value && info.is_per_link[k]) {
      const Eigen::VectorXd each = value->per_link({size, "the model", system.where()}, sign);
      numbers.insert(numbers.end(), each.begin(), each.end());
    } else {
      numbers.insert(numbers.end(), static_cast<std::size_t>(size),
                     value ? value->number(sign) : info.parameter_defaults[k]);
    }
  }
  return numbers;
}

void read_drive(const Section& table, const SystemInfo& info, SystemNumbers& numbers) {
  const Entry entry = table.require("input", "the name of an input of the model: " + listed(info.inputs));
  if (info.inputs.empty()) entry.fail("no drive, since the model has no inputs");
  const std::size_t input = entry.choice(info.inputs);
  numbers.inputs[input] += number(table, "constant", 0);
  const double amplitude = number(table, "amplitude", 0);
  if (amplitude == 0) return;
  numbers.sines.push_back({static_cast<int>(input), amplitude,
                           table.require("frequency", "an angular frequency").number(), number(table, "phase", 0)});
}

SystemNumbers read_numbers(const Section& system, const SystemInfo& info) {
  SystemNumbers numbers{read_parameters(system, info), std::vector<double>(info.inputs.size(), 0.0), {}};
  if (const std::optional<Entry> drives = system.find("drive")) {
    if (!drives->is_array()) drives->fail("[[system.drive]] tables");
    for (std::size_t i = 0; i < drives->size(); ++i) {
      read_drive(Section(drives->element(i), drive_keys), info, numbers);
    }
  }
  return numbers;
}

/// theta of theta_1, where it has such an ending.
std::string_view family(std::string_view name) {
  const std::size_t end = name.find_last_not_of("0123456789");
  const bool numbered = end != std::string_view::npos && end > 0 && end + 1 < name.size() && name[end] == '_';
  return numbered ? name.substr(0, end) : std::string_view();
}

/// The keys of [start]: coordinates, rates and momenta, by name, and theta for theta_1, theta_2, … together.
class StartTable {
 public:
  StartTable(const Section& root, const SystemInfo& info) : info_(info) {
    std::set<std::string> known;
    for (const std::string_view coordinate : info.coordinates) {
      for (const std::string& stem : {std::string(coordinate), std::string(family(coordinate))}) {
        if (stem.empty()) continue;
        known.insert({stem, rate_of(stem), momentum_of(stem)});
      }
    }
    names_.assign(known.begin(), known.end());
    const std::vector<std::string_view> views(names_.begin(), names_.end());
    table_.emplace(root, "start", views, std::span<const std::string_view>());
  }

  /// The coordinates; what is not there is 0.
  Eigen::VectorXd positions() const {
    return read([](const std::string& stem) { return stem; }, "");
  }
  Eigen::VectorXd rates() const { return read(rate_of, "/s"); }
  Eigen::VectorXd momenta() const { return read(momentum_of, ""); }

  std::optional<Entry> first_momentum() const { return first(momentum_of); }
  std::optional<Entry> first_rate() const { return first(rate_of); }
  const std::string& where() const { return table_->where(); }

  /// The entry of coordinate k, its own or one for all like it.
  std::optional<Entry> entry_of(std::size_t k) const {
    if (const auto own = table_->find(info_.coordinates[k])) return own;
    const std::string_view stem = family(info_.coordinates[k]);
    return stem.empty() ? std::nullopt : table_->find(stem);
  }

 private:
  static std::string rate_of(const std::string& stem) { return stem + "_dot"; }
  static std::string momentum_of(const std::string& stem) { return "p_" + stem; }

  template <class Name>
  std::optional<Entry> first(Name name) const {
    for (const std::string_view coordinate : info_.coordinates) {
      for (const std::string& stem : {std::string(coordinate), std::string(family(coordinate))}) {
        if (stem.empty()) continue;
        if (const auto entry = table_->find(name(stem))) return entry;
      }
    }
    return std::nullopt;
  }

  template <class Name>
  Eigen::VectorXd read(Name name, const std::string& per_time) const {
    Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(info_.coordinates.size()));
    for (std::size_t k = 0; k < info_.coordinates.size(); ++k) {
      const std::string rad = "rad" + per_time, deg = "deg" + per_time;
      const std::array<Unit, 2> angles = {{{rad, 1}, {deg, degree}}};
      const Units units = info_.is_angle[k] ? Units(angles) : Units();
      const std::string own(info_.coordinates[k]), stem(family(own));
      if (const auto entry = table_->find(name(own))) {
        values[static_cast<Eigen::Index>(k)] = entry->number(Sign::any, units);
      } else if (const auto all = stem.empty() ? std::nullopt : table_->find(name(stem))) {
        const int count = members(stem);
        const Eigen::VectorXd each = all->per_link({count, "the model", all->where()}, Sign::any, units);
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
  std::optional<Section> table_;
};

/// Throws InputError where some momenta have no rates: where the mass matrix is singular. Infinite is the rate of the
/// coordinate that has no inertia; of those that hang together with it they are no numbers.
void require_inertia(const StartTable& table, const SystemSubject& system, const Eigen::VectorXd& q) {
  const Eigen::VectorXd rates = system.rates(0, q, Eigen::VectorXd::Ones(q.size()));
  if (rates.allFinite()) return;
  std::string got = "a singular one";
  for (Eigen::Index k = 0; k < q.size(); ++k) {
    if (std::isinf(rates[k])) {
      got = "no inertia in " + std::string(system.info().coordinates[static_cast<std::size_t>(k)]);
    }
  }
  throw InputError(table.where(), "start", "coordinates where the mass matrix is not singular", got);
}

Motion read_start(const Section& root, const SystemSubject& system) {
  const StartTable table(root, system.info());
  Motion start(0, table.positions(), table.rates());
  require_inertia(table, system, start.q);
  if (const std::optional<Entry> momentum = table.first_momentum()) {
    if (const auto rate = table.first_rate()) rate->fail("no rates beside the momenta " + momentum->key());
    start.v = system.rates(0, start.q, table.momenta());
  }
  return start;
}

/// Angles that are given without a unit and beyond two turns: degrees, most likely.
void warn_of_degrees(const Section& root, const SystemInfo& info, std::vector<std::string>& warnings) {
  const StartTable table(root, info);
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    const std::optional<Entry> entry = table.entry_of(k);
    if (!info.is_angle[k] || !entry || !entry->is_number()) continue;
    const double angle = entry->number();
    if (std::abs(angle) <= 4 * std::numbers::pi) continue;
    warnings.push_back(entry->place() + ": " + shortest(angle) + " rad is more than two turns; did you mean \"" +
                       shortest(angle) + " deg\"?");
  }
}

}  // namespace

SystemScenario read_system(const Section& root, const std::filesystem::path& folder, const FindSystem& find) {
  if (const auto chain = root.find("chain")) chain->fail("no [chain] beside [system]");
  const Section table(root, "system", system_keys, {});
  const Entry model = table.require("model", "a model file, or the name of a built-in model");
  std::optional<int> links;
  if (const auto entry = table.find("links")) links = static_cast<int>(entry->integer(1, most_links));
  SystemScenario scenario;
  try {
    const auto entry = find(model.text(), links, folder);
    scenario.system = std::make_shared<SystemSubject>(entry, read_numbers(table, entry->info));
  } catch (const ModelError& error) {
    throw InputError(model.place() + ": " + error.what());
  }
  scenario.start = read_start(root, *scenario.system);
  warn_of_degrees(root, scenario.system->info(), scenario.warnings);
  return scenario;
}

std::shared_ptr<const SystemEntry> built_in_system(const std::string& model, std::optional<int> links,
                                                   const std::filesystem::path&) {
  const std::string stem = std::filesystem::path(model).stem().string();
  const std::string name = links ? stem + "_" + std::to_string(*links) : stem;
  std::vector<std::string_view> names;
  for (const SystemEntry* entry : library().systems) {
    if (entry->info.name == name) return {entry, [](const SystemEntry*) {}};
    names.push_back(entry->info.name);
  }
  throw ModelError("no kernel of the model " + name + " in this build (it has " + listed(names) + ")");
}

}  // namespace pendula::io
