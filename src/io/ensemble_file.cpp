#include "io/ensemble_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <utility>
#include <variant>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/hdf5.hpp"
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

namespace {

using hdf5::Type;

/// The position of a data set in its file; it has one number for each member.
struct Stored {
  std::uint64_t offset = 0;
  Type type = Type::real;
};

/// A file that is written at given positions.
class Bytes {
 public:
  Bytes(const std::string& file, const std::string& name)
      : name_(name), descriptor_(open(file.c_str(), O_WRONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) throw OutputError(name, errno);
  }
  ~Bytes() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;

  void write(const void* bytes, std::size_t size, std::uint64_t offset) const {
    const char* at = static_cast<const char*>(bytes);
    while (size > 0) {
      const ssize_t written = pwrite(descriptor_, at, size, static_cast<off_t>(offset));
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) throw OutputError(name_, written < 0 ? errno : ENOSPC);
      at += written;
      offset += static_cast<std::uint64_t>(written);
      size -= static_cast<std::size_t>(written);
    }
  }

  void close() {
    const bool synced = fsync(descriptor_) == 0;
    if (::close(std::exchange(descriptor_, -1)) != 0 || !synced) throw OutputError(name_, errno);
  }

 private:
  std::string name_;
  int descriptor_;
};

/// Writes one column of a chunk.
class Columns {
 public:
  Columns(const Bytes& bytes, const EnsembleHead& head) : bytes_(bytes), width_(head.width()) {}

  void write(const DoneChunk& chunk, std::size_t column, const Stored& place) {
    switch (place.type) {
      case Type::real:
        return write_as<double>(chunk, column, place);
      case Type::whole:
        return write_as<std::int64_t>(chunk, column, place);
      case Type::byte:
        return write_as<std::int8_t>(chunk, column, place);
    }
  }

 private:
  template <class Number>
  void write_as(const DoneChunk& chunk, std::size_t column, const Stored& place) {
    packed_.resize(static_cast<std::size_t>(chunk.members.size()) * sizeof(Number));
    for (std::size_t k = 0; k < packed_.size() / sizeof(Number); ++k) {
      const auto number = stored<Number>(chunk.rows[k * width_ + column]);
      std::memcpy(packed_.data() + k * sizeof(Number), &number, sizeof(Number));
    }
    bytes_.write(packed_.data(), packed_.size(),
                 place.offset + static_cast<std::uint64_t>(chunk.members.first) * sizeof(Number));
  }

  const Bytes& bytes_;
  std::size_t width_;
  std::vector<char> packed_;
};

/// Which chunks the journals have, and their messages.
struct Found {
  EnsembleTally tally;
  std::vector<DoneChunk::Message> messages;  // by member
};

/// Calls take(chunk) once for each chunk that is done.
template <class Take>
void for_each_done(const std::string& folder, const EnsembleHead& head, Take take) {
  std::vector<bool> seen(static_cast<std::size_t>(head.chunks()));
  read_journals(folder, head.kind(), [&](const DoneChunk& chunk) {
    const std::int64_t k = chunk.members.first / head.chunk;
    if (k >= head.chunks() || head.members_of(k).first != chunk.members.first ||
        head.members_of(k).last != chunk.members.last || seen[static_cast<std::size_t>(k)]) {
      return;
    }
    seen[static_cast<std::size_t>(k)] = true;
    take(chunk);
  });
}

Found look_through(const std::string& folder, const EnsembleHead& head) {
  Found found;
  for_each_done(folder, head, [&](const DoneChunk& chunk) {
    found.tally.add(chunk, head.width());
    found.messages.insert(found.messages.end(), chunk.messages.begin(), chunk.messages.end());
  });
  std::ranges::sort(found.messages, {}, &DoneChunk::Message::member);
  return found;
}

/// Makes scales of the axes, with their values, and empty data sets in the shape of the members. Returns the position
/// of each, 0 for axes.
std::vector<Stored> create_arrays(const hdf5::Handle& file, const EnsembleHead& head,
                                  const std::vector<EnsembleArray>& arrays) {
  const std::vector<std::int64_t> shape = head.plan.shape();
  std::vector<hdf5::Handle> scales;
  std::vector<Stored> places;
  for (const EnsembleArray& array : arrays) {
    const bool is_axis = array.source == EnsembleArray::Source::axis;
    hdf5::Handle dataset = is_axis ? hdf5::create_vector(file, array.name, head.plan.axes[array.index].all())
                                   : hdf5::create_array(file, array.name, shape, array.type);
    hdf5::write_attribute(dataset, "long_name", array.meaning);
    if (!array.unit.empty()) write_unit(dataset, head.natural, array.unit);
    if (!array.flags.empty()) hdf5::write_flags(dataset, array.type, -1, array.flags);
    places.push_back({is_axis ? 0 : hdf5::offset_of(dataset), array.type});
    if (array.is_scale()) {
      hdf5::make_scale(dataset, array.name);
      scales.push_back(std::move(dataset));
    } else {
      for (unsigned k = 0; k < scales.size(); ++k) hdf5::attach_scale(dataset, scales[k], k);
    }
  }
  return places;
}

