"""Time against error on two linkages: pendula, RATTLE and generalised-alpha by hand, Exudyn, Drake, MuJoCo.

usage: taskset -c 1 python bench/linkage_races.py PROGRAM [--output FILE] [--only REGEX] [--longest SECONDS]

The error is how far a joint is after ten seconds from where it ought to be, in metres. Each contestant runs its
settings from coarse to fine. The cheapest counts that comes within an error and whose next finer one does, too, so that
no error counts that is small by chance. Those run again, in turn.
"""

import argparse
import contextlib
import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from linkage_packages import Run, RunError, by_drake, by_exudyn, by_mujoco
from linkage_problems import (
    A02,
    A02_MODEL,
    A02_PUBLISHED,
    DURATION,
    FOUR_BAR,
    GRAVITY,
    Problem,
    find_truth,
    in_joints,
)

ERRORS = (1e-6, 1e-9)  # m
ROUNDING = 1e-5  # m; larger errors that grow again may have been small by chance


def by_pendula(program: Path, folder: Path, *, joints: bool = False) -> Run:
    """Stepping alone, as its summary tells; by accuracy, where it tries tolerances first, all but its start.

    In angles, as its users write models, or in places of joints, as the methods by hand.
    """
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}  # where kernels are kept
    made: set[str] = set()

    def simulate(problem: Problem, settings: dict, duration: float) -> tuple[dict, float]:
        file = folder / f"{problem.name}.toml"
        model, scenario = in_joints(problem) if joints else (A02_MODEL, problem.scenario)
        (folder / (f"joints_{problem.moving}.py" if joints else "a02.py")).write_text(model)
        file.write_text(scenario)
        keys = {"run.duration": duration, "output.interval": DURATION, **settings}
        if "steps" in settings:
            keys["run.step"] = DURATION / keys.pop("steps")
        words = [
            program,
            "simulate",
            file,
            "--json",
            *(f"--set={key}={value}" for key, value in keys.items()),
        ]
        begin = time.perf_counter()
        ended = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
        if ended.returncode:
            raise RunError(ended.stderr.strip().splitlines()[-1])
        return json.loads(ended.stdout), time.perf_counter() - begin

    def run(problem: Problem, settings: dict) -> tuple[np.ndarray, float]:
        if problem.name not in made:  # its kernel
            simulate(problem, settings, 0)
            made.add(problem.name)
        summary, whole = simulate(problem, settings, DURATION)
        seconds = summary["wall_seconds"]
        if "run.accuracy" in settings:
            seconds = whole - simulate(problem, settings, 1e-6)[1]
        return np.array(summary["final"]["points"]["watched" if joints else problem.point]), seconds

    return run


def by_hand(folder: Path, compiler: str) -> Run:
    """RATTLE and generalised-alpha of linkage_peers.cpp."""
    program = folder / "linkage_peers"
    source = Path(__file__).resolve().with_name("linkage_peers.cpp")
    flags = ["-std=c++20", "-O3", "-DNDEBUG", "-march=native", "-isystem", "/usr/include/eigen3"]
    subprocess.run([compiler, *flags, source, "-o", program], check=True)

    def run(problem: Problem, settings: dict) -> tuple[np.ndarray, float]:
        joints = [*range(problem.moving), *range(-1, -1 - len(problem.fixed), -1)]
        rows = [(GRAVITY, DURATION, len(joints), problem.moving, len(problem.bars), problem.watched)]
        rows += [(*problem.place(k).tolist(), *problem.speed(k).tolist()) for k in joints]
        rows += [(joints.index(bar.a), joints.index(bar.b), bar.mass, bar.length) for bar in problem.bars]
        text = "\n".join(" ".join(map(repr, row)) for row in rows)
        words = [program, settings["method"], str(settings["steps"])]
        ended = subprocess.run(words, input=text, capture_output=True, text=True, check=False)
        if ended.returncode:
            raise RunError(ended.stderr.strip())
        x, y, seconds = map(float, ended.stdout.split())
        return np.array([x, y]), seconds

    return run


@dataclass
class Contestant:
    """A method with its settings: ladders from coarse to fine."""

    name: str
    run: Run
    ladders: list[list[dict]]


