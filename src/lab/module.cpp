// What the page of the laboratory calls: pendula.h with numbers and pointers in place of its structures, whose layout
// JavaScript does not know.
#include <pendula/pendula.h>

#include <cstddef>
#include <vector>

extern "C" {

/// A chain; arrays as in pendula_chain, sines on its torques as numbers: input, amplitude, frequency and phase of each,
/// (4 sine_count). NULL where something is wrong: pendula_error().
pendula_model* lab_chain(int dimension, int links, const double* masses, const double* lengths, double gravity,
                         const double* damping, const double* sines, int sine_count) {
  const int components = dimension == 2 ? 1 : 3;
  std::vector<pendula_drive> drives;
  for (int k = 0; k < sine_count; ++k) {
    const double* sine = sines + 4 * static_cast<std::ptrdiff_t>(k);
    const int input = static_cast<int>(sine[0]);
    pendula_drive& drive = drives.emplace_back(pendula_drive{input / components, {}, sine[2], sine[3]});
    drive.amplitude[input % components] = sine[1];
  }
  const pendula_chain chain = {dimension, links,   masses,        lengths,      gravity,
                               damping,   nullptr, drives.data(), drives.size()};
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
