"""Where the chain of a scenario is, by chain_reference: converged, or it says that it is not.

usage: python tests/campaign/reference.py SCENARIO.toml... --reference build/release/bin/chain_reference

Prints one JSON object, for each scenario by its name: bobs, velocities, `uncertainty` (how far two tolerances
disagree), `growth` (how much larger a disturbance of the start is at the end).
"""

import argparse
import json
import math
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

DISTURBANCE = 1e-10  # of the start, which the end then answers by `growth` times as much
LIMIT = 4e6  # evaluations, a few seconds
EXPLICIT = ("extrapolation", 1e-14, 1e-17)  # method, two tolerances
IMPLICIT = ("implicit", 1e-10, 1e-12)
STIFF = 3e5  # so many damping times in a run are for the implicit method


@dataclass(frozen=True)
class Chain:
    """What a scenario says of its chain and start, every default filled in, SI."""

    spatial: bool
    gravity: float
    masses: list[float]
    lengths: list[float]
    damping: list[float]
    torque: list[list[float]]
    drives: list[tuple[int, list[float], float, float]]
    start: list[list[float]]  # θ, φ, θ̇, φ̇ of each link

    @property
    def length(self) -> float:
        return sum(self.lengths)

    @property
    def slow(self) -> float:
        """A speed that counts as none: of a thousandth of a fall, m/s."""
        return max(1e-3 * math.sqrt(abs(self.gravity) * self.length), 1e-12)


@dataclass(frozen=True)
class Moment:
    """The chain at one time. Errors are relative: of bobs to the length, of velocities to the largest."""

    speed: float
    bobs: list[list[float]]
    velocities: list[list[float]]
    uncertainty: float = math.inf
    growth: float = math.inf

    def distance(self, bobs: list[list[float]], velocities: list[list[float]], chain: Chain) -> float:
        """How far another answer is from this one; infinite where it holds what is no number."""
        away = max(math.dist(a, b) for a, b in zip(self.bobs, bobs, strict=True)) / chain.length
        slower = max(math.dist(a, b) for a, b in zip(self.velocities, velocities, strict=True))
        both = away + slower / max(self.speed, chain.slow)
        return both if math.isfinite(both) else math.inf


def read(scenario: dict) -> Chain:
    """A scenario as docs/reference/scenario.md describes it."""
    chain, start = scenario["chain"], scenario["start"]
    spatial = chain["space"] == "spatial"
    arrays = [*chain.values(), *start.values()]
    links = chain.get("links") or max(
        len(v) for v in arrays if isinstance(v, list) and not (v and isinstance(v[0], dict))
    )

    def each(section: dict, key: str, default: float = 0.0) -> list[float]:
        value = section.get(key, default)
        return [float(v) for v in value] if isinstance(value, list) else [float(value)] * links

    def vector(value: float | list[float]) -> list[float]:
        if isinstance(value, list):
            return [float(v) for v in value]
        return [0.0, 0.0, 0.0 if spatial else float(value)]

    torque = chain.get("torque", 0.0)
    one_for_all = not isinstance(torque, list) or (spatial and not isinstance(torque[0], list))
    read = Chain(
        spatial,
        float(chain.get("gravity", 9.81)),
        each(chain, "masses"),
        each(chain, "lengths"),
        each(chain, "damping"),
        [vector(torque)] * links if one_for_all else [vector(t) for t in torque],
        [
            (d["link"] - 1, vector(d["amplitude"]), float(d["frequency"]), float(d.get("phase", 0.0)))
            for d in chain.get("drive", [])
        ],
        [
            list(row)
            for row in zip(
                *(each(start, key) for key in ("theta", "phi", "theta_dot", "phi_dot")), strict=True
            )
        ],
    )
    return in_natural_units(read) if chain.get("units") == "natural" else read


