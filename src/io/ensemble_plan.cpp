#include "io/ensemble_plan.hpp"

#include <Random123/philox.h>

#include <cmath>
#include <numbers>
#include <pendula/numeric/number_text.hpp>
#include <string_view>

#include "io/input_error.hpp"
#include "io/section.hpp"
#include "io/toml_reader.hpp"

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

EnsembleAxis read_axis(const Section& section) {
  EnsembleAxis axis;
  axis.key = read_key(section);
  axis.from = section.require("from").number();
  axis.to = section.require("to").number();
  axis.count = section.require("count").integer();
  return axis;
}

EnsembleDraw read_draw(const Section& section) {
  EnsembleDraw draw;
  draw.key = read_key(section);
  draw.normal = section.find("mean") || section.find("deviation");
  if (!draw.normal) {
    draw.first = section.require("from").number();
    draw.second = section.require("to").number();
    return draw;
  }
  for (const std::string_view other : {"from", "to"}) {
    if (const auto entry = section.find(other)) entry->fail("nothing beside mean and deviation");
  }
  draw.first = section.require("mean").number();
  draw.second = section.require("deviation").number();
  return draw;
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

/// Uniform in (0, 1), with 53 bits.
double uniform(std::uint64_t bits) {
  return (static_cast<double>(bits >> 11) + 0.5) * 0x1p-53;
}

double drawn(const EnsembleDraw& draw, std::uint64_t seed, std::uint64_t key, std::uint64_t member) {
  const r123::Philox4x64 generate;
  const r123::Philox4x64::ctr_type words = generate({{member, key, 0, 0}}, {{seed, 0}});
  if (!draw.normal) return std::lerp(draw.first, draw.second, uniform(words[0]));
  // Box–Muller transform.
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
  const ScenarioKey* const known = find_key(key);
  return known == nullptr ? std::string() : std::string(known->unit);
}

EnsemblePlan parse_ensemble(std::string_view text, const std::string& name, std::span<const std::string> overrides) {
  const toml::table document = parse_toml(text, name, overrides);
  const Section root(document);
  if (!root.find("ensemble")) {
    throw InputError(name + ": expected [[ensemble.axis]] or [[ensemble.random]], got a scenario without [ensemble]");
  }
  const Section ensemble(root, "ensemble");
  EnsemblePlan plan;
  for (const Section& table : ensemble.each("axis")) plan.axes.push_back(read_axis(table));
  for (const Section& table : ensemble.each("random")) plan.draws.push_back(read_draw(table));
  if (plan.axes.empty() == plan.draws.empty()) {
    throw InputError(ensemble.where(), "ensemble", "either [[ensemble.axis]] or [[ensemble.random]]",
                     plan.axes.empty() ? "neither" : "both");
  }
  require_different(ensemble, plan.axes.empty() ? "random" : "axis", plan.keys());
  const std::optional<Entry> count = ensemble.find("count"), keep = ensemble.find("keep");
  if (plan.axes.empty()) {
    plan.count = ensemble.require("count").integer();
  } else {
    if (count) count->fail("a count of each axis, and none of the ensemble");
    plan.count = product(ensemble, plan.axes);
  }
  plan.seed = static_cast<std::uint64_t>(ensemble.integer("seed"));
  plan.chooses_method = ensemble.choice("method") == 1;
  if (!keep) return plan;
  if (!keep->is_array()) keep->fail(std::string(find_key("ensemble.keep")->hint));
  plan.keep_place = keep->place();
  for (std::size_t k = 0; k < keep->size(); ++k) plan.keep.push_back(keep->element(k).text());
  return plan;
}

}  // namespace pendula::io
