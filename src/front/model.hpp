#pragma once

#include <pendula/pendula.h>
#include <memory>
#include <pendula/run/quantity.hpp>
#include <pendula/run/subject.hpp>
#include <string>
#include <utility>
#include <vector>

/// What the C interface calls a model: a subject, and how its rows are called.
struct pendula_model {
  pendula_model(std::shared_ptr<const pendula::Subject> moved, std::size_t coordinate_count, std::size_t input_count)
      : subject(std::move(moved)), coordinates(coordinate_count), inputs(input_count), names(subject->columns()) {
    units.resize(names.size());
    for (const pendula::Quantity& quantity : subject->quantities()) {
      for (std::size_t k = 0; k < quantity.size(); ++k) units[quantity.column(k)] = quantity.unit;
    }
  }

  std::shared_ptr<const pendula::Subject> subject;
  std::size_t coordinates, inputs;
  std::vector<std::string> names, units;
};

namespace pendula::front {

/// q and v as they come. Throws std::invalid_argument where one is null.
Motion motion_of(const pendula_model& model, double time, const double* q, const double* v);

void write(const Motion& motion, double* q, double* v);

}  // namespace pendula::front
