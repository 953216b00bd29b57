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
  expect(pendula_model_of_program("no program", NULL, 0) == NULL && pendula_error_kind() == PENDULA_INVALID,
         "a program that is none");
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
  expect(pendula_row(chain, 5, end, end + 2, row) == PENDULA_OK && row[0] == 5 && row[1] == end[0], "a row");
  expect(pendula_linearize(run, a, NULL) == PENDULA_OK && a[2] == 1 && a[0] == 0, "its derivative");
  expect(pendula_finish(run) == PENDULA_OK, "the end");
  pendula_simulation_free(copy);
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

int main(void) {
  a_chain();
  errors();
  an_ensemble();
  exponents();
  if (failures == 0) printf("%s on %s\n", pendula_version(), pendula_instruction_set());
  return failures;
}
