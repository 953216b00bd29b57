#pragma once

#include <pendula/pendula.h>
#include <memory>
#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

/// A model of the C interface: a subject, and the names of its columns.
struct pendula_model {
  pendula_model(std::shared_ptr<const pendula::Subject> moved, std::size_t coordinate_count);

  std::shared_ptr<const pendula::Subject> subject;
  std::size_t coordinates;
  std::vector<std::string> inputs, names, units;  // names of inputs; names and units of columns
  std::vector<std::string> parameter_names, parameter_units;
  std::vector<double> parameters;
};

namespace pendula::front {

/// A motion from q and v; if v is null, rates are 0. Throws std::invalid_argument if q is null, or a number not finite.
Motion motion_of(const pendula_model& model, double time, const double* q, const double* v);
/// The subject with these inputs; its own where they are null.
std::shared_ptr<const Subject> holding(const pendula_model& model, const double* inputs);

void write(const Motion& motion, double* q, double* v);

/// Writes the numbers of the row of a motion.
void write_row(const Subject& subject, const Motion& motion, double* row);

}  // namespace pendula::front
