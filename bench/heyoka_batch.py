"""What heyoka's batch mode takes for the members that `pendula_lanes FILE` has written, and how far it is off.

usage: python bench/heyoka_batch.py FILE [--lanes N] [--repetitions N]

Double pendulums of equal links at rest, ten seconds, as many in a register as heyoka finds good here. Errors are the
median distance, in angles and rates, to the ends in the file.
"""

import argparse
import math
import statistics
import time
from pathlib import Path

import heyoka as hy
import numpy as np

DURATION = 10.0  # s, as in lanes.cpp
TOLERANCES = (1e-4, 1e-6, 1e-9, 1e-12, 1e-15)


def equations() -> list[tuple]:
    """Of masses and lengths 1, solved for the accelerations; the divisions by g are in the numbers."""
    a, b, u, v = hy.make_vars("a", "b", "u", "v")
    sine, cosine, g = hy.sin(a - b), hy.cos(a - b), 9.81
    below = 1 + sine * sine
    first = -2 * g * hy.sin(a) + cosine * g * hy.sin(b) - sine * (u * u * cosine + v * v)
    second = 2 * (u * u * sine - g * hy.sin(b) + g * hy.sin(a) * cosine) + v * v * sine * cosine
    return [(a, u), (b, v), (u, first / below), (v, second / below)]


def main() -> None:
    """Prints a line a tolerance."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--lanes", type=int, default=hy.recommended_simd_size())
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    rows = np.loadtxt(options.file)
    starts, ends = rows[:, :2], rows[:, 2:]
    lanes = options.lanes
    for tolerance in TOLERANCES:
        integrator = hy.taylor_adaptive_batch(equations(), np.zeros((4, lanes)), tol=tolerance)
        times, reached = [], np.empty_like(ends)
        for _ in range(options.repetitions):
            begin = time.thread_time()
            for first in range(0, len(starts), lanes):
                integrator.set_time(0.0)
                integrator.state[:2] = starts[first : first + lanes].T
                integrator.state[2:] = 0
                integrator.propagate_until(DURATION)
                reached[first : first + lanes] = integrator.state.T
            times.append((time.thread_time() - begin) / len(starts))
        turns = np.round((reached[:, :2] - ends[:, :2]) / (2 * math.pi))
        reached[:, :2] -= 2 * math.pi * turns
        error = np.median(np.abs(reached - ends).max(axis=1))
        print(
            f"{lanes} lanes, tolerance {tolerance:.0e}: {statistics.median(times) * 1e6:7.2f} us a member "
            f"(best {min(times) * 1e6:7.2f}), error {error:.1e}"
        )


if __name__ == "__main__":
    main()
