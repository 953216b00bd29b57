"""A run as its file has it: columns by name, as in the CSV file, whichever file it is."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from .errors import PlotError, require_end_of_reading, told_of

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")  # of a column
FIRST_UNITS = {"t": "s", "energy": "J"}
STEPS_A_ROW = 10  # what output.every is where the step is constant and a scenario does not say; else 1


@dataclass(frozen=True)
class Coordinate:
    """One coordinate: the columns of its value and its rate."""

    name: str
    rate: str


@dataclass(frozen=True)
class Point:
    """One point: the columns of its components, two or three."""

    name: str
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Connection:
    """A "rod", "spring" or "thread" between two points, by number; -1 is the origin."""

    kind: str
    start: int
    end: int


@dataclass
class Run:
    """Rows of one run. `kinds` say what points are drawn as, "bob", "cart", "pivot", "weight" or "floor"; none where no
    file says so."""

    name: str
    columns: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    scenario: str = ""
    settings: list[str] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    loaded: bool = False  # whether loads act, which change the energy; False where no file says so

    @property
    def time(self) -> np.ndarray:
        return self.columns["t"]

    def unit(self, column: str) -> str:
        """Of a column; of a CSV file, which names none, what SI has for it. Empty where that is unknown."""
        if column in self.units:
            return self.units[column]
        return FIRST_UNITS.get(column) or self.guessed_units.get(column, "")

    @cached_property
    def coordinates(self) -> list[Coordinate]:
        """`theta_1` with `theta_dot_1`, `x` with `x_dot`; in files of old models `theta_1` with `theta_1_dot`."""
        found = []
        for name in self.columns:
            base, _, link = name.rpartition("_")
            rates = [f"{base}_dot_{link}"] if link.isdigit() else []
            for rate in [*rates, f"{name}_dot"]:
                if rate in self.columns and not (rate.startswith(base) and base.endswith("_dot")):
                    found.append(Coordinate(name, rate))
                    break
        return found

    @cached_property
    def points(self) -> list[Point]:
        """Of a chain `x_1`, `y_1`, …; of a model `bob_x`, `bob_y`, …"""
        found = []
        for name in self.columns:
            if match := re.fullmatch(r"x_(\d+)", name):
                link = match[1]
                columns = [f"{axis}_{link}" for axis in "xyz"]
            elif name.endswith("_x") and not name.startswith("force_"):
                columns = [f"{name[:-1]}{axis}" for axis in "xyz"]
            else:
                continue
            there = tuple(column for column in columns if column in self.columns)
            if len(there) >= 2:
                found.append(Point(f"bob {link}" if match else name[:-2], there))
        return found

    @property
    def is_chain(self) -> bool:
        return "x_1" in self.columns

    @property
    def dimension(self) -> int:
        """Of the space that the points are in; 0 without points."""
        return max((len(point.columns) for point in self.points), default=0)

    @cached_property
    def guessed_units(self) -> dict[str, str]:
        if not self.is_chain:
            return {}
        units = {}
        for coordinate in self.coordinates:
            units[coordinate.name], units[coordinate.rate] = "rad", "rad/s"
        for point in self.points:
            units.update(dict.fromkeys(point.columns, "m"))
        return units

    def positions(self) -> np.ndarray:
        """All points at all times, (rows, points, dimension); planar ones among spatial ones at z = 0."""
        places = np.zeros((len(self.time), len(self.points), self.dimension))
        for k, point in enumerate(self.points):
            for axis, column in enumerate(point.columns):
                places[:, k, axis] = self.columns[column]
        return places

    @cached_property
    def document(self) -> dict:
        """The scenario, parsed."""
        return tomllib.loads(self.scenario)

    @cached_property
    def steps_a_row(self) -> int | None:
        """Accepted steps from row to row, 0 where rows are at times; None where no scenario tells."""
        if not self.scenario:
            return None
        keys = keys_of(self.document, self.settings)
        if {"output.interval", "output.times"} & keys.keys():
            return 0
        is_constant = "run.step" in keys or str(keys.get("run.method")).strip("\"'") == "rk4"
        return int(keys.get("output.every", STEPS_A_ROW if is_constant else 1))

    @cached_property
    def masses(self) -> np.ndarray | None:
        """Of a chain's bobs, as far as its scenario tells them."""
        masses = self.document.get("chain", {}).get("masses")
        if masses is None or not self.is_chain:
            return None
        masses = np.ravel(np.asarray(masses, dtype=float))
        return np.full(len(self.points), masses[0]) if len(masses) == 1 else masses

    def between(self, start: float, end: float) -> Run:
        """The rows from one time to another."""
        wanted = (self.time >= start) & (self.time <= end)
        if not wanted.any():
            got = f"rows from t = {self.time[0]:g} to {self.time[-1]:g}"
            raise PlotError(f"{self.name}: expected rows between --from and --to, got {got}")
        return self.only(wanted)

    def only(self, wanted: np.ndarray) -> Run:
        """Some of the rows, by a mask."""
        return replace(self, columns={name: values[wanted] for name, values in self.columns.items()})


