#include "io/ensemble_arrays.hpp"

#include <cctype>
#include <nlohmann/json.hpp>
#include <set>

#include "io/provenance.hpp"

namespace pendula::io {
namespace {

/// Names of data sets for the names as typed: letters, digits and single underscores; each name occurs once.
class Words {
 public:
  std::string of(const std::string& typed) {
    std::string word;
    for (const char c : typed) {
      const bool fits = std::isalnum(static_cast<unsigned char>(c)) != 0;
      if (fits || (!word.empty() && word.back() != '_')) word += fits ? c : '_';
    }
    if (word.ends_with('_')) word.pop_back();
    std::string other = word;
    for (int number = 2; !taken_.insert(other).second; ++number) other = word + "_" + std::to_string(number);
    return other;
  }

 private:
  std::set<std::string> taken_ = {"status", "trusted", "member", "failed_member", "message"};
};

}  // namespace

std::vector<EnsembleArray> arrays_of(const EnsembleHead& head) {
  using enum EnsembleArray::Source;
  using hdf5::Type;
  const EnsemblePlan& plan = head.plan;
  Words words;
  std::vector<EnsembleArray> arrays;
  for (std::size_t k = 0; k < plan.axes.size(); ++k) {
    const std::string& key = plan.axes[k].key;
    arrays.push_back({words.of(key), key, unit_of_key(key), Type::real, axis, k, {}});
  }
  if (arrays.empty()) arrays.push_back({"member", "number of the member", "1", Type::whole, number, 0, {}});
  std::vector<std::string> ends{"not_run"};
  ends.insert(ends.end(), member_statuses.begin(), member_statuses.end());
  arrays.push_back({"status", "how the member ended", "", Type::byte, row, 0, std::move(ends)});
  arrays.push_back({"trusted",
                    "whether a second look at the member agrees",
                    "",
                    Type::byte,
                    row,
                    1,
                    {"not_looked_at", "no", "yes"}});
  for (std::size_t k = 0; k < plan.draws.size(); ++k) {
    const std::string& key = plan.draws[k].key;
    arrays.push_back({words.of(key), key, unit_of_key(key), Type::real, draw, k, {}});
  }
  for (std::size_t k = 0; k < head.columns.size(); ++k) {
    const EnsembleColumn& column = head.columns[k];
    arrays.push_back({words.of(column.name),
                      column.meaning.empty() ? column.name : column.meaning,
                      column.unit,
                      column.whole ? Type::whole : Type::real,
                      row,
                      EnsembleHead::flags + k,
                      {}});
  }
  return arrays;
}

std::vector<EnsembleAttribute> attributes_of(const EnsembleHead& head, std::int64_t done) {
  const RunOrigin& origin = head.origin;
  return {{"Conventions", "CF-1.11"},
          {"title", origin.title},
          {"history", history_line(origin.command)},
          {"source", "pendula " + origin.version},
          {"pendula", origin.version},
          {"kind", "ensemble"},
          {"instruction_set", origin.instruction_set},
          {"scenario_file", origin.scenario_name},
          {"scenario", origin.scenario},
          {"set", nlohmann::json(origin.overrides).dump()},
          {"model", origin.model},
          {"ensemble", static_cast<std::int64_t>(head.kind().ensemble)},
          {"members", head.plan.count},
          {"members_done", done},
          {"complete", std::int64_t{done == head.plan.count}}};
}

}  // namespace pendula::io
