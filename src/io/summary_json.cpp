#include <algorithm>
#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <pendula/chain/space.hpp>
#include <pendula/version.hpp>
#include <sstream>
#include <utility>

#include "io/provenance.hpp"
#include "io/summary.hpp"

namespace pendula::io {
namespace {

using Json = nlohmann::ordered_json;

bool chooses_steps(const Summary& summary) {
  return is_adaptive(summary.options);
}

/// null for an empty name.
Json or_null(const std::string& name) {
  return name.empty() ? Json() : Json(name);
}

/// null where a value does not apply.
template <class Value>
Json where(bool applies, const Value& value) {
  return applies ? Json(value) : Json();
}

Json to_array(const Eigen::VectorXd& values) {
  return std::vector<double>(values.begin(), values.end());
}

/// One array a column.
Json columns(const Eigen::MatrixXd& matrix) {
  Json array = Json::array();
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) array.push_back(to_array(matrix.col(j)));
  return array;
}

/// Adds a key that an object does not have. By json[key] it would look at all keys that it has: of long chains forever.
void add(Json& json, std::string key, Json value) {
  json.get_ref<Json::object_t&>().emplace_back(std::move(key), std::move(value));
}

/// Adds the numbers of all links by name, theta_1, theta_2, …
void add_named(Json& json, const std::string& name, const Eigen::VectorXd& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) add(json, name + "_" + std::to_string(i + 1), values[i]);
}

/// The final state of a chain, by name, and in arrays with one element for each link.
Json to_json(const Snapshot& snapshot) {
  const bool planar = snapshot.phi.size() == 0;
  Json q = Json::object(), v = Json::object(), points = Json::object();
  add_named(q, "theta", snapshot.theta);
  add_named(q, "phi", snapshot.phi);
  add_named(v, "theta", snapshot.theta_dot);
  add_named(v, "phi", snapshot.phi_dot);
  for (Eigen::Index i = 0; i < snapshot.bobs.cols(); ++i) {
    add(points, "bob_" + std::to_string(i + 1), to_array(snapshot.bobs.col(i)));
  }
  Json json{{"t", snapshot.time}, {"q", q}, {"v", v}, {"points", points}, {"theta", to_array(snapshot.theta)}};
  if (!planar) json["phi"] = to_array(snapshot.phi);
  json["theta_dot"] = to_array(snapshot.theta_dot);
  if (!planar) json["phi_dot"] = to_array(snapshot.phi_dot);
  json["bobs"] = columns(snapshot.bobs);
  json["velocities"] = columns(snapshot.velocities);
  return json;
}

Json to_json(const std::optional<NaturalUnits>& natural) {
  if (!natural) return nullptr;
  return {{"length", natural->length}, {"mass", natural->mass}, {"time", natural->time}};
}

/// An object of named values.
template <class Value>
Json named(const std::vector<std::pair<std::string, Value>>& values) {
  Json json = Json::object();
  for (const auto& [name, value] : values) add(json, name, value);
  return json;
}

Json to_json(const SystemSnapshot& snapshot) {
  return {{"t", snapshot.time}, {"q", named(snapshot.q)}, {"v", named(snapshot.v)}, {"points", named(snapshot.points)}};
}

Json to_json(const Ending& ending) {
  Json json{{"status", ending.status}};
  if (!ending.event.empty()) json["event"] = ending.event;
  if (!ending.ok()) json["message"] = ending.message;
  if (ending.step) return json;
  json["t"] = ending.step.time;
  json["step"] = ending.step.step;
  json["iterations"] = ending.step.iterations;
  json["residual"] = ending.step.residual;
  if (ending.coordinate.empty()) {
    json["link"] = where(ending.step.part >= 0 && ending.step.status != Status::stuck_at_switch, ending.step.part + 1);
  } else {
    json["coordinate"] = ending.coordinate;
  }
  return json;
}

Json constraint_errors(const Summary& summary) {
  const Statistics& of = summary.statistics;
  return where(summary.model.constraints > 0,
               Json{{"position", of.constraint_error}, {"rate", of.constraint_rate_error}});
}

