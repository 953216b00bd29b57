"""Adds to kept figures what heyoka takes for the exponent of bench/lyapunov.cpp, by its variational equations.

usage: python bench/heyoka_lyapunov.py FIGURES.json [--repetitions N]

One tangent beside the motion, made shorter once in 2 s: eight equations, which heyoka derives itself.
"""

import argparse
import json
import math
import time
from pathlib import Path

import heyoka as hy
import numpy as np
from heyoka_races import measure

DURATION = 100.0  # s, as in lyapunov.cpp
INTERVAL = 2.0  # s, in which the tangent grows by a hundred: steps are seldom cut
MASSES, LENGTHS, GRAVITY = (0.2, 0.1), (0.1, 0.08), 9.8
DIGITS = (9, 12)


def double_pendulum() -> list[tuple]:
    """In angles, solved for the accelerations."""
    (m1, m2), (l1, l2), g = MASSES, LENGTHS, GRAVITY
    a, b, u, v = hy.make_vars("a", "b", "u", "v")
    sine, cosine = hy.sin(a - b), hy.cos(a - b)
    below = m1 + m2 * sine * sine
    first = (
        -g * (m1 + m2) * hy.sin(a)
        + m2 * cosine * g * hy.sin(b)
        - m2 * sine * (l1 * u * u * cosine + l2 * v * v)
    )
    second = (m1 + m2) * (
        l1 * u * u * sine - g * hy.sin(b) + g * hy.sin(a) * cosine
    ) + m2 * l2 * v * v * sine * cosine
    return [(a, u), (b, v), (u, first / (l1 * below)), (v, second / (l2 * below))]


def with_tangent(motion: list[tuple]) -> list[tuple]:
    """And d' = J d."""
    tangent = hy.make_vars(*(f"d_{k}" for k in range(len(motion))))
    rows = []
    for direction, (_, rate) in zip(tangent, motion, strict=True):
        terms = [hy.diff(rate, variable) * d for (variable, _), d in zip(motion, tangent, strict=True)]
        rows.append((direction, hy.sum(terms)))
    return motion + rows


class Run:
    """One whole run, made ready."""

    def __init__(self, tolerance: float) -> None:
        """Compiles."""
        start = [1.5, 1.5, 0, 0, 0.5, -0.5, 0.5, 0.5]
        self.start = np.array(start)
        self.integrator = hy.taylor_adaptive(with_tangent(double_pendulum()), start, tol=tolerance)
        self.exponent = math.nan

    def __call__(self) -> float:
        """Start to end; seconds."""
        begin = time.perf_counter()
        integrator = self.integrator
        integrator.time = 0.0
        integrator.state[:] = self.start
        grown = 0.0
        for k in range(1, round(DURATION / INTERVAL) + 1):
            integrator.propagate_until(k * INTERVAL)
            length = np.linalg.norm(integrator.state[4:])
            grown += math.log(length)
            integrator.state[4:] /= length
        self.exponent = grown / DURATION
        return time.perf_counter() - begin


def main() -> None:
    """Reads the figures, adds heyoka's, writes them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("figures", type=Path)
    parser.add_argument("--repetitions", type=int, default=9)
    options = parser.parse_args()
    kept = json.loads(options.figures.read_text(encoding="utf-8"))
    for digits in DIGITS:
        run = Run(10.0**-digits)
        figures = {**measure(run, options.repetitions), "time_unit": "ms", "exponent": run.exponent}
        kept["benchmarks"][f"lyapunov/heyoka/{digits} digits"] = figures
        print(
            f"lyapunov, heyoka, {digits} digits: {figures['time']:.3g} ms, {run.exponent:.3g} 1/s", flush=True
        )
    options.figures.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
