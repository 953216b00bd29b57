#include "io/ensemble_plan.hpp"

#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <pendula/numeric/number_text.hpp>
#include <string_view>

namespace pendula::io {
namespace {

constexpr std::array<std::string_view, 6> ensemble_keys = {"axis", "random", "count", "seed", "method", "keep"};
constexpr std::array<std::string_view, 2> methods = {"run", "auto"};
constexpr std::array<std::string_view, 4> axis_keys = {"key", "from", "to", "count"};
constexpr std::array<std::string_view, 5> random_keys = {"key", "from", "to", "mean", "deviation"};

/// Beyond 2⁵³ a double no longer tells one from the next.
constexpr std::int64_t most_members = std::int64_t{1} << 53;

std::string read_key(const Section& section) {
  const Entry entry = section.require("key", "a key of the scenario, such as \"start.theta[1]\"");
  const std::string key = entry.text();
  if (key.find('.') == std::string::npos || key.starts_with("ensemble.")) {
    entry.fail("a key of the scenario, such as \"start.theta[1]\"");
  }
  return key;
}

EnsembleAxis read_axis(const Section& section) {
  EnsembleAxis axis;
  axis.key = read_key(section);
  axis.from = section.require("from", "a finite number").number();
  axis.to = section.require("to", "a finite number").number();
  axis.count = section.require("count", "an integer >= 1").integer(1, most_members);
  return axis;
}

EnsembleDraw read_draw(const Section& section) {
  EnsembleDraw draw;
  draw.key = read_key(section);
  draw.normal = section.find("mean") || section.find("deviation");
  if (!draw.normal) {
    draw.first = section.require("from", "a finite number, or mean and deviation").number();
    draw.second = section.require("to", "a finite number").number();
    return draw;
  }
  for (const std::string_view other : {"from", "to"}) {
    if (const auto entry = section.find(other)) entry->fail("nothing beside mean and deviation");
  }
  draw.first = section.require("mean", "a finite number").number();
  draw.second = section.require("deviation", "a finite number >= 0").number(Sign::not_negative);
  return draw;
}

/// Elements of an array of tables.
template <class Read>
auto read_all(const Section& ensemble, const std::string& name, std::span<const std::string_view> known, Read read) {
  std::vector<decltype(read(ensemble))> all;
  const std::optional<Entry> entry = ensemble.find(name);
  if (!entry) return all;
  if (!entry->is_array()) entry->fail("tables [[ensemble." + name + "]]");
  for (std::size_t k = 0; k < entry->size(); ++k) all.push_back(read(Section(entry->element(k), known)));
  return all;
}

void require_different(const Section& ensemble, const std::string& name, const std::vector<std::string>& keys) {
  for (std::size_t k = 0; k < keys.size(); ++k) {
    for (std::size_t j = 0; j < k; ++j) {
      if (keys[j] == keys[k]) ensemble.find(name)->element(k).fail("another key than " + keys[j] + ", which has one");
    }
  }
}

std::int64_t product(const Section& ensemble, const std::vector<EnsembleAxis>& axes) {
  std::int64_t count = 1;
  for (const EnsembleAxis& axis : axes) {
    if (axis.count > most_members / count) ensemble.find("axis")->fail("at most 2^53 members in all");
    count *= axis.count;
  }
  return count;
}

/// Uniform in (0, 1), 53 bits.
double uniform(std::uint64_t bits) {
  return (static_cast<double>(bits >> 11) + 0.5) * 0x1p-53;
}

double drawn(const EnsembleDraw& draw, std::uint64_t seed, std::uint64_t key, std::uint64_t member) {
  const r123::Philox4x64 generate;
  const r123::Philox4x64::ctr_type words = generate({{member, key, 0, 0}}, {{seed, 0}});
  if (!draw.normal) return std::lerp(draw.first, draw.second, uniform(words[0]));
  // Box and Muller.
  const double radius = std::sqrt(-2 * std::log(uniform(words[0])));
  return draw.first + draw.second * radius * std::cos(2 * std::numbers::pi * uniform(words[1]));
}

}  // namespace

double EnsembleAxis::at(std::int64_t k) const {
  if (k + 1 == count) return count == 1 ? from : to;
  return std::lerp(from, to, static_cast<double>(k) / static_cast<double>(count - 1));
}

std::vector<std::int64_t> EnsemblePlan::shape() const {
  if (axes.empty()) return {count};
  std::vector<std::int64_t> shape;
  shape.reserve(axes.size());
  for (const EnsembleAxis& axis : axes) shape.push_back(axis.count);
  return shape;
}

std::vector<std::string> EnsemblePlan::keys() const {
  std::vector<std::string> keys;
  keys.reserve(axes.size() + draws.size());
  for (const EnsembleAxis& axis : axes) keys.push_back(axis.key);
  for (const EnsembleDraw& draw : draws) keys.push_back(draw.key);
  return keys;
}

std::vector<double> EnsemblePlan::values(std::int64_t member) const {
  std::vector<double> values(axes.size() + draws.size());
  std::int64_t rest = member;
  for (std::size_t k = axes.size(); k-- > 0;) {
    values[k] = axes[k].at(rest % axes[k].count);
    rest /= axes[k].count;
  }
  for (std::size_t k = 0; k < draws.size(); ++k) {
    values[k] = drawn(draws[k], seed, k, static_cast<std::uint64_t>(member));
  }
  return values;
}

std::vector<std::string> EnsemblePlan::overrides(std::int64_t member) const {
  std::vector<std::string> overrides = keys();
  const std::vector<double> numbers = values(member);
  for (std::size_t k = 0; k < overrides.size(); ++k) overrides[k].append("=").append(shortest(numbers[k]));
  return overrides;
}

std::string unit_of_key(std::string_view key) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 18> units = {{
      {"start.theta_dot", "rad/s"},
      {"start.phi_dot", "rad/s"},
      {"start.theta", "rad"},
      {"start.phi", "rad"},
      {"chain.masses", "kg"},
      {"chain.lengths", "m"},
      {"chain.gravity", "m/s^2"},
      {"chain.damping", "N m s/rad"},
      {"chain.torque", "N m"},
      {"chain.drive.amplitude", "N m"},
      {"chain.drive.frequency", "rad/s"},
      {"chain.drive.phase", "rad"},
      {"system.drive.frequency", "rad/s"},
      {"system.drive.phase", "rad"},
      {"run.step", "s"},
      {"run.duration", "s"},
      {"run.tolerance", "1"},
      {"run.accuracy", "1"},
  }};
  std::string name;
  int depth = 0;  // of brackets
  for (const char c : key) {
    depth += c == '[' ? 1 : 0;
    if (depth == 0) name += c;
    depth -= c == ']' ? 1 : 0;
  }
  for (const auto& [known, unit] : units) {
    if (known == name) return std::string(unit);
  }
  return {};
}

