/* The C interface, from a program in C: exits 0 where everything is as it should be. */
#include <math.h>
#include <pendula/pendula.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;

static void expect(int good, const char* what) {
  if (good) return;
  ++failures;
  fprintf(stderr, "wrong: %s (last error: %s)\n", what, pendula_error());
}

struct counter {
  int crossings, rows;
  double last;
};

static double height(void* context, double time, const double* q, const double* v) {
  (void)context, (void)time, (void)v;
  return q[1];
}
static int count_crossing(void* context, int up, double time, const double* q, const double* v) {
  struct counter* counter = context;
  (void)up, (void)q, (void)v;
  ++counter->crossings;
  counter->last = time;
  return 0;
}
static int count_row(void* context, const double* numbers, size_t count) {
  struct counter* counter = context;
  (void)numbers;
  ++counter->rows;
  return count == 10 ? 0 : 1;
}

static void a_chain(void) {
  const double masses[2] = {1, 1}, lengths[2] = {1, 1}, q[2] = {2, 1}, v[2] = {0, 0};
  pendula_chain numbers = {2, 2, masses, lengths, 9.81, NULL, NULL, NULL, 0};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  pendula_options options = {0};
  pendula_simulation *run, *copy;
  pendula_event event = {height, count_crossing, NULL, 0, 0};
  struct counter counter = {0, 0, 0}, other = {0, 0, 0};
  void* contexts[1];
  const double torques[2] = {0.5, -0.1};
  double held[2];
  double end[4], copied[4], half[4], a[16], row[10], saved[4096];
  expect(chain != NULL && pendula_coordinates(chain) == 2 && pendula_columns(chain) == 10, "the chain");
  expect(strcmp(pendula_column_name(chain, 3), "theta_2") == 0 && strcmp(pendula_column_unit(chain, 9), "J") == 0 &&
             pendula_column_name(chain, 10) == NULL,
         "its columns");
  /* U = -m g l (2 cos 2 + cos 1), at rest. */
  expect(pendula_energies(chain, 0, q, v, held) == PENDULA_OK && held[0] == 0 &&
             fabs(held[1] + 9.81 * (2 * cos(2.0) + cos(1.0))) < 1e-14, /* measured 0 */
         "its energies");
  expect(pendula_energies(chain, 0, NULL, v, held) == PENDULA_INVALID, "energies of nothing");
  held[0] = 0, held[1] = NAN;
  expect(pendula_simulation_new(chain, 0, q, held, &options) == NULL &&
             strcmp(pendula_error(), "theta_dot_2: expected a finite number, got nan") == 0 &&
             pendula_simulation_new(chain, INFINITY, q, v, &options) == NULL &&
             strcmp(pendula_error(), "t: expected a finite number, got inf") == 0,
         "a start that is no number");
  expect(pendula_model_of_program("no program", NULL, 0) == NULL && pendula_error_kind() == PENDULA_INVALID,
         "a program that is none");
  expect(
      pendula_model_of_kernel(NULL, NULL, 0) == NULL && strstr(pendula_error(), "kernel: expected the address") != NULL,
      "a kernel that is none");
  options.tolerance = 1e-10;
  run = pendula_simulation_new(chain, 0, q, v, &options);
  event.context = &counter;
  contexts[0] = &other;
  expect(run != NULL && pendula_on(run, &event) == PENDULA_OK, "an event");
  expect(pendula_on_rows(run, 0.5, count_row, &counter) == PENDULA_OK, "rows");
  expect(pendula_inputs(chain) == 2 && strcmp(pendula_input_name(chain, 1), "torque_2") == 0, "its inputs");
  expect(pendula_hold(run, torques, 2) == PENDULA_OK, "torques");
  pendula_held(run, held);
  expect(memcmp(held, torques, sizeof held) == 0, "are held");
  expect(pendula_simulation_row(run, row) == PENDULA_OK && row[1] == 2, "a row");
  expect(pendula_advance_to(run, 2) == PENDULA_OK && pendula_time(run) == 2, "two seconds");
  copy = pendula_simulation_copy(run, contexts);
  expect(copy != NULL && pendula_saved(run) < 4096, "a copy");
  expect(pendula_save(run, saved, pendula_saved(run)) == PENDULA_OK, "saving");
  expect(pendula_advance_to(run, 5) == PENDULA_OK && pendula_advance_to(copy, 5) == PENDULA_OK, "five seconds");
  pendula_motion(run, end, end + 2);
  pendula_motion(copy, copied, copied + 2);
  expect(memcmp(end, copied, sizeof end) == 0, "a copy goes on to the bit");
  expect(counter.crossings > 2 && other.crossings > 0 && other.crossings < counter.crossings, "crossings");
  expect(counter.last == other.last && counter.rows == 11, "of both; rows of the first");
  expect(pendula_resume(copy, saved, pendula_saved(copy)) == PENDULA_OK && pendula_time(copy) == 2, "going back");
  expect(pendula_advance_to(copy, 5) == PENDULA_OK, "five seconds again");
  pendula_motion(copy, copied, copied + 2);
  expect(memcmp(end, copied, sizeof end) == 0, "resumed to the bit");
  expect(pendula_at(run, 2.5, half, half + 2) == PENDULA_OK && half[0] != end[0], "half way");
  expect(pendula_row(chain, 5, end, end + 2, NULL, row) == PENDULA_OK && row[0] == 5 && row[1] == end[0], "a row");
  expect(pendula_linearize(run, a, NULL) == PENDULA_OK && a[2] == 1 && a[0] == 0, "its derivative");
  expect(pendula_finish(run) == PENDULA_OK, "the end");
  pendula_simulation_free(copy);
  pendula_simulation_free(run);
  pendula_model_free(chain);
}

