"""Sends heyoka into the races of a file and adds it there and to the figures of the other contestants.

usage: python bench/heyoka_races.py RACES.json FIGURES.json [--repetitions N] [--longest SECONDS]

heyoka (Biscani, Izzo 2021; doi:10.1093/mnras/stab1032) compiles the Taylor recursions of the equations that
it is given while the program runs. It comes as a Python package, so it races in a process of its own, on the
problems that pendula_bench left in the first file; a run is one call into compiled code, and compiling is not
counted. Chains it gets by the tensions of their rods, other systems by their Lagrangians; with its fast_math and
without.
"""

import argparse
import json
import math
import statistics
import time
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import heyoka as hy
import numpy as np
from heyoka_systems import System

NAME = "heyoka"
TOLERANCES = (1e-8, 1e-10, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16, 1e-17)
COARSE = (1e-5, 1e-6, 1e-7, 1e-11)  # beside them, of few coordinates
FEW = 4
MOST_STEPS = 20_000  # of a run: a first step of an order that knows nothing of it ends anywhere, at any speed
ALLOWED_FLOORS = 10
# Twenty links take 20 s to compile. Longer chains are compiled to loops, which take 1.7 times as long to run.
UNROLLED_LINKS = 20


@dataclass
class Chain:
    """A chain of equal links, all horizontal and at rest, and where it ends; fields as in the file."""

    links: int
    mass: float
    length: float
    gravity: float
    angle: float
    duration: float
    floor: float
    end: list[str]
    sizes: list[float]
    trials: dict = field(default_factory=dict)

    @property
    def unrolled(self) -> bool:
        """Whether it is compiled without loops."""
        return self.links <= UNROLLED_LINKS

    def start(self) -> np.ndarray:
        """Angles and rates at the start."""
        return np.concatenate([np.full(self.links, self.angle), np.zeros(self.links)])

    def formulations(self) -> list[list[tuple]]:
        """Equations of motion, of which the faster ones count."""
        return [equations(self)]


Problem = Chain | System


def tolerances(coordinates: int) -> tuple[float, ...]:
    """Settings of the one knob, from coarse to fine."""
    return tuple(sorted({*TOLERANCES, *(COARSE if coordinates <= FEW else ())}, reverse=True))


def error_of(problem: Problem, state: np.ndarray) -> float:
    """As in problems.hpp."""
    reference = np.array([np.longdouble(value) for value in problem.end])
    off = np.abs(state.astype(np.longdouble) - reference) / problem.sizes
    return float(off.max()) if np.isfinite(off).all() else math.inf


def equations(problem: Chain) -> list[tuple]:
    """The chain by the tensions of its rods, whose equations are tridiagonal: O(n), and n small divisions.

    Bob i accelerates by (T_{i+1} u_{i+1} − T_i u_i)/m + g; along rod i, u_i·(a_i − a_{i−1}) = −l θ̇_i², across
    it l θ̈_i.
    """
    n, m, length, g = problem.links, problem.mass, problem.length, problem.gravity
    theta = hy.make_vars(*(f"theta_{i}" for i in range(n)))
    theta_dot = hy.make_vars(*(f"theta_dot_{i}" for i in range(n)))
    sine, cosine = [hy.sin(angle) for angle in theta], [hy.cos(angle) for angle in theta]
    # Of the angle between a rod and the next one.
    along = [(cosine[i] * cosine[i + 1] + sine[i] * sine[i + 1]) / m for i in range(n - 1)]
    across = [(sine[i] * cosine[i + 1] - cosine[i] * sine[i + 1]) / m for i in range(n - 1)]
    diagonal = [hy.expression((1 if i == 0 else 2) / m) for i in range(n)]
    right = [length * rate * rate for rate in theta_dot]
    right[0] = right[0] + g * cosine[0]
    for i in reversed(range(n - 1)):
        factor = along[i] / diagonal[i + 1]
        diagonal[i] = diagonal[i] - factor * along[i]
        right[i] = right[i] + factor * right[i + 1]
    tension = [right[0] / diagonal[0]]
    for i in range(1, n):
        tension.append((right[i] + along[i - 1] * tension[i - 1]) / diagonal[i])
    acceleration = [-g * sine[0] if i == 0 else tension[i - 1] * across[i - 1] for i in range(n)]
    for i in range(n - 1):
        acceleration[i] = acceleration[i] - tension[i + 1] * across[i]
    rates = list(zip(theta, theta_dot, strict=True))
    return rates + [(rate, a / length) for rate, a in zip(theta_dot, acceleration, strict=True)]