def in_natural_units(chain: Chain) -> Chain:
    """Masses, lengths, damping and torque over M_1, l_1 and sqrt(l_1/g); the rest is in these already."""
    mass, length = sum(chain.masses), chain.lengths[0]
    energy, time = mass * chain.gravity * length, math.sqrt(length / chain.gravity)
    return Chain(
        chain.spatial,
        1.0,
        [m / mass for m in chain.masses],
        [r / length for r in chain.lengths],
        [d / (energy * time) for d in chain.damping],
        [[t / energy for t in vector] for vector in chain.torque],
        chain.drives,
        chain.start,
    )


def numbers(chain: Chain, times: list[float]) -> str:
    """What chain_reference reads."""
    words: list[float] = [3 if chain.spatial else 2, len(chain.masses), chain.gravity]
    for m, r, d, t in zip(chain.masses, chain.lengths, chain.damping, chain.torque, strict=True):
        words += [m, r, d, *t]
    words.append(len(chain.drives))
    for link, amplitude, frequency, phase in chain.drives:
        words += [link, *amplitude, frequency, phase]
    for row in chain.start:
        words += row
    words += [len(times), *times]
    return " ".join(float(w).hex() for w in words)


@dataclass(frozen=True)
class Reference:
    """The compiled reference."""

    program: Path

    def run(
        self, chain: Chain, times: list[float], method: str, tolerance: float, disturbance: float = 0.0
    ) -> list[Moment]:
        """The chain at those times, as far as the limit of evaluations let it come."""
        words = [method, str(tolerance), str(LIMIT), str(disturbance)]
        done = subprocess.run(
            [self.program, *words], input=numbers(chain, times), capture_output=True, text=True, check=False
        )
        if done.returncode not in (0, 3):
            sys.exit(f"{self.program} ended with {done.returncode}: {done.stderr}")
        return [self._moment(chain, [float(w) for w in line.split()]) for line in done.stdout.splitlines()]

    def _moment(self, chain: Chain, values: list[float]) -> Moment:
        shown = 3 if chain.spatial else 2
        points = [values[k : k + shown] for k in range(1, len(values), 3)]
        links = len(chain.masses)
        return Moment(values[0], points[:links], points[links:])

    def find(self, chain: Chain, times: list[float]) -> list[Moment]:
        """The converged chain at those times; fewer of them where no method comes farther."""
        above = [math.inf, *chain.masses]
        rates = [
            d / r**2 * (1 / m + 1 / before)
            for d, r, m, before in zip(chain.damping, chain.lengths, chain.masses, above, strict=False)
        ]
        if max(rates) * times[-1] > STIFF:
            return self._converged(chain, times, *IMPLICIT)
        return self._converged(chain, times, *EXPLICIT)

    def _converged(
        self, chain: Chain, times: list[float], method: str, coarse: float, fine: float
    ) -> list[Moment]:
        rough = self.run(chain, times, method, coarse)
        exact = self.run(chain, times, method, fine)
        moved = self.run(chain, times, method, coarse, DISTURBANCE)
        return [
            Moment(
                e.speed,
                e.bobs,
                e.velocities,
                e.distance(r.bobs, r.velocities, chain),
                max(r.distance(m.bobs, m.velocities, chain) / DISTURBANCE, 1.0),
            )
            for e, r, m in zip(exact, rough, moved, strict=False)
        ]


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("scenarios", type=Path, nargs="+")
    words.add_argument("--reference", type=Path, default=Path("build/release/bin/chain_reference"))
    given = words.parse_args()
    ends = {}
    for file in given.scenarios:
        scenario = tomllib.loads(file.read_text())
        duration = float(scenario.get("run", {}).get("duration", 10.0))
        moments = Reference(given.reference).find(read(scenario), [duration])
        if moments:
            ends[file.stem] = vars(moments[0])
        else:
            print(f"{file}: no reference within {LIMIT:g} evaluations", file=sys.stderr)
    print(json.dumps(ends, indent=1))


if __name__ == "__main__":
    main()