def steps(first: int, **others: object) -> list[dict]:
    """More and more of them, by the square root of two."""
    return [{**others, "steps": round(first * math.sqrt(2) ** k)} for k in range(40)]


def contestants(program: Path, compiler: str, folder: Path, only: str) -> list[Contestant]:
    """All whose names a regular expression finds."""
    makers = {
        "pendula, joints": lambda: by_pendula(program, folder, joints=True),
        "pendula": lambda: by_pendula(program, folder),
        "by hand": lambda: by_hand(folder, compiler),
        "Exudyn": by_exudyn,
        "Drake": by_drake,
        "MuJoCo": by_mujoco,
    }
    unwatched = {"run.estimate": "false"}  # as nobody does who does not know the end
    tolerances = [{"run.tolerance": f"1e-{k}", **unwatched} for k in range(4, 14)]
    constant = [
        steps(first, **{"run.stages": stages, "run.iteration": way, **unwatched})
        for stages, first in ((2, 500), (3, 250), (4, 250), (6, 50), (8, 50))
        for way in ("fixed-point", "newton")
    ]
    exudyn = {
        name: [steps(1000, solver=solver, newton=newton) for newton in (1e-8, 1e-10)]
        for name, solver in (
            ("generalised-alpha", "GeneralizedAlpha"),
            ("trapezoidal, index 2", "TrapezoidalIndex2"),
        )
    }
    settings = {
        "pendula, accuracy": [[{"run.accuracy": f"1e-{k}"} for k in range(4, 14)]],
        "pendula, tolerance": [tolerances],
        "pendula, constant steps": constant,
        "pendula, joints, tolerance": [tolerances],
        "pendula, joints, constant steps": constant,
        "by hand: RATTLE": [steps(1000, method="rattle")],
        "by hand: RATTLE, order 6": [steps(250, method="rattle6")],
        "by hand: RATTLE, order 8": [steps(250, method="rattle8")],
        "by hand: generalised-alpha": [steps(2000, method=radius) for radius in ("0.8", "0.95")],
        **{f"Exudyn, {name}": ladders for name, ladders in exudyn.items()},
        "Drake, discrete": [steps(1000)],
        "MuJoCo, RK4": [steps(1000, integrator="RK4", stiff=stiff) for stiff in (1, 2, 4)],
        "MuJoCo, Euler": [steps(1000, integrator="Euler", stiff=2)],
    }
    chosen = {name: ladders for name, ladders in settings.items() if re.search(only, name)}
    runs = {key: make() for key, make in makers.items() if any(name.startswith(key) for name in chosen)}
    return [
        Contestant(name, next(run for key, run in runs.items() if name.startswith(key)), ladders)
        for name, ladders in chosen.items()
    ]


def attempt(contestant: Contestant, problem: Problem, settings: dict) -> dict:
    """The best of three runs, of slow ones of one."""
    try:
        ends = [contestant.run(problem, settings)]
        while ends[0][1] < 0.1 and len(ends) < 3:
            ends.append(contestant.run(problem, settings))
    except RunError as failure:
        return {"settings": settings, "error": math.inf, "seconds": 0.0, "failure": str(failure)}
    error = float(np.hypot(*(ends[0][0] - problem.truth)))
    return {"settings": settings, "error": error, "seconds": min(seconds for _, seconds in ends)}


def scan(contestant: Contestant, problem: Problem, longest: float) -> list[list[dict]]:
    """Each ladder until its runs take too long or are good enough, or six in a row fail or are worse by rounding."""
    tried = []
    for ladder in contestant.ladders:
        trials: list[dict] = []
        for settings in ladder:
            trials.append(attempt(contestant, problem, settings))
            errors = [trial["error"] for trial in trials]
            past = errors.index(min(errors)) < len(errors) - 6 and not ROUNDING < min(errors) < math.inf
            if trials[-1]["seconds"] > longest or past or max(errors[-2:]) < min(ERRORS) / 100:
                break
        tried.append(trials)
    return tried


