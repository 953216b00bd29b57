/* A double pendulum that is let go from the horizontal: where it is after ten seconds, how often its first link
 * passed the lowest point, and what its end depends on.
 *
 * cc double_pendulum.c -o double_pendulum $(pkg-config --cflags --libs pendula) -lm */
#include <math.h>
#include <pendula/pendula.h>
#include <stdio.h>
#include <stdlib.h>

static void require(int good) {
  if (good) return;
  fprintf(stderr, "%s\n", pendula_error());
  exit(1);
}

/* Changes its sign where the first link hangs straight down. */
static double angle(void* context, double time, const double* q, const double* v) {
  (void)context, (void)time, (void)v;
  return sin(q[0] / 2);
}

static int count(void* context, int up, double time, const double* q, const double* v) {
  (void)up, (void)time, (void)q, (void)v;
  ++*(int*)context;
  return 0;
}

int main(void) {
  const double masses[2] = {1, 1}, lengths[2] = {1, 1}, start[2] = {acos(0), acos(0)};
  const pendula_chain numbers = {.dimension = 2, .links = 2, .masses = masses, .lengths = lengths, .gravity = 9.81};
  pendula_model* chain = pendula_model_of_chain(&numbers);
  require(chain != NULL);

  const pendula_options options = {.tolerance = 1e-12};
  pendula_simulation* run = pendula_simulation_new(chain, 0, start, NULL, &options); /* at rest */
  require(run != NULL);

  int passed = 0;
  const pendula_event lowest = {.value = angle, .happened = count, .context = &passed};
  require(pendula_on(run, &lowest) == PENDULA_OK);
  require(pendula_advance_to(run, 10) == PENDULA_OK);

  double row[10];
  require(pendula_columns(chain) == 10 && pendula_simulation_row(run, row) == PENDULA_OK);
  for (size_t k = 0; k < 10; ++k) {
    printf("%s %.17g %s\n", pendula_column_name(chain, k), row[k], pendula_column_unit(chain, k));
  }
  printf("events %d\n", passed);

  /* What theta_1, theta_2 and their rates change by at the end, relative to a small change of theta_1 at the start. */
  const double first_angle[4] = {1, 0, 0, 0}, end = 10;
  const pendula_path path = {.model = chain, .q = start, .times = &end, .time_count = 1, .options = &options};
  double state[4], change[4];
  require(pendula_push(&path, first_angle, NULL, 1, state, change) == PENDULA_OK);
  printf("change_of_theta_2 %.17g\n", change[1]);

  pendula_simulation_free(run);
  pendula_model_free(chain);
  return 0;
}
