"""Exported steps against the same Gauss method as CasADi generates it: the table of docs/reference/export.md.

usage: python bench/casadi_steps.py PENDULA [FLAGS...]

PENDULA is the program; FLAGS are the C compiler's, -O2 where there are none. CasADi's steps are simpleIRK with two
points and fast_newton; its equations are derived by CasADi from the same Lagrangian. Both iterate until 1e-12. Medians
of 101 runs of 200 steps of 0.01 s, in µs a step, and work memory.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca

STEP = 0.01  # s
SYSTEMS = {  # name: what is exported, links, whether in space, whether on a cart
    "planar, 2 links": (["planar:2"], 2, False, False),
    "cart, 2 links": (["cart_chain", "--links", "2"], 2, False, True),
    "spatial, 2 links": (["spatial:2"], 2, True, False),
}
RACE = r"""
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "system.h"
#include "their.h"

enum { n = system_states, kinds = 4, runs = 101, steps = 200 };
static system_sensitivity_work work;
static double parameters[system_parameters], inputs[system_inputs], w[100000];
static casadi_int iw[10000];

static double now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return 1e6 * (double)time.tv_sec + 1e-3 * (double)time.tv_nsec;
}

static int take(int kind, double *x) {
  static double a[n * n], b[n * system_inputs], next[n];
  const double *arg[64] = {x, inputs};
  double *res[64] = {next, a, b};
  int status;
  if (kind == 0) return system_step(parameters, 0, STEP, inputs, 20, 1e-12, x, x, &work.step);
  if (kind == 1) {
    return system_step_with_sensitivities(parameters, 0, STEP, inputs, 20, 1e-12, x, x, a, b, NULL, NULL, &work);
  }
  status = kind == 2 ? their_step(arg, res, iw, w, 0) : their_slopes(arg, res, iw, w, 0);
  for (int k = 0; k < n; ++k) x[k] = next[k];
  return status;
}

static int less(const void *a, const void *b) {
  return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

int main(void) {
  casadi_int arg_count, res_count, iw_count, w_count;
  system_default_parameters(parameters);
  static double took[kinds][runs];
  for (int run = 0; run < runs; ++run) {
    for (int kind = 0; kind < kinds; ++kind) {  // in turn: what else the machine does disturbs all of them
      double x[n] = {0};
      for (int k = 0; k < n / 2; ++k) x[k] = 0.9 + 0.3 * k;
      for (int k = n / 2 + 2; SPATIAL && k < n; ++k) x[k] = 2.5;
      const double begin = now();
      for (int k = 0; k < steps; ++k) {
        if (take(kind, x) != 0) return 1;
      }
      took[kind][run] = (now() - begin) / steps;
    }
  }
  for (int kind = 0; kind < kinds; ++kind) {
    qsort(took[kind], runs, sizeof *took[kind], less);
    printf("%.2f ", took[kind][runs / 2]);
  }
  their_step_work(&arg_count, &res_count, &iw_count, &w_count);
  printf("%zu %lld\n", sizeof work.step, 8 * (arg_count + res_count + iw_count + w_count));
  return 0;
}
"""


def dynamics(links: int, in_space: bool, on_cart: bool) -> ca.Function:
    """x, u -> x_dot of a chain with unit masses and lengths."""
    count = links * (2 if in_space else 1) + on_cart
    q, v = ca.SX.sym("q", count), ca.SX.sym("v", count)
    u = ca.SX.sym("u", 1 if on_cart else links * (3 if in_space else 1))
    kinetic, potential = (v[0] ** 2 / 2 if on_cart else 0), 0
    place = ca.vertcat(q[0] if on_cart else 0, 0, 0)
    force = ca.vertcat(u, ca.SX.zeros(count - 1)) if on_cart else ca.SX.zeros(count) if in_space else u
    for k in range(links):
        theta, phi = q[on_cart + k], q[links + k] if in_space else 0
        place += ca.vertcat(ca.sin(theta) * ca.cos(phi), ca.sin(theta) * ca.sin(phi), -ca.cos(theta))
        kinetic += ca.sumsqr(ca.jtimes(place, q, v)) / 2
        potential += 9.81 * place[2]
    p = ca.gradient(kinetic, v)
    right = ca.gradient(kinetic - potential, q) - ca.jtimes(p, q, v) + force
    acceleration = ca.solve(ca.jacobian(p, v), right)
    return ca.Function("f", [ca.vertcat(q, v), u], [ca.vertcat(v, acceleration)], ["x", "p"], ["xdot"])


def generate(f: ca.Function, folder: Path) -> None:
    """their.c and their.h: a step, and one with its derivatives."""
    whole = ca.simpleIRK(f, 1, 2, "legendre", "fast_newton", {"abstol": 1e-12, "max_iter": 20})
    x, u = ca.MX.sym("x", f.size1_in(0)), ca.MX.sym("u", f.size1_in(1))
    following = whole(x, u, STEP)
    slopes = [following, ca.jacobian(following, x), ca.jacobian(following, u)]
    generator = ca.CodeGenerator("their.c", {"with_header": True})
    generator.add(ca.Function("their_step", [x, u], [following]))
    generator.add(ca.Function("their_slopes", [x, u], slopes))
    generator.generate(f"{folder}/")


def main(pendula: str, flags: list[str]) -> None:
    print("| | pendula | CasADi | with derivatives by state and inputs | CasADi | bytes | CasADi |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name, (what, links, in_space, on_cart) in SYSTEMS.items():
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            command = [pendula, "export", *what, "--as", "c", "--name", "system", "-o", folder]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            generate(dynamics(links, in_space, on_cart), folder)
            (folder / "race.c").write_text(RACE)
            files = [folder / file for file in ("race.c", "system.c", "their.c")]
            defined = [f"-DSTEP={STEP}", f"-DSPATIAL={int(in_space)}"]
            build = ["cc", "-std=c99", *flags, *defined, *files, "-o", folder / "race", "-lm"]
            subprocess.run(build, check=True)
            ours, ours_slopes, theirs, their_slopes, room, their_room = subprocess.run(
                [folder / "race"], check=True, capture_output=True, text=True
            ).stdout.split()
            print(f"| {name} | {ours} | {theirs} | {ours_slopes} | {their_slopes} | {room} | {their_room} |")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:] or ["-O2"])
