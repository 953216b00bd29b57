/* Calls the discrete model as acados does: asks for sizes, gives work memory, takes the step and its derivative. Prints
 * the next state, and the derivative column by column. */
#include <stdio.h>
#include <stdlib.h>

typedef long long int casadi_int;
#define FUNCTION(name)                                                 \
  int name(const double**, double**, casadi_int*, double*, int);       \
  int name##_work(casadi_int*, casadi_int*, casadi_int*, casadi_int*); \
  const casadi_int* name##_sparsity_in(casadi_int);                    \
  const casadi_int* name##_sparsity_out(casadi_int);                   \
  casadi_int name##_n_in(void);                                        \
  casadi_int name##_n_out(void);
FUNCTION(system_dyn_disc_phi_fun)
FUNCTION(system_dyn_disc_phi_fun_jac)

/* Numbers of a dense matrix. */
static int size(const casadi_int* sparsity) {
  if (sparsity[2] != 1) exit(3);
  return (int)(sparsity[0] * sparsity[1]);
}

/* Words: x, u, then parameters, t, h. */
int main(int count, char** words) {
  casadi_int arg_room, res_room, iw_room, w_room;
  double numbers[200], next[64], again[64], slope[4096];
  const double* arg[16];
  double* res[16];
  if (system_dyn_disc_phi_fun_n_in() != 3 || system_dyn_disc_phi_fun_jac_n_in() != 3) return 3;
  if (system_dyn_disc_phi_fun_n_out() != 1 || system_dyn_disc_phi_fun_jac_n_out() != 2) return 3;
  system_dyn_disc_phi_fun_jac_work(&arg_room, &res_room, &iw_room, &w_room);
  if (arg_room > 16 || res_room > 16) return 3;
  double* w = malloc((size_t)w_room * sizeof *w);
  for (int k = 1, place = 0; k < count; ++k) numbers[place++] = atof(words[k]);
  const double* from = numbers;
  for (int k = 0; k < 3; ++k) {
    arg[k] = from;
    from += size(system_dyn_disc_phi_fun_jac_sparsity_in(k));
  }
  if (from != numbers + count - 1) return 3;
  res[0] = next;
  res[1] = slope;
  if (system_dyn_disc_phi_fun_jac(arg, res, NULL, w, 0) != 0) return 1;
  res[0] = again;
  if (system_dyn_disc_phi_fun(arg, res, NULL, w, 0) != 0) return 1;
  const int states = size(system_dyn_disc_phi_fun_sparsity_out(0));
  for (int k = 0; k < states; ++k) {
    if (next[k] != again[k]) return 4;
    printf("%.17g ", next[k]);
  }
  for (int k = 0; k < size(system_dyn_disc_phi_fun_jac_sparsity_out(1)); ++k) printf("%.17g ", slope[k]);
  free(w);
  return 0;
}