/// A time; null if the event never happened.
Json events_json(const Summary& summary) {
  Json json = Json::array();
  for (std::size_t k = 0; k < summary.events.size(); ++k) {
    const EventTally& tally = summary.events[k];
    json.push_back(
        {{"name", summary.event_names[k]}, {"count", tally.count}, {"first", tally.first}, {"last", tally.last}});
  }
  return json;
}

/// A key, and its value.
struct JsonRow {
  SummaryKey key;
  Json (*value)(const Summary&);
};

constexpr std::string_view natural_schema =
    R"({"type": ["object", "null"], "required": ["length", "mass", "time"], "additionalProperties": {"type": "number"}})";
constexpr std::string_view parameters_schema =
    R"({"type": "object", "additionalProperties": {"type": "array", "items": {"type": "number"}}})";
constexpr std::string_view numbers_schema = R"({"type": "object", "additionalProperties": {"type": "number"}})";
constexpr std::string_view constraint_schema = R"({"type": ["object", "null"], "required": ["position", "rate"],
  "properties": {"position": {"type": "number"}, "rate": {"type": "number"}}, "additionalProperties": false})";
constexpr std::string_view outcome_schema = R"({"type": "object", "required": ["status"],
  "properties": {
    "status": {"enum": ["ok", "stopped_by_event", "not_converged", "wrong_root", "tolerance_not_met", "not_finite",
                        "singular_mass_matrix", "interrupted", "stuck_at_switch", "output_failed"]},
    "event": {"type": "string"}, "message": {"type": "string"},
    "t": {"type": "number"}, "step": {"type": "number"}, "iterations": {"type": "integer"},
    "residual": {"type": ["number", "null"]}, "link": {"type": ["integer", "null"]}, "coordinate": {"type": "string"}},
  "additionalProperties": false})";
constexpr std::string_view events_schema = R"({"type": "array", "items": {
  "type": "object", "required": ["name", "count", "first", "last"],
  "properties": {"name": {"type": "string"}, "count": {"type": "integer"},
                 "first": {"type": ["number", "null"]}, "last": {"type": ["number", "null"]}},
  "additionalProperties": false}})";
constexpr std::string_view texts_schema = R"({"type": "array", "items": {"type": "string"}})";
constexpr std::string_view final_schema = R"({"type": "object", "required": ["t", "q", "v", "points"],
  "properties": {
    "t": {"type": "number"},
    "q": {"type": "object", "additionalProperties": {"type": ["number", "null"]}},
    "v": {"type": "object", "additionalProperties": {"type": ["number", "null"]}},
    "points": {"type": "object", "additionalProperties": {"type": "array", "items": {"type": ["number", "null"]}}},
    "theta": {"$ref": "#/$defs/links"}, "phi": {"$ref": "#/$defs/links"},
    "theta_dot": {"$ref": "#/$defs/links"}, "phi_dot": {"$ref": "#/$defs/links"},
    "bobs": {"type": "array", "items": {"$ref": "#/$defs/links"}},
    "velocities": {"type": "array", "items": {"$ref": "#/$defs/links"}}},
  "additionalProperties": false})";

constexpr std::array<std::string_view, 2> chain_spaces = {Planar::name, Spatial::name},
                                          unit_systems = {"SI", "natural"};
constexpr SummaryScope anything = SummaryScope::anything, chains = SummaryScope::chains,
                       systems = SummaryScope::systems;