/* A step of the run's own size, and what is seen within it. */
static void steps(void) {
  const double masses[2] = {1, 1}, lengths[2] = {1, 1}, q[2] = {2, 1}, v[2] = {0, 0}, torques[2] = {0.5, -0.1};
  pendula_chain numbers = {2, 2, masses, lengths, 9.81, NULL, NULL, NULL, 0};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  pendula_options options = {0};
  pendula_simulation *run, *cut;
  double there[4], other[4], saved[4096], largest = 0;
  size_t count;
  options.tolerance = 1e-12;
  options.forget = 1;
  run = pendula_simulation_new(chain, 0, q, v, &options);
  cut = pendula_simulation_new(chain, 0, q, v, &options);
  count = pendula_saved(run);
  expect(count < 4096, "what is saved");
  for (int k = 1; k <= 200; ++k) {
    const double time = 0.01 * k;
    while (pendula_time(run) < time) {
      expect(pendula_save(run, saved, count) == PENDULA_OK && pendula_step(run) == PENDULA_OK, "a step");
    }
    expect(pendula_at(run, time, there, there + 2) == PENDULA_OK, "a time within it");
    expect(pendula_advance_to(cut, time) == PENDULA_OK, "an advance");
    pendula_motion(cut, other, other + 2);
    for (int i = 0; i < 4; ++i) largest = fmax(largest, fabs(there[i] - other[i]));
  }
  expect(pendula_steps(run) < 100, "communication does not cut steps");               /* measured 30 */
  expect(largest < 1e-10, "states of steps that are cut, and of those that are not"); /* measured 1.1e-11 */
  expect(pendula_at(run, 0, there, there + 2) == PENDULA_INVALID, "an earlier step");

  /* Back to where the last step began, and by other torques on from within it. */
  expect(pendula_at(run, 2, there, there + 2) == PENDULA_OK && pendula_time(run) > 2, "a step beyond");
  expect(pendula_resume(run, saved, count) == PENDULA_OK && pendula_time(run) < 2, "taking it back");
  expect(pendula_at(run, 2, other, other + 2) == PENDULA_INVALID, "what is not known any more");
  expect(pendula_step(run) == PENDULA_OK && pendula_at(run, 2, other, other + 2) == PENDULA_OK &&
             memcmp(there, other, sizeof there) == 0,
         "the same step to the bit");
  expect(pendula_resume(run, saved, count) == PENDULA_OK && pendula_restart(run, 2, there, there + 2) == PENDULA_OK &&
             pendula_hold(run, torques, 2) == PENDULA_OK && pendula_advance_to(run, 2.5) == PENDULA_OK &&
             pendula_time(run) == 2.5,
         "other torques");
  pendula_simulation_free(cut);
  pendula_simulation_free(run);
  pendula_model_free(chain);
}

