"""Runs pendula on random chains and compares each end with a converged reference.

usage: python tests/campaign/random_chains.py --seed 1 --count 2000 --program build/release/bin/pendula

Each chain is run with four sets of options, the last one the program's own choice. A run is
  right          bobs and velocities at the end within 1e-3 (of the chain's length, of the largest speed met)
  false alarm    right, but with a warning
  warned         wrong, and a warning says so
  refused        exit status 1 with a message, or no end within a minute
  SILENT         wrong without a word: its scenario is written to FOLDER/silent, to be run again
Chains whose reference is not converged are left out and counted. Ends with exit status 1 where a run was
silent.

Durations are cut so that chaos leaves digits: a disturbance of the start grows by GROWTH at most. References
are kept in FOLDER/references.jsonl.
"""

import argparse
import hashlib
import json
import math
import os
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import reference

OPTIONS = {
    "2 stages, 1 ms": {"stages": 2, "step": 1e-3},
    "6 stages, 1 ms": {"stages": 6, "step": 1e-3},
    "8 stages, 0.1 ms": {"stages": 8, "step": 1e-4},
    "default": {},
}
CLASSES = ("right", "false alarm", "warned", "refused", "SILENT")
RIGHT = 1e-3
CONVERGED = 1e-5  # what the reference may leave open
PARTS = (
    1 / 16,
    1 / 8,
    1 / 4,
    1 / 2,
    1,
)  # of the duration drawn, of which the longest that chaos allows is run
PATIENCE = 60.0  # seconds a run may take


# --- drawing


@dataclass
class Draw:
    """One random chain. Every kind of trouble has its own chance, so that each comes alone, too."""

    dice: random.Random
    kinds: set[str] = field(default_factory=set)

    def chance(self, probability: float, kind: str) -> bool:
        if self.dice.random() >= probability:
            return False
        self.kinds.add(kind)
        return True

    def power(self, low: float, high: float) -> float:
        return 10 ** self.dice.uniform(low, high)

    def scenario(self) -> dict:
        space = self.dice.choice(["planar", "spatial"])
        links = self.dice.randint(1, 8)
        lengths = self.spread(links, 0.3, (0.1, 1.5, "lengths"))
        size = self.power(-1, 0.5)
        lengths = [size * r for r in lengths]
        masses = self.spread(links, 0.5, (0.25, 1.5, "masses"), (0.06, 3.0, "masses 1e6"))
        gravity = 9.81
        if self.chance(0.15, "no gravity"):
            gravity = 0.0
        elif self.chance(0.15, "upwards"):
            gravity = -self.dice.uniform(1, 10)
        chain = {"space": space, "links": links, "masses": masses, "lengths": lengths, "gravity": gravity}
        self.add_damping(chain)
        self.add_torques(chain)
        return {"chain": chain, "start": self.start(space, links)}

    def spread(self, links: int, usual: float, *rarer: tuple[float, float, str]) -> list[float]:
        width = usual
        for probability, wider, kind in rarer:
            if self.chance(probability, kind):
                width = wider
        return [self.power(-width, width) for _ in range(links)]

    def start(self, space: str, links: int) -> dict:
        fast = 20.0 if self.chance(0.2, "fast") else self.dice.choice([0.0, 1.0, 5.0])
        near_pole = self.chance(0.25, "pole")
        rates = {"theta_dot": [self.dice.uniform(-fast, fast) for _ in range(links)]}
        if space == "spatial":
            rates["phi"] = [self.dice.uniform(-math.pi, math.pi) for _ in range(links)]
            rates["phi_dot"] = [self.dice.uniform(-fast, fast) for _ in range(links)]
        return {"theta": [self.theta(near_pole) for _ in range(links)], **rates}

    def theta(self, near_pole: bool) -> float:
        if not near_pole:
            return self.dice.uniform(-math.pi, math.pi)
        off = self.dice.choice([0.0, 1e-300, self.power(-16, -1), -self.power(-4, -1)])
        return self.dice.choice([0.0, 0.0, math.pi]) + off

    def add_damping(self, chain: dict) -> None:
        inertias = [m * r**2 for m, r in zip(chain["masses"], chain["lengths"], strict=True)]
        if self.chance(0.25, "damped"):
            chain["damping"] = [self.power(-2, 0) * inertia for inertia in inertias]
        elif self.chance(0.15, "stiff"):
            chain["damping"] = [self.power(0, 6) * inertia for inertia in inertias]

    def add_torques(self, chain: dict) -> None:
        heavy = self.dice.random() < 0.15

        def amplitude(link: int) -> float | list[float]:
            mass = sum(chain["masses"][link:]) if heavy else chain["masses"][link]
            scale = mass * chain["lengths"][link] * max(abs(chain["gravity"]), 1.0) * self.power(-2, 0)
            parts = [scale * self.dice.uniform(-1, 1) for _ in range(3)]
            return parts if chain["space"] == "spatial" else parts[0]

        if self.chance(0.2, "torque"):
            chain["torque"] = [amplitude(link) for link in range(chain["links"])]
        if self.chance(0.25, "driven"):
            links = [self.dice.randrange(chain["links"]) for _ in range(self.dice.randint(1, 2))]
            chain["drive"] = [
                {
                    "link": link + 1,
                    "amplitude": amplitude(link),
                    "frequency": self.dice.uniform(0, 50),
                    "phase": self.dice.uniform(0, 2 * math.pi),
                }
                for link in links
            ]


