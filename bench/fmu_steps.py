"""An FMU against the program: the figures of docs/reference/export.md.

usage: python bench/fmu_steps.py PENDULA [RUNS]

PENDULA is the program. A cart with two links over 20 s at a tolerance of 1e-12, its states every millisecond: those of
an FMU by an importer in C, those of the program in a CSV file. Prints the median time of RUNS of each (21 where nothing
is said), in s, and the largest difference of their states.
"""

import csv
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from xml.etree import ElementTree

SCENARIO = """
[system]
model = "cart_chain"
links = 2
[start]
theta = [1.0, 0.5]
[run]
duration = 20.0
tolerance = 1e-12
estimate = false
[output]
interval = 1e-3
"""
STATES = ("x", "theta_1", "theta_2", "x_dot", "theta_dot_1", "theta_dot_2")
IMPORTER = r"""
#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { points = 20001, states = 6 };
typedef void *(*Instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t,
                             void *, void (*)(void), void (*)(void));
typedef int (*Step)(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int (*Get)(void *, const uint32_t *, size_t, double *, size_t);
static double rows[points][states];

static double now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* of: binary, token, value reference of the first state, runs; prints a time each, then the rows */
int main(int count, char **of) {
  void *const library = dlopen(of[1], RTLD_NOW);
  if (count != 5 || library == NULL) return fprintf(stderr, "%s\n", dlerror()), 1;
  const Instantiate instantiate = (Instantiate)dlsym(library, "fmi3InstantiateCoSimulation");
  const Step step = (Step)dlsym(library, "fmi3DoStep");
  const Get get = (Get)dlsym(library, "fmi3GetFloat64");
  void (*const release)(void *) = (void (*)(void *))dlsym(library, "fmi3FreeInstance");
  uint32_t places[states];
  for (int k = 0; k < states; ++k) places[k] = (uint32_t)(atoi(of[3]) + k);
  for (int run = 0; run < atoi(of[4]); ++run) {
    bool told[3];
    double last;
    const double begin = now();
    void *const one = instantiate("one", of[2], NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    get(one, places, states, rows[0], states);
    for (int k = 1; k < points; ++k) {
      if (step(one, (k - 1) * 1e-3, 1e-3, true, told, told + 1, told + 2, &last) != 0) return 2;
      get(one, places, states, rows[k], states);
    }
    release(one);
    printf("%.17g\n", now() - begin);
  }
  for (int k = 0; k < points; ++k) {
    for (int i = 0; i < states; ++i) printf("%.17g ", rows[k][i]);
    printf("\n");
  }
  return 0;
}
"""


def by_fmu(program: str, folder: Path, runs: int) -> tuple[list[float], list[list[float]]]:
    subprocess.run([program, "export", "cart.toml", "--as", "fmu", "-o", "."], cwd=folder, check=True)
    print(f"FMU: {(folder / 'cart.fmu').stat().st_size / 1e6:.1f} MB")
    with zipfile.ZipFile(folder / "cart.fmu") as archive:
        archive.extractall(folder / "cart")
    [binary] = (folder / "cart/binaries").glob("*/*")
    description = ElementTree.parse(folder / "cart/modelDescription.xml").getroot()
    [first] = [v.get("valueReference") for v in description.find("ModelVariables") if v.get("name") == "x"]
    (folder / "importer.c").write_text(IMPORTER)
    subprocess.run(["cc", "-O2", "importer.c", "-o", "importer", "-ldl"], cwd=folder, check=True)
    command = ["./importer", binary, description.get("instantiationToken"), first, str(runs)]
    printed = subprocess.run(
        command, cwd=folder, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    return [*map(float, printed[:runs])], [[*map(float, line.split())] for line in printed[runs:]]


def by_program(program: str, folder: Path, runs: int) -> tuple[list[float], list[list[float]]]:
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        command = [program, "simulate", "cart.toml", "-o", "cart.csv"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        times.append(time.perf_counter() - begin)
    with open(folder / "cart.csv") as file:
        rows = [[float(row[name]) for name in STATES] for row in csv.DictReader(file)]
    return times, rows


def main(program: str, runs: int = 21) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cart.toml").write_text(SCENARIO)
        ours, rows = by_fmu(program, folder, runs)
        its, theirs = by_program(program, folder, runs)
    apart = max(abs(x - y) for a, b in zip(rows, theirs, strict=True) for x, y in zip(a, b, strict=True))
    print(f"FMU: {statistics.median(ours):.3f} s")
    print(f"program: {statistics.median(its):.3f} s")
    print(f"apart: {apart:.1e}")


if __name__ == "__main__":
    main(str(Path(sys.argv[1]).resolve()), *map(int, sys.argv[2:]))
