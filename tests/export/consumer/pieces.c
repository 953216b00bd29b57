/* Somebody else's program, for a model with functions of several pieces. Built as main.c is, called with a step size
 * and a duration, it prints the state and the time where it ends, how, and when pieces changed. */
#include <stdio.h>
#include <stdlib.h>
#include HEADER

#ifndef NUMBER
#define NUMBER double
#endif
#define JOINED(name, what) name##_##what
#define OF(name, what) JOINED(name, what)
#define NAME(what) OF(SYSTEM, what)
#define ROOM(count) ((count) > 0 ? (count) : 1)

static void print(const char* what, const NUMBER* numbers, int count) {
  printf("%s", what);
  for (int k = 0; k < count; ++k) printf(" %.17g", (double)numbers[k]);
  printf("\n");
}

int main(int count, char** words) {
  static NAME(work) work;
  static NUMBER changes[1000];
  NUMBER parameters[NAME(parameters)], inputs[ROOM(NAME(inputs))], state[NAME(states)], t;
  if (count != 3) return 2;
  const NUMBER h = (NUMBER)atof(words[1]), end = (NUMBER)atof(words[2]);
  const NUMBER tolerance = sizeof(NUMBER) == sizeof(double) ? (NUMBER)1e-15 : (NUMBER)1e-6;
  int changed = 0;
  NAME(default_parameters)(parameters);
  NAME(default_inputs)(inputs);
  NAME(start)(&t, state);
  int status = NAME(choose_pieces)(parameters, t, inputs, state);
  while (status == NAME(done) && t < end && changed < 1000) {
    const NUMBER most = end - t < h ? end - t : h;
    NUMBER taken;
    status = NAME(step_to_switch)(parameters, t, most, inputs, 20, tolerance, state, state, &taken, &work);
    t += taken;
    if (taken < most) changes[changed++] = t;
  }
  const NUMBER ended = (NUMBER)status;
  print("state", state, NAME(states));
  print("t", &t, 1);
  print("status", &ended, 1);
  print("changes", changes, changed);
  return 0;
}