def choose(tried: list[list[dict]], error: float) -> dict | None:
    """The cheapest trial within an error whose next finer one, of those that got to the end, is so, too."""
    ran = [[trial for trial in trials if math.isfinite(trial["error"])] for trials in tried]
    good = [
        trial
        for trials in ran
        for k, trial in enumerate(trials)
        if all(each["error"] <= error for each in trials[k : k + 2])
    ]
    return min(good, key=lambda trial: trial["seconds"], default=None)


def race(problem: Problem, field: list[Contestant], arguments: argparse.Namespace) -> dict:
    """Scans, then runs what was chosen again, in turn."""
    problem.truth = find_truth(problem)
    found: dict[str, dict] = {}
    for contestant in field:
        tried = scan(contestant, problem, arguments.longest)
        every = [trial for trials in tried for trial in trials]
        nearest = min(every, key=lambda trial: trial["error"])
        chosen = {f"{error:.0e}": choose(tried, error) or nearest for error in ERRORS}
        failed = sum(not math.isfinite(trial["error"]) for trial in every)
        found[contestant.name] = {"chosen": chosen, "nearest": nearest, "failed": failed, "trials": every}
        print(
            f"{problem.name}, {contestant.name}: nearest {nearest['error']:.1e} m",
            file=sys.stderr,
            flush=True,
        )
    for _ in range(arguments.rounds):
        for contestant in field:
            for trial in {id(trial): trial for trial in found[contestant.name]["chosen"].values()}.values():
                if math.isfinite(trial["error"]):
                    trial.setdefault("times", []).append(contestant.run(problem, trial["settings"])[1])
    for each in found.values():
        for trial in each["chosen"].values():
            trial["seconds"] = statistics.median(trial.get("times", [math.nan]))
    return found


def tabulate(problem: Problem, found: dict) -> str:
    """A table in Markdown; slanted where the error was not reached: time and error of the nearest."""
    columns = "".join(f" {error:.0e} m: ms | over pendula |" for error in ERRORS)
    lines = [
        f"| {problem.name} |{columns} nearest, m | failed |",
        "| --- |" + " --- |" * (2 * len(ERRORS) + 2),
    ]
    for name, each in found.items():
        cells = []
        for error, trial in each["chosen"].items():
            shown = f"{1e3 * trial['seconds']:.3g}"
            if not trial["error"] <= float(error):
                cells += [f"*{shown} ({trial['error']:.0e})*", ""]
                continue
            ours = [one["chosen"][error] for key, one in found.items() if key.startswith("pendula")]
            best = min((one["seconds"] for one in ours if one["error"] <= float(error)), default=math.nan)
            cells += [shown, f"{trial['seconds'] / best:.3g}×"]
        failed = f"{each['failed']} of {len(each['trials'])}"
        lines.append(f"| {name} | {' | '.join(cells)} | {each['nearest']['error']:.1e} | {failed} |")
    return "\n".join(lines)


def main() -> None:
    """Races on both, prints tables, writes what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--compiler", default="clang++")
    parser.add_argument("--output", type=Path, default=Path("linkages.json"))
    parser.add_argument("--only", default="", help="contestants whose names this regular expression finds")
    parser.add_argument(
        "--longest", type=float, default=10.0, help="seconds of a run, past which nothing finer is tried"
    )
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    results: dict = {"load": os.getloadavg()[0]}
    results["versions"] = {name: version(name) for name in ("exudyn", "drake", "mujoco")}
    arguments.output = arguments.output.resolve()
    # MuJoCo leaves its warnings in the folder where it is.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        field = contestants(program, arguments.compiler, Path(folder), arguments.only)
        for problem in (FOUR_BAR, A02):
            found = race(problem, field, arguments)
            results[problem.name] = {"truth": problem.truth.tolist(), "contestants": found}
            print(tabulate(problem, found), end="\n\n", flush=True)
            text = (
                json.dumps(results, default=str, indent=1).replace("Infinity", "null").replace("NaN", "null")
            )
            arguments.output.write_text(text + "\n")
    off = np.hypot(*(A02.truth - A02_PUBLISHED))
    print(f"The quadrature is {off:.1e} m off the published end of A02.")
    print(f"{results['versions']}; load {results['load']:.1f} before and {os.getloadavg()[0]:.1f} after")


if __name__ == "__main__":
    main()