/* Elapsed time adds up with rounding: an advance ends at the very time that it was asked for. */
static void ends_of_advances(void) {
  const double masses[1] = {1}, lengths[1] = {1}, q[1] = {1};
  pendula_chain numbers = {2, 1, masses, lengths, 9.81, NULL, NULL, NULL, 0};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  pendula_simulation* run = pendula_simulation_new(chain, -0.3, q, NULL, NULL);
  double there[2], now[2];
  for (int k = 1; k <= 300; ++k) {
    const double time = -0.3 + 0.1 * sqrt(k);
    expect(pendula_advance_to(run, time) == PENDULA_OK && pendula_time(run) == time, "the time of an advance");
    expect(pendula_at(run, time, there, there + 1) == PENDULA_OK, "the motion there");
    pendula_motion(run, now, now + 1);
    expect(memcmp(there, now, sizeof there) == 0, "which is the present one");
  }
  expect(pendula_at(run, 1, there, there + 1) == PENDULA_OK, "an earlier one");
  pendula_simulation_free(run);
  pendula_model_free(chain);
}

static void errors(void) {
  const double masses[1] = {-1}, lengths[1] = {1};
  pendula_chain numbers = {2, 1, masses, lengths, 9.81, NULL, NULL, NULL, 0};
  pendula_options options = {0};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  const double q[1] = {1};
  expect(chain == NULL && strstr(pendula_error(), "masses of link 1") != NULL, "a negative mass");
  expect(pendula_error_kind() == PENDULA_INVALID, "its kind");
  numbers.masses = lengths;
  chain = pendula_model_of_chain(&numbers);
  options.method = "gaus";
  expect(pendula_simulation_new(chain, 0, q, NULL, &options) == NULL &&
             strstr(pendula_error(), "method: expected one of gauss, radau") != NULL,
         "an unknown method");
  expect(pendula_model_named("nothing", 0, NULL, 0) == NULL && pendula_error_kind() == PENDULA_NO_KERNEL, "a model");
  pendula_model_free(chain);
}

static void an_ensemble(void) {
  const double masses[1] = {1}, lengths[1] = {1}, starts[6] = {0.1, 0, 0.5, 0, 1, 0};
  pendula_chain numbers = {2, 1, masses, lengths, 9.81, NULL, NULL, NULL, 0};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  const pendula_model* models[1];
  pendula_ensemble ensemble = {0};
  double ends[6], energy_errors[3];
  pendula_status how[3];
  models[0] = chain;
  ensemble.models = models;
  ensemble.model_count = 1;
  ensemble.starts = starts;
  ensemble.members = 3;
  ensemble.duration = 1;
  expect(pendula_propagate(&ensemble, ends, how, energy_errors) == PENDULA_OK && how[2] == PENDULA_OK, "an ensemble");
  /* the small swing: 0.1 cos(sqrt(9.81)) with the period's correction theta^2/16 */
  expect(fabs(ends[0] - 0.1 * cos(sqrt(9.81) * (1 - 0.01 / 16))) < 1e-5, "where the first ends"); /* measured 2e-6 */
  pendula_model_free(chain);
}

static int at_once(void* context) {
  (void)context;
  return 1;
}

static void exponents(void) {
  const double masses[1] = {1}, lengths[1] = {1}, damping[1] = {0.5}, q[1] = {1};
  pendula_chain numbers = {2, 1, masses, lengths, 9.81, damping, NULL, NULL, 0};
  pendula_tangents tangents = {0};
  pendula_spectrum rest;
  double found[2];
  pendula_model* chain = pendula_model_of_chain(&numbers);
  tangents.model = chain;
  tangents.q = q;
  tangents.duration = 100;
  tangents.count = 2;
  expect(pendula_lyapunov(&tangents, found, NULL, &rest) == PENDULA_OK && rest.duration == 100, "exponents");
  expect(fabs(rest.sum + 0.5) < 1e-9, "they add up to the mean divergence"); /* measured 3.4e-13 */
  tangents.stop = at_once;
  expect(pendula_lyapunov(&tangents, found, NULL, &rest) == PENDULA_STOPPED && rest.duration < 1, "stopping them");
  tangents.count = 3;
  expect(pendula_lyapunov(&tangents, found, NULL, &rest) == PENDULA_INVALID &&
             strstr(pendula_error(), "count: expected 1 to 2 exponents, got 3") != NULL,
         "three of two");
  pendula_model_free(chain);
}

/* Two links with dampings, moved by constant steps while torques are held. */
struct moved {
  double parameters[7]; /* masses, lengths, dampings, gravity */
  double torques[2];
  double start[4];
};

