/* Somebody else's program: it has what was exported, and nothing else of pendula. Built with -DSYSTEM=cart
 * -DHEADER='"cart.h"' (and -DNUMBER=float), called with a number of steps and their size, it prints where they lead,
 * and the derivatives of the last one. -DCONTROLLED=4 lets the exported controller act before every fourth step. Three
 * more words change a number: parameters 2 0.001, t 0 0.001 or h 0 0.001. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include HEADER

#ifndef NUMBER
#define NUMBER double
#endif
#define JOINED(name, what) name##_##what
#define OF(name, what) JOINED(name, what)
#define NAME(what) OF(SYSTEM, what)
#define ROOM(count) ((count) > 0 ? (count) : 1)

enum { states = NAME(states), inputs = NAME(inputs), parameters = NAME(parameters) };

static void print(const char* what, const NUMBER* numbers, int count) {
  printf("%s", what);
  for (int k = 0; k < count; ++k) printf(" %.17g", (double)numbers[k]);
  printf("\n");
}

int main(int count, char** words) {
  static NUMBER by_state[states * states], by_inputs[ROOM(states * inputs)], by_parameters[ROOM(states * parameters)];
  static NAME(sensitivity_work) work;
  NUMBER held[ROOM(inputs)], of_parameters[ROOM(parameters)], of_inputs[ROOM(inputs)], state[states],
      by_times[2 * states];
  NUMBER points[ROOM(NAME(point_numbers))], t, kinetic, energy;
  const int steps = count > 2 ? atoi(words[1]) : 0;
  NUMBER h = count > 2 ? (NUMBER)atof(words[2]) : 0;
  const NUMBER tolerance = sizeof(NUMBER) == sizeof(double) ? (NUMBER)1e-15 : (NUMBER)1e-6;
  NAME(default_parameters)(of_parameters);
  NAME(default_inputs)(of_inputs);
  NAME(start)(&t, state);
  if (count == 6) {
    NUMBER* const moved = strcmp(words[3], "t") == 0 ? &t : strcmp(words[3], "h") == 0 ? &h : of_parameters;
    moved[atoi(words[4])] += (NUMBER)atof(words[5]);
  }
  for (int k = 0; k < steps; ++k) {
#ifdef CONTROLLED
    if (k % CONTROLLED == 0) NAME(control)(of_parameters, t, of_inputs, state, held);
#else
    for (int j = 0; j < inputs; ++j) held[j] = of_inputs[j];
#endif
    const int status = NAME(step_with_sensitivities)(of_parameters, t, h, held, 20, tolerance, state, state, by_state,
                                                     by_inputs, by_parameters, by_times, &work);
    if (status != NAME(done)) {
      fprintf(stderr, "step %d ends with %d after %d iterations\n", k, status, work.step.iterations);
      return 1;
    }
    t += h;
  }
  NAME(energy)(of_parameters, t, of_inputs, state, state + states / 2, &kinetic, &energy);
  NAME(points)(of_parameters, t, of_inputs, state, points);
  print("t", &t, 1);
  print("state", state, states);
  print("energy", &energy, 1);
  print("points", points, NAME(point_numbers));
  print("by_state", by_state, states * states);
  print("by_inputs", by_inputs, states * inputs);
  print("by_parameters", by_parameters, states * parameters);
  print("by_times", by_times, 2 * states);
  print("parameters", of_parameters, parameters);
  print("inputs", of_inputs, inputs);
  printf("iterations %d\n", work.step.iterations);
  return 0;
}
