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
#include <pendula/numeric/number_text.hpp>
#include <set>
#include <utility>

#include "io/fingerprint.hpp"
#include "io/hdf5.hpp"
#include "io/link_target.hpp"
#include "io/output_error.hpp"
#include "io/provenance.hpp"

namespace pendula::io {
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
      const double value = chunk.rows[k * width_ + column];
      const auto number =
          std::is_floating_point_v<Number> || !std::isnan(value) ? static_cast<Number>(value) : Number(-1);
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
  EnsembleTally& tally = found.tally;
  for_each_done(folder, head, [&](const DoneChunk& chunk) {
    tally.done += chunk.members.size();
    for (std::int64_t k = 0; k < chunk.members.size(); ++k) {
      const double* const row = &chunk.rows[static_cast<std::size_t>(k) * head.width()];
      ++tally.statuses.at(static_cast<std::size_t>(row[0]));
      if (std::isnan(row[1])) continue;
      ++tally.looked_at;
      if (row[1] != static_cast<double>(Trusted::no)) continue;
      const std::int64_t member = chunk.members.first + k;
      if (tally.untrusted++ == 0 || member < tally.first_untrusted) tally.first_untrusted = member;
    }
    found.messages.insert(found.messages.end(), chunk.messages.begin(), chunk.messages.end());
  });
  std::ranges::sort(found.messages, {}, &DoneChunk::Message::member);
  if (!found.messages.empty()) found.tally.first_failure = found.messages.front();
  return found;
}

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

void write_origin(const hdf5::Handle& file, const EnsembleHead& head, const EnsembleTally& tally) {
  const RunOrigin& origin = head.origin;
  hdf5::write_attribute(file, "Conventions", "CF-1.11");
  hdf5::write_attribute(file, "title", origin.title);
  hdf5::write_attribute(file, "history", history_line(origin.command));
  hdf5::write_attribute(file, "source", "pendula " + origin.version);
  hdf5::write_attribute(file, "pendula", origin.version);
  hdf5::write_attribute(file, "kind", "ensemble");
  hdf5::write_attribute(file, "instruction_set", origin.instruction_set);
  hdf5::write_attribute(file, "scenario_file", origin.scenario_name);
  hdf5::write_attribute(file, "scenario", origin.scenario);
  hdf5::write_attribute(file, "set", nlohmann::json(origin.overrides).dump());
  hdf5::write_attribute(file, "model", origin.model);
  hdf5::write_attribute(file, "ensemble", static_cast<std::int64_t>(head.kind().ensemble));
  hdf5::write_attribute(file, "members", head.plan.count);
  hdf5::write_attribute(file, "members_done", tally.done);
  hdf5::write_attribute(file, "complete", std::int64_t{tally.done == head.plan.count});
}

/// Writes the long name of a data set, and its unit if known.
void describe(const hdf5::Handle& array, const std::string& meaning, const EnsembleHead& head,
              const std::string& unit) {
  hdf5::write_attribute(array, "long_name", meaning);
  if (!unit.empty()) write_unit(array, head.natural, unit);
}

/// Makes the scales of the axes, or of the members; numbers of members are written later, since they may not fit into
/// memory.
std::vector<hdf5::Handle> write_scales(const hdf5::Handle& file, const EnsembleHead& head, Words& words) {
  const EnsemblePlan& plan = head.plan;
  std::vector<hdf5::Handle> scales;
  for (const EnsembleAxis& axis : plan.axes) {
    std::vector<double> values(static_cast<std::size_t>(axis.count));
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = axis.at(static_cast<std::int64_t>(k));
    const std::string name = words.of(axis.key);
    scales.push_back(hdf5::create_vector(file, name, values));
    describe(scales.back(), axis.key, head, unit_of_key(axis.key));
    hdf5::make_scale(scales.back(), name);
  }
  if (!scales.empty()) return scales;
  scales.push_back(hdf5::create_array(file, "member", plan.shape(), Type::whole));
  describe(scales.back(), "number of the member", head, "1");
  hdf5::make_scale(scales.back(), "member");
  return scales;
}