def keys_of(document: dict, settings: list[str]) -> dict[str, object]:
    """What [run] and [output] say, by `run.step`, …: of a scenario, and in its place what `--set` said, as text."""
    told = {
        f"{table}.{key}": value
        for table in ("run", "output")
        for key, value in document.get(table, {}).items()
    }
    changes = (setting.partition("=") for setting in settings)
    return told | {key.strip(): value.strip() for key, _, value in changes}


def read_run(path: Path) -> Run:
    """Reads a trajectory, CSV or HDF5, also one that is still growing. Raises PlotError."""
    with told_of(path, "a trajectory"):
        with path.open("rb") as stream:
            is_hdf5 = stream.read(8) == b"\x89HDF\r\n\x1a\n"
        run = read_hdf5(path) if is_hdf5 else read_csv(path)
        if len(run.time) == 0:
            raise PlotError(f"{path}: expected rows, got none")
        _ = run.steps_a_row, run.masses  # what the scenario of a damaged file tells is wrong here, not later
        return run


def read_hdf5(path: Path) -> Run:
    import h5py

    require_end_of_reading(path)
    columns, units = {}, {}
    with h5py.File(path, "r") as file:
        if "t" not in file or "run" not in file:
            raise PlotError(f"{path}: expected a trajectory, got an HDF5 file without t and run")
        # Arrays without an end have rows; others are numbers of the whole run.
        arrays = {name: data for name, data in file.items() if isinstance(data, h5py.Dataset)}
        arrays = {name: data for name, data in arrays.items() if data.maxshape[:1] == (None,)}
        rows = min(data.shape[0] for data in arrays.values())
        for name, array in arrays.items():
            data, unit = array[:rows], unit_of(array.attrs)
            links = [""] if data.ndim == 1 else [f"_{k + 1}" for k in range(data.shape[1])]
            for k, link in enumerate(links):
                columns[name + link] = data if data.ndim == 1 else data[:, k]
                units[name + link] = unit
        scenario, settings = (file["run"][name].asstr()[()] for name in ("scenario", "set"))
        drawing = json.loads(file["run/drawing"].asstr()[()]) if "drawing" in file["run"] else {}
    run = Run(str(path), columns, units, scenario, json.loads(settings))
    run.loaded = bool(drawing.get("loaded", False))
    run.kinds = [str(kind) for kind in drawing.get("kinds", [])]
    run.connections = [
        Connection(str(kind), int(start), int(end)) for kind, start, end in drawing.get("connections", [])
    ]
    points = range(-1, len(run.points))
    ends = {end for each in run.connections for end in (each.start, each.end)}
    if len(run.kinds) not in (0, len(run.points)) or not ends <= set(points):
        raise PlotError(f"{path}: expected run/drawing of {len(run.points)} points, got that of others")
    return run


def unit_of(attributes: Mapping[str, object]) -> str:
    """Of an array; that of a scenario in natural units stands beside what CF allows for one. Empty for none."""
    return str(attributes.get("natural_unit", attributes.get("units", "")))


def read_csv(path: Path) -> Run:
    header, rows = read_lines(path)
    if header[:1] != ["t"] or not all(map(NAME.fullmatch, header)):
        text = ",".join(header)
        got = "an empty file" if not text else text if len(text) <= 60 else text[:60] + "…"
        raise PlotError(f"{path}: expected a trajectory with columns t, …, got {got}")
    return Run(str(path), numbers(path, header, rows))


def read_lines(path: Path) -> tuple[list[str], list[str]]:
    """Names of the columns, and lines of rows, of a CSV file; the first are none where the file is empty."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise PlotError(f"{path}: expected a trajectory, CSV or HDF5, got a file that is no text") from None
    # A run that is still going may just be writing the last line.
    lines = text[: text.rfind("\n") + 1].splitlines()
    return (lines[0].split(",") if lines else []), lines[1:]


def numbers(path: Path, header: list[str], lines: list[str]) -> dict[str, np.ndarray]:
    """Columns by name, of lines that follow the header at once."""
    try:
        rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
        return dict(zip(header, rows.reshape(-1, len(header)).T, strict=True))
    except ValueError:
        number = next(k for k, line in enumerate(lines, start=2) if not is_row(line, len(header)))
        raise PlotError(f"{path}:{number}: expected a number in each of the {len(header)} columns") from None


def is_row(line: str, columns: int) -> bool:
    try:
        numbers = [float(cell) for cell in line.split(",")]
    except ValueError:
        return False
    return len(numbers) == columns and all(map(math.isfinite, numbers))
