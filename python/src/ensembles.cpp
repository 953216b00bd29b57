// Many motions at once.

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>
#include <pendula/ensemble/chunks.hpp>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "interruption.hpp"
#include "io/ensemble_file.hpp"
#include "io/ensemble_job.hpp"
#include "io/ensemble_output.hpp"
#include "io/journal.hpp"
#include "io/run_arrays.hpp"
#include "prepared.hpp"
#include "toolchain.hpp"

namespace pendula::python {
namespace {

using io::EnsembleArray;
using Messages = std::vector<std::pair<std::int64_t, std::string>>;
using Done = nb::typed<nb::tuple, Array, Messages>;
using Shown = std::optional<nb::typed<nb::callable, void(std::int64_t)>>;
using ArrayText = std::tuple<std::string, std::string, std::vector<std::pair<std::string, std::string>>, int>;

Messages messages_of(const std::vector<io::DoneChunk::Message>& messages) {
  Messages found;
  for (const io::DoneChunk::Message& message : messages) found.emplace_back(message.member, message.text);
  return found;
}

template <class Number>
nb::object owned_array(std::vector<Number> numbers) {
  const std::size_t size = numbers.size();
  return nb::cast(owned<nb::ndarray<nb::numpy, Number, nb::ndim<1>>>(std::move(numbers), {size}));
}

/// An ensemble, and what came of its members, in memory.
class Ensemble {
 public:
  Ensemble(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
           const std::string& command, const std::string& program, const std::string& python, Tell tell)
      : tell_(std::move(tell)) {
    const nb::gil_scoped_release others_may_go_on;
    const io::EnsembleSource source{{name, text}, overrides, command, toolchain_of(program, python)};
    const auto say = [this](const std::string& what) {
      const nb::gil_scoped_acquire lock;
      tell_(what);
    };
    job_.emplace(source, say, [this] { return stop_.stop_requested(); });
    job_->require_members();
  }

  const io::EnsembleHead& head() const { return job_->head(); }

  /// Moves all members; `shown` is told how many are done.
  void move(int threads, const Shown& shown) {
    make_room();
    std::vector<std::int64_t> all(static_cast<std::size_t>(head().chunks()));
    std::iota(all.begin(), all.end(), 0);
    run(all, threads, 0, shown, [this](const io::DoneChunk& chunk) { take(chunk); });
  }

  /// Moves the members of chunk k, for another process. Several threads may do so.
  Done chunk(std::int64_t k) const {
    io::DoneChunk done;
    {
      const nb::gil_scoped_release others_may_go_on;
      done = job_->run(members_of(k));
    }
    return nb::make_tuple(array_of(std::move(done.rows), head().width()), messages_of(done.messages));
  }

  /// Takes what another process has found.
  void add(std::int64_t k, const Starts& rows, const Messages& messages) {
    make_room();
    io::DoneChunk chunk{members_of(k), {}, {}};
    if (rows.shape(0) != static_cast<std::size_t>(chunk.members.size()) || rows.shape(1) != head().width()) {
      throw std::invalid_argument("rows: expected those of the chunk, got an array of another shape");
    }
    chunk.rows.assign(rows.data(), rows.data() + rows.size());
    for (const auto& [member, told] : messages) chunk.messages.push_back({member, told});
    take(chunk);
  }

  /// Moves the members of a shard, or all that are missing, into journals, and writes the file. Whether it is complete.
  bool write(const std::string& file, std::optional<std::pair<int, int>> shard, bool resumes, int threads,
             const Shown& shown) {
    std::optional<io::Shard> part;
    if (shard) part = io::Shard{shard->first, shard->second};
    io::EnsembleOutput output({file, part, resumes}, head());
    output.require_writable(job_->name());
    if (output.is_complete()) {
      output.remove_journals();
      return true;
    }
    const std::vector<std::int64_t> missing = output.find_missing();
    if (output.replaces()) tell_("replacing " + file);
    {
      io::Journal journal(output.folder(), head().kind());
      try {
        run(missing, threads, output.already(), shown, [&](const io::DoneChunk& chunk) { journal.add(chunk); });
      } catch (const nb::python_error&) {
        journal.sync();
        output.write();  // what there is
        throw;
      }
      journal.sync();
    }
    const std::optional<io::EnsembleTally> found = output.write();  // Python's lock is held: HDF5 knows no threads
    if (!found) return true;
    tally_ = *found;
    return tally_.done == head().plan.count;
  }

  /// Of each data set its name, what it is, its attributes, and how many meanings its flags have.
  std::vector<ArrayText> arrays() const {
    std::vector<ArrayText> texts;
    for (const EnsembleArray& array : io::arrays_of(head())) {
      std::vector<std::pair<std::string, std::string>> attributes{{"long_name", array.meaning}};
      if (!array.unit.empty()) {
        for (const auto& unit : io::unit_attributes(head().natural, array.unit)) attributes.push_back(unit);
      }
      std::string flags;
      for (const std::string& flag : array.flags) flags += (flags.empty() ? "" : " ") + flag;
      if (!flags.empty()) attributes.emplace_back("flag_meanings", flags);
      texts.emplace_back(array.name, array.is_scale() ? "scale" : "data", std::move(attributes),
                         static_cast<int>(array.flags.size()));
    }
    return texts;
  }