/// Makes empty data sets, and notes their positions: flags, columns, and for random members their numbers and keys.
std::vector<Stored> create_columns(const hdf5::Handle& file, const EnsembleHead& head) {
  Words words;
  const std::vector<hdf5::Handle> scales = write_scales(file, head, words);
  const std::vector<std::int64_t> shape = head.plan.shape();
  std::vector<Stored> places;
  const auto create = [&](const std::string& name, const std::string& meaning, const std::string& unit, Type type) {
    hdf5::Handle dataset = hdf5::create_array(file, name, shape, type);
    describe(dataset, meaning, head, unit);
    for (unsigned k = 0; k < scales.size(); ++k) hdf5::attach_scale(dataset, scales[k], k);
    places.push_back({hdf5::offset_of(dataset), type});
    return dataset;
  };
  const hdf5::Handle status = create("status", "how the member ended", "", Type::byte);
  std::vector<std::string> meanings{"not_run"};
  meanings.insert(meanings.end(), member_statuses.begin(), member_statuses.end());
  hdf5::write_flags(status, Type::byte, not_run, meanings);
  const hdf5::Handle trusted = create("trusted", "whether a second look at the member agrees", "", Type::byte);
  hdf5::write_flags(trusted, Type::byte, -1, std::array<std::string, 3>{"not_looked_at", "no", "yes"});
  std::vector<Stored> drawn;
  for (const EnsembleDraw& draw : head.plan.draws) {
    create(words.of(draw.key), draw.key, unit_of_key(draw.key), Type::real);
    drawn.push_back(places.back());
    places.pop_back();
  }
  for (const EnsembleColumn& column : head.columns) {
    create(words.of(column.name), column.meaning.empty() ? column.name : column.meaning, column.unit,
           column.whole ? Type::whole : Type::real);
  }
  if (head.plan.axes.empty()) places.push_back({hdf5::offset_of(scales.front()), Type::whole});
  places.insert(places.end(), drawn.begin(), drawn.end());
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

/// Writes the numbers of random members, and the values drawn for each.
void write_draws(const Bytes& bytes, const EnsembleHead& head, std::span<const Stored> places) {
  if (places.empty()) return;
  std::vector<std::int64_t> numbers;
  std::vector<std::vector<double>> keys(places.size() - 1);
  for (std::int64_t k = 0; k < head.chunks(); ++k) {
    const Chunk members = head.members_of(k);
    const std::uint64_t before = static_cast<std::uint64_t>(members.first) * sizeof(double);
    numbers.resize(static_cast<std::size_t>(members.size()));
    std::iota(numbers.begin(), numbers.end(), members.first);
    bytes.write(numbers.data(), numbers.size() * sizeof(std::int64_t), places.front().offset + before);
    for (auto& column : keys) column.clear();
    for (const std::int64_t member : numbers) {
      const std::vector<double> drawn = head.plan.values(member);
      for (std::size_t j = 0; j < keys.size(); ++j) keys[j].push_back(drawn[j]);
    }
    for (std::size_t j = 0; j < keys.size(); ++j) {
      bytes.write(keys[j].data(), keys[j].size() * sizeof(double), places[j + 1].offset + before);
    }
  }
}

}  // namespace

int member_status(std::string_view name) {
  const auto found = std::ranges::find(member_statuses, name);
  return static_cast<int>((found == member_statuses.end() ? std::ranges::find(member_statuses, "failed") : found) -
                          member_statuses.begin());
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
  std::vector<Stored> places;
  hdf5::begin();
  try {
    hdf5::Handle opened = hdf5::create_file(part);
    write_origin(opened, head, found.tally);
    places = create_columns(opened, head);
    write_failures(opened, found.messages);
    if (!opened.close()) throw hdf5::Error();
    Bytes bytes(part, file);
    Columns columns(bytes, head);
    const std::size_t kept = head.width();
    for_each_done(folder, head, [&](const DoneChunk& chunk) {
      for (std::size_t k = 0; k < kept; ++k) columns.write(chunk, k, places[k]);
    });
    write_draws(bytes, head, std::span(places).subspan(kept));
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
