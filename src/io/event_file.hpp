#pragma once

#include <pendula/numeric/number_text.hpp>
#include <pendula/run/observer.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/line_file.hpp"
#include "io/trajectory.hpp"

namespace pendula::io {

/// The events of a run as a CSV file: name, time, direction, then the other columns of the trajectory at that instant.
class EventFile : public Observer {
 public:
  /// `columns` are those of the trajectory; the first is the time. Throws InputError if the file cannot be opened.
  EventFile(const std::string& file, std::span<const std::string> columns) : file_(file) {
    std::vector<std::string> header = {"name", "t", "direction"};
    header.insert(header.end(), columns.begin() + 1, columns.end());
    append_header(file_.pending(), header);
  }

  /// `row` has the columns of the trajectory.
  void take(const Row&) override { file_.flush_if_due(); }

  /// Throws OutputError where lines cannot be written.
  void happen(const EventRow& happened) override {
    std::string& text = file_.pending();
    text += happened.event.name + ',';
    append_number(text, happened.row.numbers.front());
    text += happened.up ? ",up," : ",down,";
    append_row(text, happened.row.numbers.subspan(1));
    file_.flush_if_due();
  }

  /// Throws OutputError.
  void finish() override { file_.close(); }

 private:
  LineFile file_;
};

}  // namespace pendula::io
