// Two links balance on a cart, on a processor without a system, a heap or doubles: a Cortex-M4.
//
// cart.h and cart.c are exported: pendula export cart_chain --links 2 --as c --float --name cart -o .
// The step is the plant, and its derivatives where the links stand are what the gains are found from.
#include <math.h>
#include <stdint.h>

#include "board.h"
#include "cart.h"

enum { n = cart_states, riccati_iterations = 400, steps = 500 };

static const float step_size = 0.01F;  // s
static const float tolerance = 1e-5F;
static const float most_force = 50.0F;  // N

static float a[n * n], b[n], gains[n];
static cart_sensitivity_work work;
static float parameters[cart_parameters];

// A and B of the discrete system about `state`.
static int linearize(const float* state) {
  const float no_force[] = {0.0F};
  float next[n];
  return cart_step_with_sensitivities(parameters, 0.0F, step_size, no_force, 20, tolerance, state, next, a, b, 0, 0,
                                      &work);
}

// Gains of least sum of squares, by Riccati's iteration P = Q + A' P (A - B K), K = B' P A / (R + B' P B).
static void find_gains(void) {
  static float p[n * n], pa[n * n], closed[n * n];
  for (int i = 0; i < n * n; ++i) p[i] = i % (n + 1) == 0 ? 1.0F : 0.0F;
  for (int iteration = 0; iteration < riccati_iterations; ++iteration) {
    float pb[n], inner = 0.1F;
    for (int i = 0; i < n; ++i) {
      pb[i] = 0.0F;
      for (int k = 0; k < n; ++k) pb[i] += p[i * n + k] * b[k];
    }
    for (int i = 0; i < n; ++i) inner += b[i] * pb[i];
    for (int j = 0; j < n; ++j) {
      gains[j] = 0.0F;
      for (int k = 0; k < n; ++k) gains[j] += pb[k] * a[k * n + j] / inner;
      for (int i = 0; i < n; ++i) closed[i * n + j] = a[i * n + j] - b[i] * gains[j];
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        pa[i * n + j] = 0.0F;
        for (int k = 0; k < n; ++k) pa[i * n + j] += p[i * n + k] * closed[k * n + j];
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) {
        float sum = i == j ? 1.0F : 0.0F;
        for (int k = 0; k < n; ++k) sum += 0.5F * (a[k * n + i] * pa[k * n + j] + a[k * n + j] * pa[k * n + i]);
        p[i * n + j] = p[j * n + i] = sum;
      }
    }
  }
}

int main(void) {
  const float pi = 3.14159265F;
  float standing[n] = {0.0F, pi, pi, 0.0F, 0.0F, 0.0F};
  float state[n] = {0.0F, pi + 0.05F, pi - 0.03F, 0.0F, 0.0F, 0.0F};
  cart_default_parameters(parameters);
  if (linearize(standing) != cart_done) return 1;
  find_gains();
  board_print("gains", gains, n);
  const uint32_t begin = board_ticks();
  int iterations = 0;
  for (int k = 0; k < steps; ++k) {
    float force[] = {0.0F};
    for (int i = 0; i < n; ++i) force[0] -= gains[i] * (state[i] - standing[i]);
    force[0] = fminf(fmaxf(force[0], -most_force), most_force);
    if (cart_step(parameters, 0.0F, step_size, force, 20, tolerance, state, state, &work.step) != cart_done) return 1;
    iterations += work.step.iterations;
  }
  const float instructions = (float)(board_ticks() - begin) * board_instructions_a_tick / steps;
  board_print("x, theta_1, theta_2 and rates", state, n);
  board_print("instructions a step", &instructions, 1);
  const float stack = (float)board_stack_used(), mean = (float)iterations / steps;
  board_print("iterations a step", &mean, 1);
  board_print("bytes of stack", &stack, 1);
  return 0;
}
