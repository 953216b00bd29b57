#include "io/summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <exception>
#include <functional>
#include <pendula/numeric/number_text.hpp>
#include <pendula/version.hpp>
#include <string_view>

#include "io/errors.hpp"

namespace pendula::io {
namespace {

// The text: labels in one column, values in the next.

constexpr std::size_t label_width = 19;
constexpr std::size_t value_width = 12;

std::string padded(const std::string& text, std::size_t width) {
  return text + std::string(width - std::min(width, text.size()), ' ');
}

std::string right(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

std::string line(const std::string& label, const std::string& value) {
  return padded(label, label_width) + value + "\n";
}

/// A value in the column of values, and a remark.
std::string line(const std::string& label, const std::string& value, const std::string& remark) {
  return line(label, remark.empty() ? value : padded(value, value_width) + "  " + remark);
}

std::string plural(std::int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string rows_text(const Summary& summary, const std::string& unit) {
  if (summary.asked.rows.interval > 0) return "a row every " + shortest(summary.asked.rows.interval) + unit;
  if (summary.asked.rows.any())
    return "rows at " + plural(static_cast<std::int64_t>(summary.asked.rows.times.size()), "time");
  return "a row every " + plural(summary.asked.every, "step");
}

std::string shown_or_dash(double value, int digits) {
  return std::isfinite(value) ? rounded(value, digits) : "-";
}

/// "0.000523 s" as "523 us"; "-" for a time that is not known.
std::string duration_text(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds >= 1) return rounded(seconds, 4) + " s";
  if (seconds >= 1e-3) return rounded(seconds * 1e3, 4) + " ms";
  return rounded(seconds * 1e6, 3) + " us";
}

std::string what_was_moved(const ModelSummary& model) {
  if (model.space.empty()) {
    std::string numbers;
    for (const auto& [name, values] : model.parameters) {
      numbers += ", " + name + " " + rounded(values.front());
      if (std::ranges::adjacent_find(values, std::not_equal_to()) != values.end()) numbers += " ...";
    }
    std::string text =
        line("system", model.model + (model.links > 1 ? ", " + plural(model.links, "link") : "") + numbers);
    if (model.constraints > 0) {
      text += line("constraints", std::to_string(model.constraints),
                   plural(model.degrees_of_freedom, "degree") + " of freedom");
    }
    for (std::size_t k = 0; k < model.assembled.size(); ++k) {
      const auto& [name, value] = model.assembled[k];
      const std::string from = k < model.guesses.size() ? ", from " + rounded(model.guesses[k].second) : "";
      text += line(name, rounded(value), "found for the start" + from);
    }
    return text;
  }
  const UnitNames unit = unit_names(model.natural);
  const std::string acceleration = model.natural ? " g" : " m/s^2";
  std::string held;
  if (model.constraints > 0) {
    held = line("end held", std::to_string(model.constraints) + " constraints",
                plural(model.degrees_of_freedom, "degree") + " of freedom");
    held += line("start", model.hangs ? "as it hangs at rest"
                          : model.closed_by > 0
                              ? "angles changed to close, by at most " + rounded(model.closed_by, 2) + " rad"
                              : "angles as given");
  }
  return line("chain", model.space + ", " + plural(model.links, "link") + ", mass " + rounded(model.mass) +
                           std::string(unit.mass) + ", length " + rounded(model.length) + std::string(unit.length) +
                           ", gravity " + rounded(model.gravity) + acceleration +
                           (model.loaded ? ", with loads" : "")) +
         held;
}

std::string settings(const Summary& summary) {
  const ModelSummary& model = summary.model;
  const UnitNames unit = unit_names(model.natural);
  std::string text = what_was_moved(model);
  std::string fed;
  for (const std::string& input : model.feedback) fed += (fed.empty() ? "" : ", ") + input;
  if (!fed.empty()) text += line("feedback", fed);
  std::string given;
  for (const std::string& input : model.signals) given += (given.empty() ? "" : ", ") + input;
  if (!given.empty()) text += line("signals", given);
  std::string method(name_of(summary.options.method));
  if (has_stages(summary)) {
    method += ", " + plural(summary.options.stages, "stage") + " (order " +
              std::to_string(2 * summary.options.stages - (summary.options.method == Method::radau ? 1 : 0)) + "), " +
              std::string(name_of(summary.options.form)) + " form";
  }
  if (!summary.method_reason.empty()) method += "; chosen: " + summary.method_reason;
  text += line("method", method);
  const Description& description = summary.description;
  std::string solver = description.solver.empty() ? "" : description.solver + ", " + description.iteration;
  if (!description.kernel.empty()) solver += (solver.empty() ? "kernel " : ", kernel ") + description.kernel;
  if (!description.kernel.empty() && summary.kernel_by == "interpreter") solver += ", interpreted";
  if (!description.kernel.empty() && summary.kernel_by == "llvm") solver += ", by LLVM";
  if (!solver.empty()) text += line("solver", solver);
  const std::string time(unit.time);
  if (summary.aimed) text += line("accuracy", shortest(summary.asked.accuracy.error));
  std::string tolerance = summary.aimed ? rounded(summary.options.tolerance, 3) : shortest(summary.options.tolerance);
  if (summary.motion_tolerance > 0 && !summary.aimed) {
    tolerance = shortest(summary.motion_tolerance) + ", by one of a step of " + rounded(summary.options.tolerance, 1);
  }
  text +=
      is_adaptive(summary.options) ? line("tolerance", tolerance) : line("step", shortest(summary.options.step) + time);
  text += line("duration", shortest(summary.asked.duration) + time + ", " + rows_text(summary, time));
  if (model.natural) {
    text += line("units", "l_1 = " + rounded(model.natural->length) + " m, M_1 = " + rounded(model.natural->mass) +
                              " kg, sqrt(l_1/g) = " + rounded(model.natural->time) + " s");
  }
  return text;
}

/// A line about energy, which is conserved unless there are loads.
std::string error_name(const Summary& summary) {
  return summary.model.loaded ? "change" : "error";
}

std::string table(const Summary& summary) {
  constexpr std::size_t width = 15;  // width of nine digits with sign and exponent
  const auto cell = [](const std::string& text) { return std::string(" ").append(right(text, width)); };
  std::string text = right("t", value_width);
  for (const std::string& column : summary.shown) text += cell(column);
  text += cell("energy " + error_name(summary)) + "\n";
  for (const TableRow& row : summary.table) {
    text += right(rounded(row.time), value_width);
    for (const double coordinate : row.shown) text += cell(rounded(coordinate, 9));
    text += cell(shown_or_dash(row.energy_error, 3)) + "\n";
  }
  return text;
}

std::string statistics(const Summary& summary) {
  const Statistics& counts = summary.statistics;
  const auto a_step = [&](double total) {
    return total / static_cast<double>(std::max<std::int64_t>(counts.steps, 1));
  };
  const std::string least = rounded(counts.smallest_step, 2), most = rounded(counts.largest_step, 2);
  const std::string sizes =
      "of " + (least == most ? "" : least + " to ") + most + std::string(unit_names(summary.model.natural).time);
  std::string text = line("steps", std::to_string(counts.steps), counts.largest_step > 0 ? sizes : "");
  text += line("rejected steps", std::to_string(counts.rejected_steps));
  if (has_stages(summary)) {
    text += line("iterations", std::to_string(counts.newton_iterations),
                 rounded(a_step(static_cast<double>(counts.newton_iterations)), 4) + " a step");
    if (summary.model.constraints > 0) {
      text += line("constraint error", rounded(counts.constraint_error, 2),
                   "rates " + rounded(counts.constraint_rate_error, 2));
    }
  }
  return text + line("stepping time", duration_text(summary.stepping_seconds),
                     duration_text(a_step(summary.stepping_seconds)) + " a step");
}

std::string energies(const Summary& summary) {
  const std::string unit(unit_names(summary.model.natural).energy);
  const std::string of = summary.model.space.empty()  ? "of the largest |T| + |U|"
                         : summary.model.gravity != 0 ? "of the sum of M_i g l_i"
                                                      : "of the energy at the start";
  return line("energy at start", shown_or_dash(summary.energy_error.initial, 12) + unit) +
         line("energy at end", shown_or_dash(summary.energy_final, 12) + unit) +
         line("largest " + error_name(summary), shown_or_dash(summary.energy_error.largest, 3),
              of + ", over " + plural(summary.rows, "row"));
}

/// Lines about how far rows can be trusted.
std::string trust(const Summary& summary) {
  const Trust& trust = summary.trust;
  std::string text;
  if (std::isfinite(trust.expected_error)) {
    const std::string of = summary.model.space.empty() ? "size of the motion" : "length of the chain, or radians";
    text += line("expected error", rounded(trust.expected_error, 1), "of the " + of + ", in every row");
  }
  if (std::isfinite(trust.until)) {
    text += line("trusted until", rounded(trust.until, 4) + std::string(unit_names(summary.model.natural).time));
  }
  return text;
}

/// The last bob, or the shown columns of a system.
std::string place(const Summary& summary) {
  constexpr std::string_view axes = "xyz";
  const UnitNames unit = unit_names(summary.model.natural);
  std::string position;
  const auto add = [&](std::string_view name, double value) {
    position += (position.empty() ? "" : ", ") + std::string(name) + " = ";
    append_number(position, value + 0.0);  // no -0
  };
  if (summary.model.space.empty()) {
    const std::vector<double> none(summary.shown.size(), std::nan(""));
    const std::vector<double>& last = summary.table.empty() ? none : summary.table.back().shown;
    for (std::size_t k = 0; k < last.size(); ++k) add(summary.shown[k], last[k]);
    return line("last row", position + " at t = " + rounded(summary.system.time, 12) + " s");
  }
  const auto bob = summary.final.bobs.col(summary.final.bobs.cols() - 1);
  for (Eigen::Index axis = 0; axis < bob.size(); ++axis) add(axes.substr(static_cast<std::size_t>(axis), 1), bob[axis]);
  return line("last bob", position + std::string(unit.length) + " at t = " + rounded(summary.final.time, 12) +
                              std::string(unit.time));
}

/// A line for each.
std::string events_text(const Summary& summary) {
  const std::string unit(unit_names(summary.model.natural).time);
  std::string text;
  for (std::size_t k = 0; k < summary.events.size(); ++k) {
    const EventTally& tally = summary.events[k];
    std::string when = tally.count > 1 ? "first " : "";
    if (tally.count > 0) when.append("at t = ").append(rounded(tally.first, 12)).append(unit);
    if (tally.count > 1) when.append(", last at t = ").append(rounded(tally.last, 12)).append(unit);
    text += line("event " + summary.event_names[k] + " ", plural(tally.count, "time"), when);
  }
  return text;
}

std::string end_of_run(const Summary& summary) {
  std::string text = place(summary) + events_text(summary);
  if (summary.event_file) text += line("events", *summary.event_file);
  if (!summary.ending.event.empty()) {
    text +=
        line("stopped by", "event " + summary.ending.event + ", before the end at " + shortest(summary.asked.duration) +
                               std::string(unit_names(summary.model.natural).time));
  }
  if (summary.trajectory) text += line("trajectory", *summary.trajectory + ", " + plural(summary.rows_written, "row"));
  if (summary.view) text += line("page", *summary.view + ", to open in a browser");
  if (summary.film) text += line("film", *summary.film);
  if (!summary.ending.ok()) text += line("ended early", summary.ending.message);
  return text;
}

Ending ending_of(const Outcome& outcome, std::span<const std::string_view> coordinates,
                 std::span<const std::string_view> switches) {
  std::string status(name_of(outcome.status));
  std::ranges::replace(status, ' ', '_');
  const bool is_named = outcome.part >= 0 && !coordinates.empty() && outcome.status != Status::stuck_at_switch;
  const auto part = static_cast<std::size_t>(outcome.part);
  return {status, message(outcome, coordinates, switches), outcome, is_named ? std::string(coordinates[part]) : ""};
}

}  // namespace

Ending ending_of(const RunReport& report, std::span<const std::string_view> coordinates,
                 std::span<const std::string> events, std::span<const std::string_view> switches) {
  switch (report.end) {
    case RunEnd::complete:
      return {};
    case RunEnd::event:
      return {"stopped_by_event", "", {}, "", events[report.ended_by]};
    case RunEnd::stopped:
      return {"interrupted", "interrupted at t = " + shortest(report.last.time), {}, {}};
    case RunEnd::step_failed:
      return ending_of(report.step, coordinates, switches);
    case RunEnd::not_finite:
      return {"not_finite", "at t = " + shortest(report.step.time) + ": the energy is not a finite number", {}, {}};
    case RunEnd::observer_failed:
      break;
  }
  try {
    std::rethrow_exception(report.failure);
  } catch (const OutputError& error) {
    return {"output_failed", error.what(), {}, {}};
  }
}

ModelSummary model_summary(const std::string& scenario, const SystemSubject& system) {
  ModelSummary model;
  const SystemInfo& info = system.info();
  model.scenario = scenario;
  model.model = info.model;
  model.links = info.links;
  model.loaded = system.loaded();
  model.constraints = static_cast<int>(info.constraints.size());
  model.degrees_of_freedom = static_cast<int>(info.coordinates.size());
  auto next = system.numbers().parameters.begin();
  for (std::size_t k = 0; k < info.own_parameters(); ++k) {
    const auto end = next + info.parameter_sizes[k];
    model.parameters.emplace_back(info.parameters[k], std::vector<double>(next, end));
    next = end;
  }
  return model;
}

SystemSnapshot snapshot(const SystemSubject& system, const Motion& motion) {
  SystemSnapshot snapshot;
  const SystemInfo& info = system.info();
  snapshot.time = motion.time;
  for (std::size_t k = 0; k < info.coordinates.size(); ++k) {
    snapshot.q.emplace_back(info.coordinates[k], motion.q[static_cast<Eigen::Index>(k)]);
    snapshot.v.emplace_back(info.coordinates[k], motion.v[static_cast<Eigen::Index>(k)]);
  }
  const Observation seen = system.observe(motion);
  auto next = seen.points.begin();
  for (std::size_t k = 0; k < info.points.size(); ++k) {
    const auto end = next + info.point_sizes[k];
    snapshot.points.emplace_back(info.points[k], std::vector<double>(next, end));
    next = end;
  }
  return snapshot;
}

std::string to_text(const Summary& summary) {
  return "pendula " + std::string(version) + ": " + summary.model.scenario + "\n\n" + settings(summary) + "\n" +
         table(summary) + "\n" + statistics(summary) + "\n" + energies(summary) + trust(summary) + "\n" +
         end_of_run(summary);
}

}  // namespace pendula::io