  /// The numbers of data set k: of an axis its values, else one of each member.
  nb::object numbers(std::size_t k) const {
    const EnsembleArray array = io::arrays_of(head()).at(k);
    if (array.source == EnsembleArray::Source::axis) return owned_array(head().plan.axes[array.index].all());
    switch (array.type) {
      case io::hdf5::Type::real:
        return owned_array(column<double>(array));
      case io::hdf5::Type::whole:
        return owned_array(column<std::int64_t>(array));
      case io::hdf5::Type::byte:
        break;
    }
    return owned_array(column<std::int8_t>(array));
  }

  std::vector<io::EnsembleAttribute> attributes() const { return io::attributes_of(head(), tally_.done); }
  std::vector<std::string> warnings() const { return job_->warnings(tally_); }
  bool has_failed() const { return tally_.failed() == head().plan.count; }

  /// Numbers of members that failed, and why, in order.
  Messages failures() const {
    Messages sorted = messages_of(messages_);
    std::ranges::sort(sorted, {}, &Messages::value_type::first);
    return sorted;
  }

 private:
  Chunk members_of(std::int64_t k) const {
    if (k >= 0 && k < head().chunks()) return head().members_of(k);
    throw std::invalid_argument("chunk: expected one of " + std::to_string(head().chunks()) + ", got " +
                                std::to_string(k));
  }

  void make_room() {
    rows_.resize(static_cast<std::size_t>(head().plan.count) * head().width(),
                 std::numeric_limits<double>::quiet_NaN());
  }

  void take(const io::DoneChunk& chunk) {
    std::ranges::copy(chunk.rows, rows_.begin() + chunk.members.first * static_cast<std::ptrdiff_t>(head().width()));
    const std::scoped_lock lock(guard_);
    tally_.add(chunk, head().width());
    messages_.insert(messages_.end(), chunk.messages.begin(), chunk.messages.end());
  }

  template <class Take>
  void run(const std::vector<std::int64_t>& chunks, int threads, std::int64_t already, const Shown& shown, Take take) {
    std::atomic<std::size_t> next = 0;
    std::atomic<std::int64_t> done = already;
    const int many = threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    interruptibly(
        [&](const std::stop_token& stop) {
          stop_ = stop;
          const auto claim = [&]() -> std::optional<std::int64_t> {
            const std::size_t k = stop.stop_requested() ? chunks.size() : next.fetch_add(1);
            return k < chunks.size() ? std::optional(chunks[k]) : std::nullopt;
          };
          io::run_chunks(*job_, many, claim, [&](const io::DoneChunk& chunk) {
            take(chunk);
            done += chunk.members.size();
          });
        },
        [&] {
          if (shown) (*shown)(done.load());
        });
  }

  template <class Number>
  std::vector<Number> column(const EnsembleArray& array) const {
    std::vector<Number> numbers(static_cast<std::size_t>(head().plan.count));
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      const auto member = static_cast<std::int64_t>(k);
      double value = static_cast<double>(member);
      if (array.source == EnsembleArray::Source::draw) value = head().plan.values(member)[array.index];
      if (array.source == EnsembleArray::Source::row) value = rows_[k * head().width() + array.index];
      numbers[k] = io::stored<Number>(value);
    }
    return numbers;
  }

  Tell tell_;
  std::stop_token stop_;
  std::optional<io::EnsembleJob> job_;
  std::mutex guard_;
  std::vector<double> rows_;
  std::vector<io::DoneChunk::Message> messages_;
  io::EnsembleTally tally_;
};

}  // namespace

void define_ensembles(nb::module_& module) {
  module.def("plotting_folder",
             [](const std::string& program) { return io::Toolchain::of(program).plotting.string(); });
  nb::class_<Ensemble>(module, "Ensemble")
      .def(nb::init<const std::string&, const std::string&, const std::vector<std::string>&, const std::string&,
                    const std::string&, const std::string&, Tell>(),
           nb::arg("text"), nb::arg("name"), nb::arg("overrides"), nb::arg("command"), nb::arg("program"),
           nb::arg("python"), nb::arg("tell"))
      .def_prop_ro("members", [](const Ensemble& made) { return made.head().plan.count; })
      .def_prop_ro("chunks", [](const Ensemble& made) { return made.head().chunks(); })
      .def_prop_ro("shape", [](const Ensemble& made) { return made.head().plan.shape(); })
      .def_prop_ro("model", [](const Ensemble& made) { return made.head().origin.model; })
      .def("move", &Ensemble::move, nb::arg("threads"), nb::arg("shown").none())
      .def("chunk", &Ensemble::chunk)
      .def("add", &Ensemble::add)
      .def("write", &Ensemble::write, nb::arg("file"), nb::arg("shard").none(), nb::arg("resume"), nb::arg("threads"),
           nb::arg("shown").none())
      .def_prop_ro("arrays", &Ensemble::arrays)
      .def("numbers", &Ensemble::numbers)
      .def_prop_ro("attributes", &Ensemble::attributes)
      .def_prop_ro("warnings", &Ensemble::warnings)
      .def_prop_ro("has_failed", &Ensemble::has_failed)
      .def_prop_ro("failures", &Ensemble::failures);
}

}  // namespace pendula::python