constexpr std::array<JsonRow, 48> rows = {{
    {{"pendula", "string", "version"}, [](const Summary&) { return Json(version); }},
    {{"scenario", "string", "file, as it was named"}, [](const Summary& s) { return Json(s.model.scenario); }},
    {{"space", "string", "planar or spatial", "", chains, chain_spaces},
     [](const Summary& s) { return Json(s.model.space); }},
    {{"model", "string", "name of the model", "", systems}, [](const Summary& s) { return Json(s.model.model); }},
    {{"links", "integer", "how many"}, [](const Summary& s) { return Json(s.model.links); }},
    {{"units", "string", "of all numbers", "", chains, unit_systems},
     [](const Summary& s) { return Json(s.model.natural ? "natural" : "SI"); }},
    {{"natural_units", natural_schema, "length, mass and time in SI; null with SI units", "", chains},
     [](const Summary& s) { return to_json(s.model.natural); }},
    {{"parameters", parameters_schema, "of the model, by name", "", systems},
     [](const Summary& s) { return named(s.model.parameters); }},
    {{"degrees_of_freedom", "integer", "coordinates less the constraints that do not follow from others at the start"},
     [](const Summary& s) { return Json(s.model.degrees_of_freedom); }},
    {{"closed_by", "number null", "largest change of an angle by which the start came to where the end is held", "rad",
      chains},
     [](const Summary& s) { return where(s.model.constraints > 0 && !s.model.hangs, s.model.closed_by); }},
    {{"assembled", numbers_schema, "coordinates and rates of the start that constraints gave", "", systems},
     [](const Summary& s) { return named(s.model.assembled); }},
    {{"guesses", numbers_schema, "of these coordinates, from which they were found", "", systems},
     [](const Summary& s) { return named(s.model.guesses); }},
    {{"constraint_error", constraint_schema, "largest after a step, each in its unit; null without constraints"},
     [](const Summary& s) { return constraint_errors(s); }},
    {{"feedback", texts_schema, "inputs that have some"}, [](const Summary& s) { return Json(s.model.feedback); }},
    {{"signals", texts_schema, "inputs that follow some"}, [](const Summary& s) { return Json(s.model.signals); }},
    {{"method", "string", "that moved it", "", anything, names_of<Method>},
     [](const Summary& s) { return Json(name_of(s.options.method)); }},
    {{"method_reason", "string null", "why, where the scenario leaves it to the program"},
     [](const Summary& s) { return or_null(s.method_reason); }},
    {{"stages", "integer null", "of gauss and radau"},
     [](const Summary& s) { return where(has_stages(s), s.options.stages); }},
    {{"form", "string null", "of gauss and radau", "", anything, names_of<Form>},
     [](const Summary& s) { return where(has_stages(s), name_of(s.options.form)); }},
    {{"solver", "string null", "what solved stage equations"},
     [](const Summary& s) { return or_null(s.description.solver); }},
    {{"iteration", "string null", "how it did"}, [](const Summary& s) { return or_null(s.description.iteration); }},
    {{"kernel", "string null", "the kernel in use"}, [](const Summary& s) { return or_null(s.description.kernel); }},
    {{"kernel_by", "string null", "how the kernel came: build, compiler, llvm or interpreter"},
     [](const Summary& s) { return where(!s.description.kernel.empty(), s.kernel_by); }},
    {{"step", "number null", "constant steps, in place of a tolerance", "s"},
     [](const Summary& s) { return where(!chooses_steps(s), s.options.step); }},
    {{"tolerance", "number null", "that the run went by"},
     [](const Summary& s) { return where(chooses_steps(s), s.options.tolerance); }},
    {{"accuracy", "number null", "as asked for"},
     [](const Summary& s) { return where(s.aimed.has_value(), s.asked.accuracy.error); }},
    {{"expected_error", "number null", "largest error of all rows; null where it is not known"},
     [](const Summary& s) { return Json(s.trust.expected_error); }},
    {{"trusted_until", "number null", "from then on rows may be off by more than was asked for; null: none is", "s"},
     [](const Summary& s) { return Json(s.trust.until); }},
    {{"duration", "number", "as in the scenario", "s"}, [](const Summary& s) { return Json(s.asked.duration); }},
    {{"every", "integer null", "steps from row to row"},
     [](const Summary& s) { return where(!s.asked.rows.any(), s.asked.every); }},
    {{"interval", "number null", "time from row to row", "s"},
     [](const Summary& s) { return where(s.asked.rows.interval > 0, s.asked.rows.interval); }},
    {{"steps", "integer", "that were taken"}, [](const Summary& s) { return Json(s.statistics.steps); }},
    {{"smallest_step", "number null", "of the method's own choice", "s"},
     [](const Summary& s) { return where(chooses_steps(s), s.statistics.smallest_step); }},
    {{"largest_step", "number null", "of the method's own choice", "s"},
     [](const Summary& s) { return where(chooses_steps(s), s.statistics.largest_step); }},
    {{"rejected_steps", "integer", "that were taken again, shorter"},
     [](const Summary& s) { return Json(s.statistics.rejected_steps); }},
    {{"newton_iterations", "integer", "of all steps"},
     [](const Summary& s) { return Json(s.statistics.newton_iterations); }},
    {{"rows", "integer", "in the trajectory file; without one, those that were taken"},
     [](const Summary& s) { return Json(s.trajectory ? s.rows_written : s.rows); }},
    {{"trajectory", "string null", "file, as it was named; - is standard output"},
     [](const Summary& s) { return or_null(s.trajectory.value_or("")); }},
    {{"view", "string null", "page, as it was named"}, [](const Summary& s) { return or_null(s.view.value_or("")); }},
    {{"film", "string null", "film, as it was named"}, [](const Summary& s) { return or_null(s.film.value_or("")); }},
    {{"energy_initial", "number null", "H of the first row", "J"},
     [](const Summary& s) { return Json(s.energy_error.initial); }},
    {{"energy_final", "number null", "H of the last row", "J"}, [](const Summary& s) { return Json(s.energy_final); }},
    {{"energy_error_max", "number null", "largest |H - H_0| of the rows, by the scale of the energy"},
     [](const Summary& s) { return Json(s.energy_error.largest); }},
    {{"wall_seconds", "number null", "in the stepping loop alone", "s"},
     [](const Summary& s) { return Json(s.stepping_seconds); }},
    {{"outcome", outcome_schema, "status, and what failed"}, [](const Summary& s) { return to_json(s.ending); }},
    {{"events", events_schema, "name, count, first and last time of each [[event]]"}, events_json},
    {{"warnings", texts_schema, "sentences, the same as on standard error"},
     [](const Summary& s) { return Json(s.warnings); }},
    {{"final", final_schema, "the last state: t, q, v, points; of chains arrays besides, one element a link"},
     [](const Summary& s) { return s.model.space.empty() ? to_json(s.system) : to_json(s.final); }},
}};
/// Whether a key is there.
bool applies(const SummaryKey& key, const Summary& summary) {
  return key.of == anything || (key.of == chains) != summary.model.space.empty();
}