EnsemblePlan parse_ensemble(std::string_view text, const std::string& name, std::span<const std::string> overrides) {
  const toml::table document = parse_toml(text, name, overrides);
  const toml::node* const node = document.get("ensemble");
  if (node == nullptr) {
    throw InputError(name + ": expected [[ensemble.axis]] or [[ensemble.random]], got a scenario without [ensemble]");
  }
  const Section ensemble(Entry(*node, "ensemble"), ensemble_keys);
  EnsemblePlan plan;
  plan.axes = read_all(ensemble, "axis", axis_keys, read_axis);
  plan.draws = read_all(ensemble, "random", random_keys, read_draw);
  if (plan.axes.empty() == plan.draws.empty()) {
    throw InputError(ensemble.where(), "ensemble", "either [[ensemble.axis]] or [[ensemble.random]]",
                     plan.axes.empty() ? "neither" : "both");
  }
  require_different(ensemble, plan.axes.empty() ? "random" : "axis", plan.keys());
  const std::optional<Entry> count = ensemble.find("count"), seed = ensemble.find("seed"), keep = ensemble.find("keep");
  if (plan.axes.empty()) {
    plan.count = ensemble.require("count", "how many members, an integer >= 1").integer(1, most_members);
  } else {
    if (count) count->fail("a count of each axis, and none of the ensemble");
    plan.count = product(ensemble, plan.axes);
  }
  if (seed) plan.seed = static_cast<std::uint64_t>(seed->integer(0, std::numeric_limits<std::int64_t>::max()));
  if (const auto method = ensemble.find("method")) plan.chooses_method = method->choice(methods) == 1;
  if (!keep) return plan;
  if (!keep->is_array()) keep->fail("a list of what to keep, such as [\"final\", \"energy_error\"]");
  plan.keep_place = keep->place();
  for (std::size_t k = 0; k < keep->size(); ++k) plan.keep.push_back(keep->element(k).text());
  return plan;
}

}  // namespace pendula::io
