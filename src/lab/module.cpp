// What the page of the laboratory calls: pendula.h with numbers and pointers in place of its structures, whose layout
// JavaScript does not know.
#include <pendula/pendula.h>

extern "C" {

/// A chain; arrays as in pendula_chain. NULL where something is wrong: pendula_error().
pendula_model* lab_chain(int dimension, int links, const double* masses, const double* lengths, double gravity,
                         const double* damping) {
  const pendula_chain chain = {dimension, links, masses, lengths, gravity, damping, nullptr, nullptr, 0};
  return pendula_model_of_chain(&chain);
}

/// A simulation by Gauss steps: constant ones where `step` > 0, otherwise by the tolerance. It does not keep its steps.
pendula_simulation* lab_simulation(const pendula_model* model, double time, const double* q, const double* v,
                                   double step, double tolerance, int stages) {
  pendula_options options = {};
  options.step = step;
  options.tolerance = tolerance;
  options.stages = stages;
  options.forget = 1;
  return pendula_simulation_new(model, time, q, v, &options);
}
}
