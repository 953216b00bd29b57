#include <math.h>
#include <pendula/kernels/cart_1.h>
#include <pendula/kernels/planar_2.h>
#include <stdio.h>

/* A double pendulum for a second, and a cart that is pushed: m x'' = F. */
int main(void) {
  double parameters[planar_2_parameters], inputs[planar_2_inputs], state[planar_2_states], t;
  double kinetic, before, after;
  planar_2_work work;
  planar_2_default_parameters(parameters);
  planar_2_default_inputs(inputs);
  planar_2_start(&t, state);
  state[0] = 1;
  state[1] = 2;
  planar_2_energy(parameters, t, inputs, state, state + 2, &kinetic, &before);
  for (int k = 0; k < 1000; ++k) {
    if (planar_2_step(parameters, t, 1e-3, inputs, 20, 1e-14, state, state, &work) != planar_2_done) return 1;
    t += 1e-3;
  }
  planar_2_energy(parameters, t, inputs, state, state + 2, &kinetic, &after);
  printf("energy changes by %.1e\n", after - before);

  double cart_parameters[cart_1_parameters], push[cart_1_inputs] = {3}, cart[cart_1_states] = {0};
  cart_1_work cart_work;
  cart_1_default_parameters(cart_parameters);
  if (cart_1_step(cart_parameters, 0, 2, push, 20, 1e-14, cart, cart, &cart_work) != cart_1_done) return 1;
  return fabs(after - before) < 1e-9 && fabs(cart[0] - 6) < 1e-12 ? 0 : 2; /* measured 1.8e-11, 0 */
}