@dataclass
class Case:
    """A chain, and where it is at the end of its run."""

    number: int
    kinds: set[str]
    scenario: dict
    end: reference.Moment | None = None

    @property
    def chain(self) -> reference.Chain:
        return reference.read(self.scenario)


def draw(seed: int, number: int) -> Case:
    drawing = Draw(random.Random(f"{seed}:{number}"))
    scenario = drawing.scenario()
    scenario["run"] = {"duration": drawing.power(math.log10(0.5), 1)}
    return Case(number, drawing.kinds, scenario)


# --- references


class References:
    """Converged ends, computed once."""

    def __init__(self, program: Path, file: Path) -> None:
        self.reference = reference.Reference(program)
        self.file = file
        self.known: dict[str, list[dict]] = {}
        if file.exists():
            for line in file.read_text().splitlines():
                self.known.update([json.loads(line)])

    def moments(self, chain: reference.Chain, times: list[float]) -> list[reference.Moment]:
        settings = (
            reference.EXPLICIT,
            reference.IMPLICIT,
            reference.STIFF,
            reference.LIMIT,
            reference.DISTURBANCE,
        )
        key = hashlib.sha256(f"{reference.numbers(chain, times)} {settings}".encode()).hexdigest()
        if key not in self.known:
            self.known[key] = [vars(moment) for moment in self.reference.find(chain, times)]
            with self.file.open("a") as kept:
                kept.write(json.dumps([key, self.known[key]]) + "\n")
        return [reference.Moment(**moment) for moment in self.known[key]]

    def settle(self, case: Case, growth: float) -> None:
        """Cuts the run where chaos begins to eat its digits, and gives it its end."""
        times = [case.scenario["run"]["duration"] * part for part in PARTS]
        moments = self.moments(case.chain, times)
        for time, moment in zip(times, moments, strict=False):
            if moment.uncertainty > CONVERGED or moment.growth > growth:
                break
            case.scenario["run"]["duration"], case.end = time, moment


# --- runs


@dataclass(frozen=True)
class Verdict:
    """What became of one run."""

    case: Case
    options: str
    kind: str
    error: float
    words: str


def tag(options: str) -> str:
    """What files of a run with these options are called by."""
    return options.split(",")[0].replace(" ", "_")


def judge(case: Case, options: str, program: Path, folder: Path) -> Verdict:
    scenario = {
        **case.scenario,
        "run": {**case.scenario["run"], **OPTIONS[options]},
        "output": {"every": 1000000000},
    }
    file = folder / f"{case.number}_{tag(options)}.toml"
    file.write_text(toml(scenario))
    verdict = compare(case, options, [program, "simulate", file, "--json"])
    if verdict.kind == "SILENT":
        told = (
            f"# {options}: off by {verdict.error:.1e}; the start's error grows {case.end.growth:.0e} times\n"
        )
        (folder / "silent" / file.name).write_text(told + toml(scenario))
    file.unlink()
    return verdict


def compare(case: Case, options: str, command: list) -> Verdict:
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return Verdict(case, options, "refused", math.inf, f"no end within {PATIENCE:g} s")
    words = run.stderr.strip()
    if run.returncode == 1 and words:
        return Verdict(case, options, "refused", math.inf, words)
    if run.returncode == 2:
        sys.exit(f"chain {case.number} is no scenario: {words}")
    if run.returncode != 0:  # a crash
        return Verdict(case, options, "SILENT", math.inf, f"exit status {run.returncode} {words}")
    summary = json.loads(run.stdout)
    error = case.end.distance(
        *map(finite, (summary["final"]["bobs"], summary["final"]["velocities"])), case.chain
    )
    warned = bool(summary.get("warnings"))
    if error <= RIGHT:
        return Verdict(case, options, "false alarm" if warned else "right", error, words)
    return Verdict(case, options, "warned" if warned else "SILENT", error, words)