void write_failures(const hdf5::Handle& file, const std::vector<DoneChunk::Message>& messages) {
  std::vector<double> members;
  std::vector<std::string> texts;
  for (const DoneChunk::Message& message : messages) {
    members.push_back(static_cast<double>(message.member));
    texts.push_back(message.text);
  }
  if (members.empty()) return;
  const hdf5::Handle scale = hdf5::create_vector(file, "failed_member", members);
  hdf5::make_scale(scale, "failed_member");
  hdf5::attach_scale(hdf5::create_texts(file, "message", texts), scale, 0);
}

/// Writes the numbers of members, and the values of keys that each member has for itself.
void write_draws(const Bytes& bytes, const EnsembleHead& head, const std::vector<EnsembleArray>& arrays,
                 const std::vector<Stored>& places) {
  if (head.plan.draws.empty()) return;
  for (std::int64_t k = 0; k < head.chunks(); ++k) {
    const Chunk members = head.members_of(k);
    const auto count = static_cast<std::size_t>(members.size());
    std::vector<std::int64_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), members.first);
    std::vector<std::vector<double>> values;
    values.reserve(count);
    for (const std::int64_t member : numbers) values.push_back(head.plan.values(member));
    for (std::size_t j = 0; j < arrays.size(); ++j) {
      const std::uint64_t at = places[j].offset + static_cast<std::uint64_t>(members.first) * sizeof(double);
      if (arrays[j].source == EnsembleArray::Source::number) bytes.write(numbers.data(), count * sizeof(double), at);
      if (arrays[j].source != EnsembleArray::Source::draw) continue;
      std::vector<double> column;
      column.reserve(count);
      for (const std::vector<double>& each : values) column.push_back(each[arrays[j].index]);
      bytes.write(column.data(), count * sizeof(double), at);
    }
  }
}

}  // namespace

int member_status(std::string_view name) {
  const auto found = std::ranges::find(member_statuses, name);
  return static_cast<int>((found == member_statuses.end() ? std::ranges::find(member_statuses, "failed") : found) -
                          member_statuses.begin());
}

void EnsembleTally::add(const DoneChunk& chunk, std::size_t width) {
  done += chunk.members.size();
  for (std::int64_t k = 0; k < chunk.members.size(); ++k) {
    const double* const row = &chunk.rows[static_cast<std::size_t>(k) * width];
    ++statuses.at(static_cast<std::size_t>(row[0]));
    if (std::isnan(row[1])) continue;
    ++looked_at;
    if (row[1] != static_cast<double>(Trusted::no)) continue;
    const std::int64_t member = chunk.members.first + k;
    if (untrusted++ == 0 || member < first_untrusted) first_untrusted = member;
  }
  for (const DoneChunk::Message& message : chunk.messages) {
    if (first_failure.member < 0 || message.member < first_failure.member) first_failure = message;
  }
}

Chunk EnsembleHead::members_of(std::int64_t k) const {
  return {k * chunk, std::min((k + 1) * chunk, plan.count)};
}

JournalKind EnsembleHead::kind() const {
  std::string text = origin.version + '\n' + origin.instruction_set + '\n' + origin.scenario + '\n' + origin.model;
  for (const std::string& change : origin.overrides) text += '\n' + change;
  text += '\n' + std::to_string(chunk) + " trusted";  // older files lack it
  return {fingerprint(text), width()};
}

std::vector<bool> done_chunks(const std::string& folder, const EnsembleHead& head) {
  std::vector<bool> done(static_cast<std::size_t>(head.chunks()));
  for_each_done(folder, head, [&](const DoneChunk& chunk) {
    done[static_cast<std::size_t>(chunk.members.first / head.chunk)] = true;
  });
  return done;
}

bool is_complete(const std::string& file, const EnsembleHead& head) {
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(file, unknown)) return false;
  hdf5::begin();
  try {
    const hdf5::Handle opened = hdf5::open_file(file);
    return hdf5::read_number(opened, "ensemble") == static_cast<std::int64_t>(head.kind().ensemble) &&
           hdf5::read_number(opened, "complete") == 1;
  } catch (const hdf5::Error&) {
    return false;
  }
}

EnsembleTally write_ensemble(const std::string& file, const EnsembleHead& head, const std::string& folder) {
  const Found found = look_through(folder, head);
  const std::string target = link_target(file), part = folder + "/whole" + std::to_string(getpid()) + ".h5";
  const std::vector<EnsembleArray> arrays = arrays_of(head);
  std::vector<Stored> places;
  hdf5::begin();
  try {
    hdf5::Handle opened = hdf5::create_file(part);
    for (const auto& [name, value] : attributes_of(head, found.tally.done)) {
      std::visit([&, &key = name](const auto& one) { hdf5::write_attribute(opened, key, one); }, value);
    }
    places = create_arrays(opened, head, arrays);
    write_failures(opened, found.messages);
    if (!opened.close()) throw hdf5::Error();
    Bytes bytes(part, file);
    Columns columns(bytes, head);
    for_each_done(folder, head, [&](const DoneChunk& chunk) {
      for (std::size_t k = 0; k < arrays.size(); ++k) {
        if (arrays[k].source == EnsembleArray::Source::row) columns.write(chunk, arrays[k].index, places[k]);
      }
    });
    write_draws(bytes, head, arrays, places);
    bytes.close();
  } catch (const hdf5::Error& error) {
    unlink(part.c_str());
    throw OutputError(file, error.what());
  } catch (...) {
    unlink(part.c_str());
    throw;
  }
  if (std::rename(part.c_str(), target.c_str()) != 0) throw OutputError(file, errno);
  return found.tally;
}

}  // namespace pendula::io
