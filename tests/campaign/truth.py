"""What a case's motion is, by references that pendula has no part in, and how far they can be trusted.

Motions come from chain_reference and model_reference as rows of 80-bit numbers, are turned into the columns that a
trajectory has, and are kept on disk by what they depend on.
"""

import hashlib
import os
import re
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import aimed
import model_equations
import numpy as np
import reference

Real = np.longdouble
NODES = 20
LIMIT = 6e6
DISTURBANCE = 1e-10


class NoReferenceError(Exception):
    """The reference is not converged, or takes too long."""


@dataclass
class Room:
    """Where things are."""

    chain_reference: Path
    model_reference: Path
    linkage_reference: Path
    kept: Path

    def rows(self, command: list, numbers: str, width: int) -> np.ndarray:
        """What a reference tells; kept. Fewer rows than were asked for where it came no farther."""
        key = hashlib.sha256(repr(([str(c) for c in command[1:]], numbers)).encode()).hexdigest()[:32]
        file = self.kept / key[:2] / f"{key}.npy"
        if not file.exists():
            done = subprocess.run(
                list(map(str, command)), input=numbers.encode(), capture_output=True, check=False
            )
            if done.returncode not in (0, 3):
                raise RuntimeError(f"{command} ended with {done.returncode}: {done.stderr.decode()}")
            found = np.frombuffer(done.stdout, dtype=Real)
            found = found[: len(found) // width * width].reshape(-1, width)
            file.parent.mkdir(parents=True, exist_ok=True)
            own = file.with_suffix(f".{os.getpid()}.npy")
            np.save(own, found)
            own.rename(file)
        return np.load(file)


@dataclass
class Subject:
    """What is moved: `ask(method, tolerance, disturbance, telling, times)` are rows; the last of `width` is not always
    the time, so `time` is where it stands."""

    room: Room
    width: int
    time: int
    methods: list[
        tuple[str, float, float]
    ]  # method, coarse and fine tolerance; the first one that comes to the end

    def ask(
        self, method: str, tolerance: float, disturbance: float, telling: str, times: list[float]
    ) -> np.ndarray:
        raise NotImplementedError

    def columns(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """As a trajectory has them."""
        raise NotImplementedError

    def compared(self, columns: dict[str, np.ndarray], sizes: np.ndarray | None) -> np.ndarray:
        """Numbers to compare, a row a time, each in units of its size; in their own where there are no sizes."""
        raise NotImplementedError

    def derived(self, columns: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        """What of a trajectory follows from coordinates and rates, and the size of each of these columns."""
        raise NotImplementedError

    def sizes(self, columns: dict[str, np.ndarray]) -> np.ndarray:
        """Of the numbers to compare, from a motion that is dense enough."""
        raise NotImplementedError


class ChainSubject(Subject):
    def __init__(self, room: Room, scenario: dict) -> None:
        self.chain = reference.read(scenario)
        self.links = len(self.chain.masses)
        above = [np.inf, *self.chain.masses]
        rates = [
            d / r**2 * (1 / m + 1 / before)
            for d, r, m, before in zip(
                self.chain.damping, self.chain.lengths, self.chain.masses, above, strict=False
            )
        ]
        duration = float(scenario["run"]["duration"])
        implicit = max(rates) * duration > reference.STIFF
        methods = [reference.IMPLICIT if implicit else reference.EXPLICIT]
        super().__init__(room, 7 * self.links + 1, 6 * self.links, methods)

    def ask(self, method, tolerance, disturbance, telling, times):
        command = [self.room.chain_reference, method, tolerance, LIMIT, disturbance, telling]
        return self.room.rows(command, reference.numbers(self.chain, times), self.width)

    def columns(self, rows):
        n = self.links
        lengths = np.array(self.chain.lengths, dtype=Real)
        u, rate = (rows[:, 3 * n * k : 3 * n * (k + 1)].reshape(-1, n, 3) for k in (0, 1))
        bobs, velocities = (np.cumsum(lengths[:, None] * part, axis=1) for part in (u, rate))
        columns = {"t": rows[:, self.time]}
        for i in range(n):
            if self.chain.spatial:
                across = np.hypot(u[:, i, 0], u[:, i, 1])
                with np.errstate(all="ignore"):
                    columns[f"theta_dot_{i + 1}"] = rate[:, i, 2] / across
                columns[f"theta_{i + 1}"] = np.arctan2(across, -u[:, i, 2])
                columns[f"phi_{i + 1}"] = np.arctan2(u[:, i, 1], u[:, i, 0])
            else:
                columns[f"theta_{i + 1}"] = Real(self.chain.start[i][0]) + rows[:, self.time + 1 + i]
                columns[f"theta_dot_{i + 1}"] = u[:, i, 0] * rate[:, i, 1] - u[:, i, 1] * rate[:, i, 0]
            for k, axis in enumerate("xyz" if self.chain.spatial else "xy"):
                columns[f"{axis}_{i + 1}"] = bobs[:, i, k]
                columns[f"v{axis}_{i + 1}"] = velocities[:, i, k]
        return columns

    def compared(self, columns, sizes=None):
        n, axes = self.links, "xyz" if self.chain.spatial else "xy"
        if "vx_1" not in columns:
            columns = columns | self._velocities(columns)
        numbers = [columns[f"{axis}_{i + 1}"] for i in range(n) for axis in axes]
        numbers += [columns[f"v{axis}_{i + 1}"] for i in range(n) for axis in axes]
        if not self.chain.spatial:
            numbers += [columns[f"theta_{i + 1}"] for i in range(n)]
        numbers = np.array(numbers).T
        return numbers if sizes is None else numbers / sizes

    def _velocities(self, columns):
        """Of bobs, from angles and their rates; and no other place than the bobs'."""
        lengths, velocities = self.chain.lengths, {}
        sum_x = sum_y = sum_z = Real(0)
        for i in range(self.links):
            theta, rate = (columns[f"{name}_{i + 1}"].astype(Real) for name in ("theta", "theta_dot"))
            s, c = np.sin(theta), np.cos(theta)
            if self.chain.spatial:
                phi, turning = (columns[f"{name}_{i + 1}"].astype(Real) for name in ("phi", "phi_dot"))
                sp, cp = np.sin(phi), np.cos(phi)
                sum_x = sum_x + lengths[i] * (c * cp * rate - s * sp * turning)
                sum_y = sum_y + lengths[i] * (c * sp * rate + s * cp * turning)
                sum_z = sum_z + lengths[i] * s * rate
                velocities[f"vz_{i + 1}"] = sum_z
            else:
                sum_x, sum_y = sum_x + lengths[i] * c * rate, sum_y + lengths[i] * s * rate
            velocities |= {f"vx_{i + 1}": sum_x, f"vy_{i + 1}": sum_y}
        return velocities

    def derived(self, columns):
        chain, axes = self.chain, "xyz" if self.chain.spatial else "xy"
        places, x, y, z = {}, Real(0), Real(0), Real(0)
        for i, length in enumerate(chain.lengths):
            theta = columns[f"theta_{i + 1}"]
            phi = columns[f"phi_{i + 1}"] if chain.spatial else 0 * theta
            x, y = x + length * np.sin(theta) * np.cos(phi), y + length * np.sin(theta) * np.sin(phi)
            z = z - length * np.cos(theta)
            at = (x, y, z) if chain.spatial else (x, z)
            places |= {f"{axis}_{i + 1}": part for axis, part in zip(axes, at, strict=True)}
        rates, up = self._velocities(columns), axes[-1]
        kinetic = sum(
            m * rates[f"v{axis}_{i + 1}"] ** 2 / 2 for i, m in enumerate(chain.masses) for axis in axes
        )
        potential = sum(m * chain.gravity * places[f"{up}_{i + 1}"] for i, m in enumerate(chain.masses))
        heights = [m * chain.gravity * sum(chain.lengths[: i + 1]) for i, m in enumerate(chain.masses)]
        size = dict.fromkeys(places, chain.length)
        size["energy"] = float(np.max(kinetic)) + abs(sum(heights))
        return {**places, "energy": kinetic + potential}, size

    def sizes(self, columns):
        axes = "xyz" if self.chain.spatial else "xy"
        n = self.links
        speeds = [np.sqrt(sum(columns[f"v{axis}_{i + 1}"] ** 2 for axis in axes)).max() for i in range(n)]
        natural = np.sqrt(abs(self.chain.gravity) * self.chain.length)
        speed = max(*speeds, natural, 1e-300)
        angles = [] if self.chain.spatial else [1.0] * n
        return np.array([self.chain.length] * len(axes) * n + [speed] * len(axes) * n + angles, dtype=Real)


class ModelSubject(Subject):
    def __init__(self, room: Room, scenario: dict, text: str, narrow: list[tuple[str, float]]) -> None:
        system, start = scenario["system"], scenario["start"]
        self.model = model_equations.Model(text, tuple(g for g, _ in narrow), int(system.get("links", 1)))
        said = self.model.said
        given = system.get("parameters", {})
        values = said.defaults | {k: v for k, v in given.items() if not isinstance(v, list)}
        for name, each in given.items():
            if isinstance(each, list):
                values |= {f"{name}_{i + 1}": v for i, v in enumerate(each)}
            elif name not in said.defaults:
                values |= {f"{name}_{i + 1}": each for i in range(said.links)}
        self.parameters = [float(values[str(p)]) for p in said.parameters]
        drives = system.get("drive", [])
        numbers = [len(self.model.q), len(self.parameters), *self.parameters, len(said.inputs)]
        for name in map(str, said.inputs):
            mine = [d for d in drives if d["input"] == name]
            sines = [d for d in mine if d.get("amplitude")]
            numbers += [sum(d.get("constant", 0.0) for d in mine), len(sines)]
            for d in sines:
                numbers += [d["amplitude"], d.get("frequency", 0.0), d.get("phase", 0.0)]
        numbers += [len(narrow), *(width for _, width in narrow)]
        numbers += [start.get(name, 0.0) for name in self.model.names]
        self.numbers = " ".join(float(x).hex() for x in numbers)
        n = len(self.model.q)
        methods = [("extrapolation", 1e-14, 1e-17), ("implicit", 1e-10, 1e-12)]
        super().__init__(room, 2 * n + 1, 2 * n, methods)

    def ask(self, method, tolerance, disturbance, telling, times):
        library = self.model.library(self.room.kept)
        command = [self.room.model_reference, library, method, tolerance, LIMIT, disturbance, telling]
        numbers = f"{self.numbers} {len(times)} " + " ".join(float(t).hex() for t in times)
        return self.room.rows(command, numbers, self.width)

    def columns(self, rows):
        return self.model.columns(rows, self.parameters)

    def compared(self, columns, sizes=None):
        columns = self.named(columns)
        numbers = np.array([columns[name] for name in self.model.names]).T
        return numbers if sizes is None else numbers / sizes

    def named(self, columns):
        """theta_dot_1 as theta_1_dot, which the model's own names are."""
        return columns | {n: columns[other_spelling(n)] for n in self.model.names if n not in columns}

    def derived(self, columns):
        columns = self.named(columns)
        rows = np.array([columns[name] for name in (*self.model.names, "t")]).T
        own = self.model.columns(rows, self.parameters)
        own = {
            name: column for name, column in own.items() if name not in (*self.model.names, "t", "kinetic")
        }
        n = len(self.model.q)  # what all but rests has no energy that its own could be compared with
        speeds = np.maximum(np.abs(rows[:, n:-1]), self.sizes(columns)[n:])
        rows[:, n:-1] = np.copysign(speeds, rows[:, n:-1])
        kinetic = self.model.columns(rows, self.parameters)["kinetic"]
        size = {name: max(float(np.abs(column).max()), 1e-300) for name, column in own.items()}
        size["energy"] += 2 * float(np.abs(kinetic).max())
        return own, size

    def sizes(self, columns):
        units = self.model.said.units
        rates = [f"{unit}/s" for unit in units]
        largest: dict[str, float] = {unit: 1.0 for unit in units if unit == "rad"}
        for name, unit in zip(self.model.names, units + rates, strict=True):
            largest[unit] = max(largest.get(unit, 1e-300), np.abs(columns[name]).max())
        # As docs/reference/scenario.md says of run.accuracy.
        for unit, rate in zip(units, rates, strict=True):
            largest[rate] = max(largest[rate], 0.01 * largest[unit] / max(columns["t"].max(), 1e-300))
        return np.array([largest[unit] for unit in units + rates], dtype=Real)


class PieceSubject(ModelSubject):
    """A model with pieces whose motion is known in closed form."""

    def __init__(self, room: Room, scenario: dict, text: str, family: str) -> None:
        super().__init__(room, scenario, text, [])
        self.family = family
        self.start = [Real(scenario["start"].get(name, 0.0)) for name in self.model.names]
        self.methods = [("closed form", 0.0, 0.0)]

    def ask(self, method, tolerance, disturbance, telling, times):
        del method, tolerance, telling
        x, v = (number * (1 + Real(disturbance)) for number in self.start)
        given = dict(zip(map(str, self.model.said.parameters), self.parameters, strict=True))
        return aimed.rows(self.family, (x, v), given, times)


def other_spelling(name: str) -> str:
    """theta_dot_1 for theta_1_dot, and back; x_dot as it is."""
    if found := re.fullmatch(r"(.*)_(\d+)_dot", name):
        return f"{found[1]}_dot_{found[2]}"
    return re.sub(r"_dot_(\d+)$", r"_\1_dot", name)


@dataclass
class Rows:
    """The motion at some times, as far as the reference came: columns; and of each row, relative to sizes, how far
    two tolerances are apart, and by how much a disturbance of the start grew so far."""

    columns: dict[str, np.ndarray]
    numbers: np.ndarray
    sizes: np.ndarray
    uncertainty: np.ndarray
    growth: np.ndarray

    def __len__(self) -> int:
        return len(self.uncertainty)


def rows_at(subject: Subject, times: list[float], duration: float) -> Rows:
    """Raises NoReferenceError where no method comes to the first of the times."""
    between = [duration * k / 60 for k in range(61)]
    everything = sorted({*times, *between})
    best: tuple | None = None
    for method, coarse, fine in subject.methods:
        exact = subject.ask(method, fine, 0.0, "states", everything)
        rough = subject.ask(method, coarse, 0.0, "states", everything)
        moved = subject.ask(method, coarse, DISTURBANCE, "states", everything)
        count = min(len(exact), len(rough), len(moved))
        if best is None or count > best[0]:
            best = (count, exact[:count], rough[:count], moved[:count])
        if count == len(everything):
            break
    count, exact, rough, moved = best
    if count < 2:
        raise NoReferenceError("it takes too long")
    columns = subject.columns(exact)
    sizes = subject.sizes(columns)
    numbers, other, disturbed = (
        subject.compared(c, sizes) for c in (columns, subject.columns(rough), subject.columns(moved))
    )
    uncertainty = largest(numbers - other)
    growth = np.maximum.accumulate(np.maximum(largest(other - disturbed) / DISTURBANCE, 1.0))
    place = {t: k for k, t in enumerate(everything[:count])}
    wanted = [place[t] for t in times if t in place]
    return Rows(
        {name: column[wanted] for name, column in columns.items()},
        numbers[wanted],
        sizes,
        uncertainty[wanted],
        growth[wanted],
    )


def largest(numbers: np.ndarray) -> np.ndarray:
    """Of each row; what is no number is infinite."""
    found = np.abs(numbers).max(axis=1) if numbers.size else np.zeros(len(numbers))
    return np.where(np.isfinite(found), found, np.inf).astype(float)


@dataclass
class Dense:
    """A motion at any time: polynomials through 20 rows of each step of the reference."""

    subject: Subject
    rows: np.ndarray  # (steps, 20, width)

    @cached_property
    def ends(self) -> np.ndarray:
        times = self.rows[:, :, self.subject.time]
        return np.append(times[:, 0], times[-1, -1])

    @cached_property
    def _nodes(self) -> tuple[np.ndarray, np.ndarray]:
        k = np.arange(NODES, dtype=Real)
        places = (1 - np.cos(4 * np.arctan(Real(1)) * k / (NODES - 1))) / 2
        weights = np.where(np.arange(NODES) % 2 == 0, Real(1), Real(-1))
        weights[[0, -1]] /= 2
        return places, weights

    def at(self, times: np.ndarray) -> np.ndarray:
        """Rows at any times of the motion."""
        times = np.asarray(times, dtype=Real)
        step = np.clip(np.searchsorted(self.ends, times, side="right") - 1, 0, len(self.rows) - 1)
        start, whole = self.ends[step], self.ends[step + 1] - self.ends[step]
        places, weights = self._nodes
        away = ((times - start) / whole)[:, None] - places
        exact = np.abs(away).min(axis=1) < 1e-18
        with np.errstate(divide="ignore", invalid="ignore"):
            pull = weights / away
            rows = np.einsum("tk,tkw->tw", pull, self.rows[step]) / pull.sum(axis=1)[:, None]
        rows[exact] = self.rows[step[exact], np.abs(away[exact]).argmin(axis=1)]
        rows[:, self.subject.time] = times
        return rows

    @cached_property
    def unresolved(self) -> float:
        """The size of the last Chebyshev coefficients, relative to sizes."""
        columns = self.subject.columns(self.rows.reshape(-1, self.rows.shape[2]))
        numbers = self.subject.compared(columns, self.subject.sizes(columns))
        numbers = numbers.reshape(*self.rows.shape[:2], -1)
        k = np.arange(NODES)
        half = np.where((k == 0) | (k == NODES - 1), 0.5, 1.0)
        last = [
            np.abs(np.einsum("skn,k->sn", numbers, half * np.cos(np.pi * degree * k / (NODES - 1)))).max()
            for degree in (NODES - 2, NODES - 3)
        ]
        return float(max(last)) * 2 / (NODES - 1)


def dense(subject: Subject, duration: float) -> tuple[Dense, Rows]:
    """A motion at any time, and rows at the ends of its steps, for its uncertainty. Raises NoReferenceError."""
    for method, _, fine in subject.methods:
        rows = subject.ask(method, fine, 0.0, "dense", [duration])
        rows = rows[: len(rows) // NODES * NODES].reshape(-1, NODES, subject.width)
        if len(rows) and rows[-1, -1, subject.time] >= duration * (1 - 1e-15):
            break
    else:
        raise NoReferenceError("it takes too long")
    motion = Dense(subject, rows)
    some = np.unique(np.linspace(0, len(motion.ends) - 1, 400).astype(int))
    return motion, rows_at(subject, [float(t) for t in motion.ends[some]], duration)
