#include "io/run_origin.hpp"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "io/errors.hpp"
#include "io/fingerprint.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
namespace {

/// Fingerprint of what a run began with. Versions and solvers are not in it: a resumed run compares them itself.
std::uint64_t fingerprint_of(const RunOrigin& origin) {
  std::vector<std::string> texts = {origin.history, origin.scenario_name, origin.scenario, origin.model};
  texts.insert(texts.end(), origin.overrides.begin(), origin.overrides.end());
  std::uint64_t hash = empty_fingerprint;
  for (const std::string& text : texts) hash = fingerprint(text, fingerprint(std::to_string(text.size()) + ':', hash));
  return hash;
}

/// Reads a word, such as the name of a kernel; it may be empty. Throws ChangedFile.
std::string read_word(const hdf5::Handle& object, const std::string& name) {
  std::string word = hdf5::read_attribute(object, name);
  if (!std::ranges::all_of(word, [](char c) { return c > ' ' && c < '\x7f'; })) {
    throw ChangedFile("one whose attribute \"" + name + "\" is damaged");
  }
  return word;
}

}  // namespace

hdf5::Handle write_origin(const hdf5::Handle& file, const RunOrigin& origin) {
  hdf5::write_attribute(file, "Conventions", "CF-1.11");
  hdf5::write_attribute(file, "title", origin.title);
  RunOrigin written = origin;
  if (!written.history.empty()) written.history += '\n';
  written.history += history_line(origin.command);
  hdf5::write_attribute(file, "history", written.history);
  hdf5::write_attribute(file, "source", "pendula " + origin.version);
  hdf5::write_attribute(file, "pendula", origin.version);
  hdf5::write_attribute(file, "instruction_set", origin.instruction_set);
  hdf5::write_attribute(file, "solver", origin.solver);
  hdf5::write_attribute(file, "kernel", origin.kernel);
  hdf5::Handle run = hdf5::create_group(file, "run");
  hdf5::write_attribute(run, "scenario_file", origin.scenario_name);
  hdf5::write_text(run, "scenario", origin.scenario);
  hdf5::write_text(run, "set", nlohmann::json(origin.overrides).dump());
  hdf5::write_text(run, "model", origin.model);
  hdf5::write_attribute(run, "checksum", static_cast<std::int64_t>(fingerprint_of(written)));
  return run;
}

RunOrigin read_origin(const hdf5::Handle& file, const hdf5::Handle& run) {
  RunOrigin origin;
  origin.version = read_word(file, "pendula");
  origin.instruction_set = read_word(file, "instruction_set");
  origin.solver = read_word(file, "solver");
  origin.kernel = read_word(file, "kernel");
  if (hdf5::has_attribute(file, "history")) origin.history = hdf5::read_attribute(file, "history");
  origin.scenario_name = hdf5::read_attribute(run, "scenario_file");
  origin.scenario = hdf5::read_text(run, "scenario");
  origin.overrides = nlohmann::json::parse(hdf5::read_text(run, "set")).get<std::vector<std::string>>();
  origin.model = hdf5::read_text(run, "model");
  return origin;
}

void require_written(const RunOrigin& origin, const hdf5::Handle& run) {
  if (static_cast<std::uint64_t>(hdf5::read_number(run, "checksum")) == fingerprint_of(origin)) return;
  throw ChangedFile("one whose scenario, settings or model are not what it was written with");
}

}  // namespace pendula::io