static const struct moved moved = {{1, 0.5, 1, 0.7, 0.1, 0.2, 9.81}, {0.3, -0.2}, {1.2, 0.4, 0.1, -0.3}};
static const double times[2] = {0.3, 1};

static pendula_model* model_of(const struct moved* of) {
  const double* numbers = of->parameters;
  const pendula_chain chain = {2, 2, numbers, numbers + 2, numbers[6], numbers + 4, NULL, NULL, 0};
  return pendula_model_of_chain(&chain);
}

static pendula_simulation* simulation_of(const struct moved* of, const pendula_options* options) {
  pendula_model* chain = model_of(of);
  pendula_simulation* run = pendula_simulation_new(chain, 0, of->start, of->start + 2, options);
  expect(run != NULL && pendula_hold(run, of->torques, 2) == PENDULA_OK, "a simulation to be differentiated");
  pendula_model_free(chain);
  return run;
}

/* (2, 4) */
static void states_of(const struct moved* of, const pendula_options* options, double* states) {
  pendula_simulation* run = simulation_of(of, options);
  for (int k = 0; k < 2; ++k) {
    expect(pendula_advance_to(run, times[k]) == PENDULA_OK, "an advance to be differentiated");
    pendula_motion(run, states + 4 * k, states + 4 * k + 2);
  }
  pendula_simulation_free(run);
}

/* The same with the number `k` changed: of the start, then of parameters, then torques. */
static struct moved changed(int k, double by) {
  struct moved of = moved;
  double* number = k < 4 ? of.start + k : k < 11 ? of.parameters + (k - 4) : of.torques + (k - 11);
  *number += by;
  return of;
}

static void identity(double* numbers, int size) {
  for (int k = 0; k < size * size; ++k) numbers[k] = k % (size + 1) == 0;
}

static void derivatives(void) {
  enum { all = 4 + 7 + 2 };
  const double by = 1e-5;
  pendula_options options = {0};
  pendula_path path = {0};
  pendula_model* chain = model_of(&moved);
  double seeds[all * all], changes[2 * 4 * all], states[8], other[8], more[8], less[8], gradients[8], by_all[all];
  double values[7], largest = 0;
  options.step = 0.01;
  options.stages = 3;
  path.model = chain;
  path.q = moved.start;
  path.v = moved.start + 2;
  path.times = times;
  path.time_count = 2;
  path.inputs = moved.torques;
  path.options = &options;

  pendula_parameter_values(chain, values);
  expect(pendula_parameters(chain) == 7 && memcmp(values, moved.parameters, sizeof values) == 0, "the parameters");
  expect(strcmp(pendula_parameter_name(chain, 5), "damping_2") == 0 &&
             strcmp(pendula_parameter_name(chain, 6), "gravity") == 0 && pendula_parameter_name(chain, 7) == NULL &&
             strcmp(pendula_parameter_unit(chain, 2), "m") == 0,
         "their names");

  identity(seeds, all);
  expect(pendula_push(&path, seeds, seeds + 4 * all, all, states, changes) == PENDULA_OK, "forward");
  states_of(&moved, &options, other);
  expect(memcmp(states, other, sizeof states) == 0, "forward, the steps are those of a simulation");
  for (int k = 0; k < all; ++k) {
    const struct moved above = changed(k, by), below = changed(k, -by);
    states_of(&above, &options, more);
    states_of(&below, &options, less);
    for (int i = 0; i < 8; ++i) {
      const double off = fabs(changes[i * all + k] - (more[i] - less[i]) / (2 * by));
      largest = off > largest ? off : largest;
    }
  }
  expect(largest < 1e-8, "derivatives are those of differences"); /* measured 1.0e-9, of up to 4.9 */

  for (int i = 0; i < 8; ++i) gradients[i] = 1.0 / (1 + i);
  expect(pendula_pull(&path, gradients, other, by_all, by_all + 4) == PENDULA_OK, "backward");
  expect(memcmp(states, other, sizeof states) == 0, "backward, the steps are the same");
  largest = 0;
  for (int k = 0; k < all; ++k) {
    for (int i = 0; i < 8; ++i) by_all[k] -= gradients[i] * changes[i * all + k];
    largest = fabs(by_all[k]) > largest ? fabs(by_all[k]) : largest;
  }
  expect(largest < 1e-13, "backward is the transpose"); /* measured 2.1e-15 */

  memset(other, 0, sizeof other);
  expect(pendula_push(&path, NULL, NULL, 1, other, NULL) == PENDULA_OK && memcmp(states, other, sizeof other) == 0,
         "states alone");
  path.stop = at_once;
  memset(other, 0, sizeof other);
  expect(pendula_push(&path, seeds, NULL, all, other, changes) == PENDULA_STOPPED && other[0] == 0, "stopping it");
  path.stop = NULL;
  options.method = "rk4";
  expect(pendula_pull(&path, gradients, NULL, by_all, NULL) == PENDULA_INVALID &&
             strstr(pendula_error(), "gauss or radau") != NULL,
         "a method without derivatives");
  options.method = NULL;
  path.time_count = 0;
  expect(pendula_push(&path, seeds, NULL, all, NULL, changes) == PENDULA_INVALID &&
             strstr(pendula_error(), "times: expected") != NULL,
         "no times");
  pendula_model_free(chain);
}

