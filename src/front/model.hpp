#pragma once

#include <pendula/pendula.h>
#include <memory>
#include <pendula/run/subject.hpp>
#include <string>
#include <vector>

/// What the C interface calls a model: a subject, and how its rows are called.
struct pendula_model {
  pendula_model(std::shared_ptr<const pendula::Subject> moved, std::size_t coordinate_count);

  std::shared_ptr<const pendula::Subject> subject;
  std::size_t coordinates;
  std::vector<std::string> inputs, names, units;  // of inputs the names; of columns both
  std::vector<std::string> parameter_names, parameter_units;
  std::vector<double> parameters;
};

namespace pendula::front {

/// q and v as they come; without v rates are 0. Throws std::invalid_argument where q is null, or a number not finite.
Motion motion_of(const pendula_model& model, double time, const double* q, const double* v);

void write(const Motion& motion, double* q, double* v);

/// The numbers of the row that a motion is.
void write_row(const Subject& subject, const Motion& motion, double* row);

}  // namespace pendula::front
