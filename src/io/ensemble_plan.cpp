#include "io/ensemble_plan.hpp"

#include <Random123/philox.h>

#include <cmath>
#include <initializer_list>
#include <numbers>
#include <pendula/numeric/number_text.hpp>
#include <set>
#include <span>
#include <string_view>

#include "io/errors.hpp"
#include "io/section.hpp"

namespace pendula::io {
namespace {

std::string read_key(const Section& section) {
  const Entry entry = section.require("key");
  const std::string key = entry.text();
  const ScenarioKey* const known = find_key(key);
  if (key.find('.') == std::string::npos || key.starts_with("ensemble.") || (known && !takes_numbers(*known))) {
    entry.fail(std::string(find_key("ensemble.axis.key")->hint));
  }
  return key;
}

/// Throws InputError if one of these keys is given: it has no meaning beside the others.
void require_none(const Section& section, std::initializer_list<std::string_view> keys, const std::string& expected) {
  for (const std::string_view key : keys) {
    if (const auto entry = section.find(key)) entry->fail(expected);
  }
}

/// The unit of a key of the scenario; empty if only a model knows it.
std::string_view unit_of(const std::string& key) {
  const ScenarioKey* const known = find_key(key);
  return known == nullptr ? std::string_view() : known->unit;
}

std::vector<double> read_values(const Section& section, std::string_view unit) {
  const Entry entry = section.require("values");
  if (entry.size() == 0) entry.fail(std::string(find_key("ensemble.axis.values")->hint));
  std::vector<double> values(entry.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = entry.element(k).number(unit);
  return values;
}

EnsembleAxis read_axis(const Section& section) {
  EnsembleAxis axis;
  axis.key = read_key(section);
  if (section.find("values")) {
    require_none(section, {"from", "to", "count"}, "nothing beside values");
    axis.values = read_values(section, unit_of(axis.key));
    axis.count = static_cast<std::int64_t>(axis.values.size());
    return axis;
  }
  axis.from = section.require("from").number(unit_of(axis.key));
  axis.to = section.require("to").number(unit_of(axis.key));
  axis.count = section.require("count").integer();
  return axis;
}

EnsembleDraw read_draw(const Section& section) {
  EnsembleDraw draw;
  draw.key = read_key(section);
  draw.normal = section.find("mean") || section.find("deviation");
  if (!draw.normal) {
    draw.first = section.require("from").number(unit_of(draw.key));
    draw.second = section.require("to").number(unit_of(draw.key));
    return draw;
  }
  require_none(section, {"from", "to"}, "nothing beside mean and deviation");
  draw.first = section.require("mean").number(unit_of(draw.key));
  draw.second = section.require("deviation").number(unit_of(draw.key));
  return draw;
}

EnsembleDraw read_list(const Section& section) {
  EnsembleDraw list;
  list.key = read_key(section);
  list.values = read_values(section, unit_of(list.key));
  return list;
}

/// Reads the tables [[ensemble.NAME]], whose keys must differ from those in `taken`.
template <class Read>
auto read_each(const Section& ensemble, const std::string& name, std::set<std::string>& taken, Read read) {
  std::vector<decltype(read(ensemble))> all;
  for (const Section& table : ensemble.each(name)) {
    all.push_back(read(table));
    const std::string& key = all.back().key;
    if (taken.insert(key).second) continue;
    ensemble.find(name)->element(all.size() - 1).fail("another key than " + key + ", which has one");
  }
  return all;
}

std::int64_t product(const Section& ensemble, const std::vector<EnsembleAxis>& axes) {
  std::int64_t count = 1;
  for (const EnsembleAxis& axis : axes) {
    if (axis.count > most_members / count) ensemble.find("axis")->fail("at most 2^53 members in all");
    count *= axis.count;
  }
  return count;
}

std::int64_t count_members(const Section& ensemble, const EnsemblePlan& plan, std::span<const EnsembleDraw> lists) {
  if (plan.axes.empty() && lists.empty()) return ensemble.require("count").integer();
  if (const auto count = ensemble.find("count")) {
    count->fail(std::string("a count of each ") + (lists.empty() ? "axis" : "list") + ", and none of the ensemble");
  }
  if (lists.empty()) return product(ensemble, plan.axes);
  const std::size_t count = lists.front().values.size();
  for (std::size_t k = 1; k < lists.size(); ++k) {
    if (lists[k].values.size() == count) continue;
    throw InputError(ensemble.find("list")->element(k).place() + ".values: expected as many values as " +
                     lists.front().key + " has, " + std::to_string(count) + ", got " +
                     std::to_string(lists[k].values.size()));
  }
  return static_cast<std::int64_t>(count);
}

/// Uniform in (0, 1), with 53 bits.
double uniform(std::uint64_t bits) {
  return (static_cast<double>(bits >> 11) + 0.5) * 0x1p-53;
}

double drawn(const EnsembleDraw& draw, std::uint64_t seed, std::uint64_t key, std::uint64_t member) {
  if (!draw.values.empty()) return draw.values[member];
  const r123::Philox4x64 generate;
  const r123::Philox4x64::ctr_type words = generate({{member, key, 0, 0}}, {{seed, 0}});
  if (!draw.normal) return std::lerp(draw.first, draw.second, uniform(words[0]));
  // Box–Muller transform.
  const double radius = std::sqrt(-2 * std::log(uniform(words[0])));
  return draw.first + draw.second * radius * std::cos(2 * std::numbers::pi * uniform(words[1]));
}

}  // namespace

double EnsembleAxis::at(std::int64_t k) const {
  if (!values.empty()) return values[static_cast<std::size_t>(k)];
  if (k + 1 == count) return count == 1 ? from : to;
  return std::lerp(from, to, static_cast<double>(k) / static_cast<double>(count - 1));
}

std::vector<double> EnsembleAxis::all() const {
  std::vector<double> each(static_cast<std::size_t>(count));
  for (std::size_t k = 0; k < each.size(); ++k) each[k] = at(static_cast<std::int64_t>(k));
  return each;
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
  const ScenarioKey* const known = find_key(key);
  return known == nullptr ? std::string() : std::string(known->unit);
}

EnsemblePlan read_ensemble(const Section& root, const std::string& name) {
  if (!root.find("ensemble")) {
    throw InputError(name +
                     ": expected [[ensemble.axis]], [[ensemble.random]] or [[ensemble.list]], got a scenario without "
                     "[ensemble]");
  }
  const Section ensemble(root, "ensemble");
  EnsemblePlan plan;
  std::set<std::string> taken;
  plan.axes = read_each(ensemble, "axis", taken, read_axis);
  plan.draws = read_each(ensemble, "random", taken, read_draw);
  const std::vector<EnsembleDraw> lists = read_each(ensemble, "list", taken, read_list);
  plan.draws.insert(plan.draws.end(), lists.begin(), lists.end());
  if (plan.axes.empty() == plan.draws.empty()) {
    throw InputError(ensemble.where(), "ensemble",
                     "either [[ensemble.axis]], or [[ensemble.random]] and [[ensemble.list]]",
                     plan.axes.empty() ? "neither" : "both");
  }
  plan.count = count_members(ensemble, plan, lists);
  const std::optional<Entry> keep = ensemble.find("keep");
  plan.seed = static_cast<std::uint64_t>(ensemble.integer("seed"));
  plan.chooses_method = ensemble.choice("method") == 1;
  if (!keep) return plan;
  if (!keep->is_array()) keep->fail(std::string(find_key("ensemble.keep")->hint));
  plan.keep_place = keep->place();
  for (std::size_t k = 0; k < keep->size(); ++k) plan.keep.push_back(keep->element(k).text());
  return plan;
}

}  // namespace pendula::io
