#pragma once

#include <pendula/run/lyapunov.hpp>
#include <pendula/run/run_report.hpp>
#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

#include "io/ensemble_file.hpp"
#include "io/ensemble_plan.hpp"
#include "io/event_reader.hpp"

namespace pendula::io {

/// The quantities that are kept for every member of an ensemble.
class KeptQuantities {
 public:
  /// Throws InputError if the ensemble asks for an unknown quantity.
  KeptQuantities(const EnsemblePlan& plan, const Subject& subject, const std::vector<EventPlan>& events);

  std::vector<EnsembleColumn> columns() const;
  /// Whether anything is kept that needs tangents.
  bool chaos() const;

  /// Appends the numbers of a member; `spectrum` is used only if chaos().
  void append(const Subject& subject, const RunReport& report, const LyapunovSpectrum& spectrum,
              std::vector<double>& row) const;

 private:
  enum class Source {
    last,
    energy_start,
    energy_error,
    steps,
    event_time,
    event_count,
    exponent,
    exponent_error,
    ftle,
    megno
  };

  struct Column {
    EnsembleColumn column;
    Source source;
    std::size_t index = 0;  // index of a column of the row, or of an event
  };

  void add(const std::string& what, const std::string& place, const std::vector<Quantity>& quantities,
           const std::vector<EventPlan>& events);
  void add_last(const std::vector<Quantity>& quantities, bool points);

  std::vector<Column> columns_;
};

}  // namespace pendula::io