def finite(points: list[list[float | None]]) -> list[list[float]]:
    """What JSON has no number for is none."""
    return [[math.nan if component is None else component for component in point] for point in points]


def toml(tables: dict) -> str:
    """Scenarios hold numbers, words, arrays, and tables of one level; drives and events stand in their lines."""

    def value(v: object) -> str:
        if isinstance(v, dict):
            return "{" + ", ".join(f"{key} = {value(item)}" for key, item in v.items()) + "}"
        return "[" + ", ".join(map(value, v)) + "]" if isinstance(v, list) else json.dumps(v)

    lists = "".join(f"{name} = {value(v)}\n" for name, v in tables.items() if isinstance(v, list))
    return lists + "\n".join(
        f"[{name}]\n" + "".join(f"{key} = {value(item)}\n" for key, item in table.items())
        for name, table in tables.items()
        if not isinstance(table, list)
    )


# --- telling


def table(verdicts: list[Verdict]) -> Iterable[str]:
    yield f"{'':18}" + "".join(f"{kind:>14}" for kind in CLASSES)
    for options in OPTIONS:
        counts = Counter(v.kind for v in verdicts if v.options == options)
        total = max(sum(counts.values()), 1)
        shares = (f"{counts[kind]:6d} {100 * counts[kind] / total:5.1f} %" for kind in CLASSES)
        yield f"{options:18}" + "".join(f"{share:>14}" for share in shares)


def by_kind(verdicts: list[Verdict]) -> Iterable[str]:
    """Which kinds of chains are not right, for each set of options."""
    kinds = sorted({kind for v in verdicts for kind in v.case.kinds})
    yield f"{'silent / other not right / all':36}" + "".join(f"{options:>20}" for options in OPTIONS)
    for kind in kinds:
        cells = []
        for options in OPTIONS:
            those = [v for v in verdicts if v.options == options and kind in v.case.kinds]
            silent = sum(v.kind == "SILENT" for v in those)
            other = sum(v.kind not in ("SILENT", "right") for v in those)
            cells.append(f"{silent} / {other} / {len(those)}")
        yield f"{kind:36}" + "".join(f"{cell:>20}" for cell in cells)


def run(given: argparse.Namespace) -> list[Verdict]:
    (given.folder / "silent").mkdir(parents=True, exist_ok=True)
    references = References(given.reference, given.folder / "references.jsonl")
    cases = [draw(given.seed, number) for number in range(given.count)]
    with ThreadPoolExecutor(given.processes) as pool:
        list(pool.map(lambda case: references.settle(case, given.growth), cases))
        decided = [case for case in cases if case.end]
        print(f"{given.count} chains, of which {len(cases) - len(decided)} have no converged reference")
        pairs = [(case, options) for case in decided for options in OPTIONS]
        return list(pool.map(lambda pair: judge(*pair, given.program, given.folder), pairs))


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--count", type=int, default=300)
    words.add_argument("--program", type=Path, default=Path("build/release/bin/pendula"))
    words.add_argument("--reference", type=Path, default=Path("build/release/bin/chain_reference"))
    words.add_argument("--folder", type=Path, default=Path("build/random_chains"))
    words.add_argument("--growth", type=float, default=1e6)
    words.add_argument("--processes", type=int, default=2)
    words.add_argument("--verdicts", type=Path, help="a line of JSON for each run")
    given = words.parse_args()
    for file in (given.program, given.reference):
        if not os.access(file, os.X_OK):
            words.error(f"{file} is no program; build the targets pendula_cli and chain_reference")
    os.nice(10)
    verdicts = run(given)
    if given.verdicts:
        given.verdicts.write_text("".join(json.dumps(plain(v)) + "\n" for v in verdicts))
    print("\n".join([*table(verdicts), "", *by_kind(verdicts)]))
    silent = [v for v in verdicts if v.kind == "SILENT"]
    for v in silent:
        file = given.folder / "silent" / f"{v.case.number}_{tag(v.options)}.toml"
        print(
            f"{file}  off by {v.error:.1e}, growth {v.case.end.growth:.0e}: {', '.join(sorted(v.case.kinds))}"
        )
    sys.exit(1 if silent else 0)


def plain(v: Verdict) -> dict:
    kept = {"number": v.case.number, "options": v.options, "kind": v.kind, "error": v.error, "words": v.words}
    return {**kept, "growth": v.case.end.growth, "kinds": sorted(v.case.kinds), "scenario": v.case.scenario}


if __name__ == "__main__":
    main()