class Run:
    """One whole run, made ready."""

    def __init__(
        self, problem: Problem, formulation: list[tuple], tolerance: float, *, reassociated: bool
    ) -> None:
        """Compiles; `reassociated`: by heyoka's fast_math."""
        self.problem = problem
        self.start = problem.start()
        self.integrator = hy.taylor_adaptive(
            formulation,
            self.start.copy(),
            tol=tolerance,
            compact_mode=not problem.unrolled,
            fast_math=reassociated,
        )

    def __call__(self) -> float:
        """Start to end; seconds."""
        begin = time.perf_counter()
        self.integrator.time = 0.0
        self.integrator.state[:] = self.start
        self.integrator.propagate_until(self.problem.duration, max_steps=MOST_STEPS)
        return time.perf_counter() - begin

    def error(self) -> float:
        """Of the last run."""
        return error_of(self.problem, self.integrator.state)


def attempt(run: Run) -> float:
    """The best of a few runs, about 20 ms of them; seconds."""
    best = spent = run()
    while spent < 0.02:
        again = run()
        best = min(best, again)
        spent += again
    return best


def scan(problem: Problem, longest: float) -> tuple[list[dict], Run, dict]:
    """Every setting; then run and trial that count: the cheapest good one, or the most accurate."""
    trials, runs = [], []
    for formulation, reassociated in product(problem.formulations(), (False, True)):
        for tolerance in tolerances(len(problem.start()) // 2):
            run = Run(problem, formulation, tolerance, reassociated=reassociated)
            seconds = attempt(run)
            trials.append({"setting": tolerance, "milliseconds": seconds * 1e3, "error": run.error()})
            runs.append(run)
            if seconds > longest:
                break
    good = [t for t in trials if t["error"] <= ALLOWED_FLOORS * problem.floor]
    chosen = min(good, key=lambda t: t["milliseconds"]) if good else min(trials, key=lambda t: t["error"])
    return trials, runs[trials.index(chosen)], chosen


def measure(run: Run, repetitions: int) -> dict[str, float]:
    """Median milliseconds of a run over repetitions of about 20 ms each, their relative spread, the fastest run."""
    times, fastest = [], math.inf
    for _ in range(repetitions):
        seconds = [run()]
        while sum(seconds) < 0.02:
            seconds.append(run())
        times.append(1e3 * statistics.fmean(seconds))
        fastest = min(fastest, 1e3 * min(seconds))
    spread = statistics.stdev(times) / statistics.fmean(times) if repetitions > 1 else 0.0
    return {"time": statistics.median(times), "fastest": fastest, "relative_spread": round(spread, 4)}


def long_double_error(problem: System) -> float:
    """How far the reference is from an end by these equations in 80 bits: neither they nor the method are ours."""
    integrator = hy.taylor_adaptive(
        problem.formulations(np.longdouble)[0],
        problem.start().astype(np.longdouble),
        tol=np.longdouble("1e-19"),
        fp_type=np.longdouble,
    )
    integrator.propagate_until(np.longdouble(problem.duration))
    return error_of(problem, integrator.state)


def finite(trial: dict) -> dict:
    """JSON knows no infinity."""
    return {**trial, "error": trial["error"] if math.isfinite(trial["error"]) else None}


def main() -> None:
    """Reads both files, adds heyoka, writes them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("races", type=Path)
    parser.add_argument("figures", type=Path)
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--longest", type=float, default=2)
    options = parser.parse_args()
    files = (options.races, options.figures)
    races, kept = (json.loads(file.read_text(encoding="utf-8")) for file in files)
    for name, race in races.items():
        problem = System(**race) if "kernel" in race else Chain(**race)
        trials, run, chosen = scan(problem, options.longest)
        race["trials"][NAME] = {"knob": "tolerance", "runs": [finite(trial) for trial in trials]}
        measured = measure(run, options.repetitions)
        kept["benchmarks"][f"race/{name}/{NAME}"] = {
            **measured,
            "time_unit": "ms",
            "error": chosen["error"],
            "floor": problem.floor,
            "setting": chosen["setting"],
        }
        floors = chosen["error"] / problem.floor
        setting = f"tolerance {chosen['setting']:g}"
        print(f"{name}, {NAME}: {setting}, {measured['time']:.3g} ms, error {floors:.3g} floors", flush=True)
        if isinstance(problem, System):
            race["end_in_80_bits"] = long_double_error(problem)
            print(f"{name}: {race['end_in_80_bits']:.1e} from the end in 80 bits", flush=True)
    for file, content in zip(files, (races, kept), strict=True):
        file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
