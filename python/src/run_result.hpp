#pragma once

#include <cstddef>
#include <optional>
#include <pendula/run/observer.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/subject.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "io/run_arrays.hpp"
#include "io/run_source.hpp"
#include "io/saved_run.hpp"
#include "prepared.hpp"
#include "python_events.hpp"
#include "view/scene.hpp"

/// What comes of runs: Python has it as arrays, saves it, and goes on from it.
namespace pendula::python {

struct Result {
  std::string file;    ///< that it was read from, or what stands for it in messages
  io::SavedRun saved;  ///< what it began with, and where it can go on; its `so_far` counts events, without checksums
  io::RunContents contents;
  std::vector<std::string> columns, units;
  std::vector<std::vector<std::size_t>> points;  ///< columns of the components of each
  std::vector<std::size_t> state;                ///< columns of the coordinates, then of their rates
  double begin = 0;                              ///< of the motion, where rows may begin later  [s]
  bool loaded = false;                           ///< whether its energy may change
  std::vector<double> rows, event_rows;          ///< one after the other
  std::vector<std::string> events;               ///< names, one for each of event_rows
  std::vector<char> went_up;                     ///< the same
  std::string summary;                           ///< as JSON; empty if the run has not come to its end
  std::string file_summary;                      ///< the same for a run file
  PythonEvents asked;                            ///< events that are functions of Python

  std::size_t count_rows() const { return columns.empty() ? 0 : rows.size() / columns.size(); }
};

/// Fills in what rows are, and where the motion begins.
void describe(const RunSetup& setup, io::RunContents contents, const view::Scene& scene, Result& result);

/// Keeps rows and events of a run, and where it can go on.
class Recorder : public Observer {
 public:
  explicit Recorder(Result& result) : result_(result) {}

  void take(const Row& row) override {
    result_.rows.insert(result_.rows.end(), row.numbers.begin(), row.numbers.end());
  }
  void happen(const EventRow& happened) override {
    result_.events.push_back(happened.event.name);
    result_.went_up.push_back(happened.up ? 1 : 0);
    result_.event_rows.insert(result_.event_rows.end(), happened.row.numbers.begin(), happened.row.numbers.end());
  }
  void keep(const Checkpoint& checkpoint) override {
    result_.saved.checkpoint = checkpoint;
    result_.saved.so_far = io::RunSoFar{result_.events.size(), 0, 0};
  }

 private:
  Result& result_;
};

/// Finds the model of a run and keeps its text. A run that is made again has the model that it began with.
class RunModel {
 public:
  RunModel(const std::string& program, const std::string& python, const Tell& tell, std::string began_with = "");

  io::FindSystem finder();
  const std::string& text() const { return text_; }
  const std::string& by() const { return models_.by(); }

 private:
  io::Toolchain toolchain_;
  Models models_;
  std::string text_;
};

/// What the history of a run file calls these.
inline constexpr const char* saved_by = "pendula in Python";

/// Writes a run: CSV or a run file, by the ending of the name.
void save(const Result& result, const std::string& file);

}  // namespace pendula::python