Json json_of(const Summary& summary) {
  Json json;
  for (const JsonRow& row : rows) {
    if (applies(row.key, summary)) json[row.key.name] = row.value(summary);
  }
  return json;
}

/// Types of values.
Json schema_of(const SummaryKey& key) {
  Json schema;
  if (key.type.starts_with('{')) {
    schema = Json::parse(key.type);
  } else {
    std::istringstream types{std::string(key.type)};
    for (std::string type; types >> type;) schema["type"].push_back(type);
  }
  for (const std::string_view choice : key.choices) schema["enum"].push_back(choice);
  if (!key.choices.empty() && key.type.ends_with("null")) schema["enum"].push_back(nullptr);
  schema["description"] = std::string(key.hint) + (key.unit.empty() ? "" : " [" + std::string(key.unit) + "]");
  return schema;
}

/// Names of keys of one kind.
Json names(SummaryScope of) {
  Json all = Json::array();
  for (const JsonRow& row : rows) {
    if (row.key.of == of) all.push_back(row.key.name);
  }
  return all;
}

std::string one_line(const Json& json) {
  constexpr int without_indent = -1;
  return json.dump(without_indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::vector<SummaryKey> summary_keys() {
  std::vector<SummaryKey> keys(rows.size());
  std::ranges::transform(rows, keys.begin(), &JsonRow::key);
  return keys;
}

std::string summary_schema() {
  Json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
              {"title", "Summary of pendula simulate --json"},
              {"type", "object"},
              {"required", names(anything)},
              {"oneOf", {{{"required", names(chains)}}, {{"required", names(systems)}}}},
              {"properties", Json::object()},
              {"additionalProperties", false},
              {"$defs", {{"links", {{"type", "array"}, {"items", {{"type", {"number", "null"}}}}}}}}};
  for (const JsonRow& row : rows) schema["properties"][row.key.name] = schema_of(row.key);
  return schema.dump(2) + "\n";
}

std::string to_json(const Summary& summary) {
  return one_line(json_of(summary)) + "\n";
}

std::string to_json_of_file(const Summary& summary) {
  Json json = json_of(summary);
  json.erase("final");
  std::string text = one_line(json);
  for (const std::optional<std::string>& file :
       {std::optional(summary.model.scenario), summary.trajectory, summary.view, summary.film, summary.event_file}) {
    if (file) text = with_public_name(std::move(text), *file);
  }
  return text;
}

}  // namespace pendula::io