/* When the second link hangs for the first time, and how the first one moves then: (3) t, theta_1, theta_dot_1. */
static void hanging(const struct moved* of, double* found) {
  const pendula_event event = {height, NULL, NULL, -1, 1};
  pendula_options options = {0};
  pendula_simulation* run;
  double q[2], v[2];
  options.tolerance = 1e-13;
  run = simulation_of(of, &options);
  expect(pendula_on(run, &event) == PENDULA_OK && pendula_advance_to(run, 5) == PENDULA_EVENT, "an event that stops");
  pendula_motion(run, q, v);
  found[0] = pendula_time(run);
  found[1] = q[0];
  found[2] = v[0];
  pendula_simulation_free(run);
}

static void derivatives_at_an_event(void) {
  const double by = 1e-5;
  const struct moved above = changed(0, by), below = changed(0, -by);
  const double direction[4] = {1, 0, 0, 0};
  double here[3], more[3], less[3], state[4], change[4], field[4], of_time;
  pendula_model* chain = model_of(&moved);
  pendula_options options = {0};
  pendula_path path = {0};
  options.tolerance = 1e-13;
  hanging(&moved, here);
  hanging(&above, more);
  hanging(&below, less);
  path.model = chain;
  path.q = moved.start;
  path.v = moved.start + 2;
  path.times = here;
  path.time_count = 1;
  path.inputs = moved.torques;
  path.options = &options;
  expect(pendula_push(&path, direction, NULL, 1, state, change) == PENDULA_OK, "forward to an event");
  expect(pendula_field(chain, here[0], state, state + 2, moved.torques, field) == PENDULA_OK, "the field there");
  expect(field[0] == state[2] && field[1] == state[3], "begins with the rates");
  of_time = -change[1] / field[1]; /* the event is theta_2 = 0 */
  expect(fabs(of_time - (more[0] - less[0]) / (2 * by)) < 1e-9 &&
             fabs(change[0] + field[0] * of_time - (more[1] - less[1]) / (2 * by)) < 1e-9 &&
             fabs(change[2] + field[2] * of_time - (more[2] - less[2]) / (2 * by)) < 1e-9,
         "derivatives of an event are those of differences"); /* measured 1.1e-11, 2.4e-11, 6.9e-11 */
  pendula_model_free(chain);
}

/* Programs that were linked to an older library of the same interface hand over structures of these sizes. */
static void sizes(void) {
  if (sizeof(void*) != 8 || sizeof(size_t) != 8) return;
  expect(sizeof(pendula_status) == 4 && sizeof(pendula_drive) == 48 && sizeof(pendula_chain) == 64 &&
             sizeof(pendula_options) == 64 && sizeof(pendula_event) == 32 && sizeof(pendula_path) == 80 &&
             sizeof(pendula_ensemble) == 80 && sizeof(pendula_tangents) == 72 && sizeof(pendula_spectrum) == 32,
         "sizes of structures: a change raises PENDULA_C_INTERFACE (cmake/PendulaSharedLibrary.cmake)");
}

int main(void) {
  a_chain();
  steps();
  ends_of_advances();
  errors();
  an_ensemble();
  exponents();
  derivatives();
  derivatives_at_an_event();
  sizes();
  if (failures == 0) printf("%s on %s\n", pendula_version(), pendula_instruction_set());
  return failures;
}
