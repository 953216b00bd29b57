#pragma once

#include <optional>
#include <pendula/run/run_report.hpp>
#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

#include "io/ensemble_file.hpp"
#include "io/ensemble_plan.hpp"
#include "io/event_reader.hpp"
#include "io/natural_units.hpp"

namespace pendula::cli {

/// What is kept of every member of an ensemble.
class Kept {
 public:
  /// Throws io::InputError where the ensemble asks for what there is not.
  Kept(const io::EnsemblePlan& plan, const Subject& subject, const std::vector<io::EventPlan>& events,
       const std::optional<io::NaturalUnits>& natural);

  std::vector<io::EnsembleColumn> columns() const;
  bool lyapunov() const;

  /// Appends the numbers of a member; of its exponent and the error where that is kept.
  void append(const Subject& subject, const RunReport& report, double exponent, double exponent_error,
              std::vector<double>& row) const;

 private:
  enum class Source { last, energy_start, energy_error, steps, event_time, event_count, exponent, exponent_error };

  struct Column {
    io::EnsembleColumn column;
    Source source;
    std::size_t index = 0;  // of a row's number, or of an event
  };

  void add(const std::string& what, const std::string& place, const std::vector<Quantity>& quantities,
           const std::vector<io::EventPlan>& events, const std::optional<io::NaturalUnits>& natural);
  void add_last(const std::vector<Quantity>& quantities, bool points);

  std::vector<Column> columns_;
};

}  // namespace pendula::cli
