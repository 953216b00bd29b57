#include "io/kept.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <pendula/run/quantity.hpp>

#include "io/errors.hpp"

namespace pendula::io {
namespace {

constexpr std::string_view event_prefix = "event:";

}  // namespace

KeptQuantities::KeptQuantities(const EnsemblePlan& plan, const Subject& subject, const std::vector<EventPlan>& events) {
  const std::vector<Quantity> quantities = subject.quantities();
  std::vector<std::string> keep = plan.keep;
  if (keep.empty()) {
    keep = {"final", "energy_error", "steps"};
    for (const EventPlan& event : events) keep.push_back(std::string(event_prefix) + event.name);
  }
  for (const std::string& what : keep) add(what, plan.keep_place, quantities, events);
}

void KeptQuantities::add(const std::string& what, const std::string& place, const std::vector<Quantity>& quantities,
                         const std::vector<EventPlan>& events) {
  const auto has = [&](const std::string& name) {
    return std::ranges::any_of(columns_, [&](const Column& each) { return each.column.name == name; });
  };
  if (what == "final" || what == "points") {
    if (!has(what == "final" ? "t" : "energy")) add_last(quantities, what == "points");
    return;
  }
  const std::array<std::pair<std::string_view, Column>, 5> single = {{
      {"energy_error", {{"energy_error", "1"}, Source::energy_error}},
      {"energy", {{"energy_start", "J"}, Source::energy_start}},
      {"steps", {{"steps", "1", true}, Source::steps}},
      {"ftle", {{"ftle", "1/s"}, Source::ftle}},
      {"megno", {{"megno", "1"}, Source::megno}},
  }};
  for (const auto& [name, column] : single) {
    if (what != name) continue;
    if (!has(column.column.name)) columns_.push_back(column);
    return;
  }
  if (has(what)) return;
  const auto own = std::ranges::find_if(
      quantities, [&](const Quantity& each) { return each.role == Role::own && each.name == what; });
  if (own != quantities.end()) {
    columns_.push_back({{what, own->unit, false, own->meaning + " at the end"}, Source::last, own->first});
    return;
  }
  if (what == "lyapunov") {
    columns_.push_back({{what, "1/s"}, Source::exponent});
    columns_.push_back({{what + ":error", "1/s"}, Source::exponent_error});
    return;
  }
  const auto event = std::ranges::find_if(
      events, [&](const EventPlan& each) { return what == std::string(event_prefix) + each.name; });
  if (event == events.end()) {
    std::string known = "final, points, energy, energy_error, steps, lyapunov, ftle, megno";
    for (const Quantity& each : quantities) {
      if (each.role == Role::own) known += ", " + each.name;
    }
    for (const EventPlan& each : events) known += ", " + std::string(event_prefix) + each.name;
    throw InputError(place + ": expected some of " + known + ", got \"" + what + '"');
  }
  const auto index = static_cast<std::size_t>(event - events.begin());
  columns_.push_back({{what, "s"}, Source::event_time, index});
  columns_.push_back({{what + ":count", "1", true}, Source::event_count, index});
}

void KeptQuantities::add_last(const std::vector<Quantity>& quantities, bool points) {
  const std::vector<std::string> names = columns_of(quantities);
  for (const Quantity& quantity : quantities) {
    if (quantity.is_observed() != points || quantity.role == Role::input || quantity.role == Role::own) continue;
    for (std::size_t k = 0; k < quantity.size(); ++k) {
      const std::size_t column = quantity.column(k);
      columns_.push_back(
          {{names[column], quantity.unit, false, quantity.meaning + " at the end"}, Source::last, column});
    }
  }
}

std::vector<EnsembleColumn> KeptQuantities::columns() const {
  std::vector<EnsembleColumn> columns;
  columns.reserve(columns_.size());
  for (const Column& each : columns_) columns.push_back(each.column);
  return columns;
}

bool KeptQuantities::chaos() const {
  return std::ranges::any_of(columns_, [](const Column& each) {
    return each.source == Source::exponent || each.source == Source::ftle || each.source == Source::megno;
  });
}

void KeptQuantities::append(const Subject& subject, const RunReport& report, const LyapunovSpectrum& spectrum,
                            std::vector<double>& row) const {
  std::vector<double> last;
  subject.append_row(report.last, subject.observe(report.last), last);
  for (const Column& each : columns_) {
    switch (each.source) {
      case Source::last:
        row.push_back(last[each.index]);
        break;
      case Source::energy_start:
        row.push_back(report.energy_error.initial);
        break;
      case Source::energy_error:
        row.push_back(report.energy_error.largest);
        break;
      case Source::steps:
        row.push_back(static_cast<double>(report.statistics.steps));
        break;
      case Source::event_time:
        row.push_back(report.events[each.index].first);
        break;
      case Source::event_count:
        row.push_back(static_cast<double>(report.events[each.index].count));
        break;
      case Source::exponent:
        row.push_back(spectrum.exponents[0]);
        break;
      case Source::exponent_error:
        row.push_back(spectrum.errors[0]);
        break;
      case Source::ftle:
        row.push_back(spectrum.ftle);
        break;
      case Source::megno:
        row.push_back(spectrum.megno);
        break;
    }
  }
}

}  // namespace pendula::io
