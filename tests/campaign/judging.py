"""Runs the program on a case and says whether what it wrote is right, or said not to be.

right         within what was asked for in every row and event
false doubt   right by far (DOUBTFUL), and a warning says that it cannot be trusted
said          wrong, and a warning says so (all of what is wrong lies behind `trusted_until`, where there is one)
refused       exit status 1 with a message
not taken     exit status 2 with a message: the scenario is not one
slow          it took longer than the time limit
SILENT        wrong without a word
too narrow    that, where something in the model is passed in less than SEEN of a step, which nobody promises to see
crash         another exit status, no message, or a traceback
undecided     the reference is not converged where it matters
"""

import csv
import json
import math
import os
import re
import subprocess
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import aimed
import crossings
import linkages
import numpy as np
import truth
from drawing import Case, Level
from random_chains import toml

ROOM_FOR_ACCURACY = 10  # a warning is due where an accuracy is missed by more
ROOM_FOR_TOLERANCE = {
    "gauss": 100,
    "radau": 1000,
}  # times the growth of a disturbance; explicit ones as radau
ADAPTIVE = ("dopri5", "fehlberg78", "taylor")
NOTHING_ASKED = 1e-3  # of the size; no run that is further off may be silent
SEEN = 1e-3
DOUBTFUL = {
    "accuracy": 0.1,
    "tolerance": 1.0,
    "step": 0.01,
}  # of what was asked for: a doubt of less is false
COLUMNS_AGREE = 1e-11  # energies, of their size, and points with the coordinates beside them
MOST_ROWS = 80
# What does not say how far a run can be trusted.
BESIDE = re.compile(
    r"has no effect|more than two turns|^event |the run cannot go on later|copy \d+ ends"
    r"|follow from the others at the start"
)


@dataclass
class Program:
    file: Path
    folder: Path
    patience: float = 60.0


@dataclass
class Verdict:
    name: str
    family: str
    settings: str
    kind: str
    error: float = 0.0  # the largest, relative to sizes
    expected: float | None = None  # by the run itself
    ratio: float = 0.0  # of an error to what it may be, the largest
    by: str = "step"  # accuracy, tolerance or step
    asked: float = 0.0
    growth: float = 1.0
    seconds: float = 0.0
    narrow: bool = False  # what is narrow is passed in less than a thousandth of a step
    wrong: list[str] = field(default_factory=list)
    words: list[str] = field(default_factory=list)


# --- what was asked for


def asked_of(run: dict, ensemble: bool = False) -> tuple[str, float]:
    """accuracy, tolerance or step, and the number; of a step what nobody asked for."""
    method = run.get("method", "gauss")
    if method == "auto":
        method = "gauss"  # whose tolerance Taylor series keep that take its place
    if method == "rk4" or ("step" in run and method not in ADAPTIVE):
        return "step", NOTHING_ASKED
    if "accuracy" in run:
        return "accuracy", run["accuracy"]
    if "tolerance" in run:
        return "tolerance", run["tolerance"]
    return ("accuracy", 1e-9) if method in ("gauss", "radau") and not ensemble else ("tolerance", 1e-9)


def limits(run: dict, growth: np.ndarray, ensemble: bool = False) -> np.ndarray:
    """How far each row may be off, by the growth of a disturbance until then."""
    kind, asked = asked_of(run, ensemble)
    if kind == "step":
        return np.full(len(growth), asked)
    if kind == "accuracy":
        return np.full(len(growth), min(ROOM_FOR_ACCURACY * asked, NOTHING_ASKED))
    # A run tells what error it expects. Members do not: of those by explicit methods docs/reference/ensembles.md
    # promises this.
    if ensemble and run.get("method") in ADAPTIVE:
        return np.full(len(growth), NOTHING_ASKED)
    method = run.get("method", "auto")
    room = ROOM_FOR_TOLERANCE.get("gauss" if method == "auto" else method, ROOM_FOR_TOLERANCE["radau"])
    return np.minimum(room * asked * growth, NOTHING_ASKED)


def settings_of(run: dict) -> str:
    shown = [run.get("method", "gauss")] + [
        f"{key} {run[key]:.3g}" for key in ("stages", "accuracy", "tolerance", "step") if key in run
    ]
    return ", ".join(shown)


# --- open numbers


def subject_of(case: Case, room: truth.Room, tables: dict | None = None) -> truth.Subject:
    tables = tables or case.tables
    if case.linkage is not None:
        return linkages.LinkageSubject(room, case.linkage)
    if "chain" in tables:
        return truth.ChainSubject(room, tables)
    if case.family in aimed.MOTIONS:
        return truth.PieceSubject(room, tables, case.model, case.family)
    return truth.ModelSubject(room, tables, case.model, case.narrow)


def closed(case: Case, motion: truth.Dense) -> dict:
    """The scenario, with every level of its events filled in."""
    return {
        **case.tables,
        "event": [
            {**event, "when": filled(event["when"], levels, case, motion)}
            for event, levels in zip(case.tables["event"], case.levels, strict=True)
        ],
    }


def filled(text: str, levels: list[Level], case: Case, motion: truth.Dense) -> str:
    numbers = [repr(value_of(level, case, motion)) for level in levels]
    return text.format(*numbers).replace("- -", "+ ")


def value_of(level: Level, case: Case, motion: truth.Dense) -> float:
    run, written = case.tables["run"], case.tables.get("output", {})
    duration = run["duration"]
    expression = crossings.Expression(level.of)

    def g(times):
        return expression(crossings.columns_of(motion, expression, times))

    grid = grid_of(motion, 0.0)
    values = g(grid)
    size = float(values.max() - values.min()) or 1.0
    when, sign = level.which * duration, 1.0
    if level.at == "turn":
        slope = np.diff(values)
        k = 1 + np.flatnonzero(slope[1:] * slope[:-1] < 0)
        if len(k):
            k = k[min(int(level.which * len(k)), len(k) - 1)]
            sign = 1.0 if values[k] > values[k - 1] else -1.0
            best = crossings.turns(g, grid[k - 1 : k + 2], values[k - 1 : k + 2], np.full(3, np.inf))
            when = best[0] if len(best) else grid[k]
    elif level.at == "row" and "times" in written:
        when = written["times"][min(int(level.which * len(written["times"])), len(written["times"]) - 1)]
    elif level.at == "row" and "interval" in written:
        when = written["interval"] * int(level.which * duration / written["interval"])
    elif level.at in ("start", "end"):
        when = 0.0 if level.at == "start" else duration
    return float(g(np.array([when], dtype=truth.Real))[0]) + sign * level.off * size


def grid_of(motion: truth.Dense, fastest: float) -> np.ndarray:
    """Times at which to look first: 24 a step, and 24 a turn of what turns by itself."""
    parts = np.linspace(0, 1, 24, endpoint=False, dtype=truth.Real)
    grid = (motion.ends[:-1, None] + np.diff(motion.ends)[:, None] * parts).ravel()
    count = int(24 * fastest * float(motion.ends[-1]) / (2 * np.pi))
    more = np.linspace(0, motion.ends[-1], count, dtype=truth.Real) if count else grid[:0]
    return np.unique(np.concatenate([grid, more, motion.ends]))


# --- runs


@dataclass
class Run:
    status: int | None  # None where it was too slow
    summary: dict
    message: str
    columns: dict[str, np.ndarray]
    events: list[tuple[str, float, str]]
    event_columns: dict[str, np.ndarray]
    seconds: float

    @property
    def doubts(self) -> list[str]:
        return [w for w in self.summary.get("warnings", []) if not BESIDE.search(w)]

    @property
    def trusted_until(self) -> float:
        """Infinite where nothing is said against any row; before the start where all of them are doubted."""
        if not self.doubts:
            return math.inf
        until = self.summary.get("trusted_until")
        return -math.inf if until is None else float(until)


def table_of(file: Path) -> tuple[list[list[str]], dict[str, np.ndarray]]:
    """Lines of a CSV file, and its columns of numbers."""
    if not file.exists():
        return [], {}
    with file.open() as opened:
        header, *lines = csv.reader(opened)
    columns = {}
    for k, name in enumerate(header):
        if name not in ("name", "direction"):
            columns[name] = np.array([float(line[k]) for line in lines])
    return lines, columns


def rows_of(file: Path) -> dict[str, np.ndarray]:
    """Those of a run file, named as in a CSV file."""
    import h5py

    columns = {}
    if not file.exists():
        return columns
    with h5py.File(file) as opened:
        for name, data in opened.items():
            if isinstance(data, h5py.Dataset) and name != "link" and data.ndim == 1:
                columns[name] = np.asarray(data)
            elif isinstance(data, h5py.Dataset) and data.ndim == 2:
                columns |= {f"{name}_{i + 1}": np.asarray(data[:, i]) for i in range(data.shape[1])}
    rows = len(columns.get("t", []))
    return {name: column for name, column in columns.items() if len(column) == rows}


def simulate(program: Program, tables: dict, model: str, resumed: float = 0.0) -> Run:
    """resumed: part of the duration after which it ends, and goes on."""
    folder = program.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scenario.toml").write_text(toml(tables))
    if tables.get("system", {}).get("model") == "model.py":  # compiled before time is taken
        (folder / "model.py").write_text(model)
        build = [program.file, "build", "model.py"]
        subprocess.run(build, cwd=folder, capture_output=True, check=False)
    rows, happened = folder / "rows.csv", folder / "events.csv"
    for file in (rows, happened):
        file.unlink(missing_ok=True)
    command = [program.file, "simulate", "scenario.toml", "--json", "-o", "rows.csv"]
    if "event" in tables:
        command += ["--events", "events.csv"]
    if resumed:
        duration = tables["run"]["duration"]
        (folder / "rows.h5").unlink(missing_ok=True)
        begin = [program.file, "simulate", "scenario.toml", "--quiet", "-o", "rows.h5"]
        part = {**tables, "run": {**tables["run"], "duration": resumed * duration}}
        if "times" in tables.get("output", {}):  # those behind the end are no rows of the first part
            del part["output"]
            tables = {name: table for name, table in tables.items() if name != "output"}
        (folder / "scenario.toml").write_text(toml(part))
        try:
            subprocess.run(begin, cwd=folder, capture_output=True, check=False, timeout=program.patience)
        except subprocess.TimeoutExpired:
            return Run(None, {}, "", {}, [], {}, program.patience)
        command = [
            program.file,
            "simulate",
            "--resume",
            "rows.h5",
            "--set",
            f"run.duration={duration!r}",
            "--json",
        ]
    began = time.monotonic()
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=program.patience
        )
    except subprocess.TimeoutExpired:
        return Run(None, {}, "", {}, [], {}, program.patience)
    seconds = time.monotonic() - began
    summary = {}
    if done.stdout.startswith("{"):
        summary = json.loads(done.stdout)
    _, columns = table_of(rows)
    if resumed:
        columns = rows_of(folder / "rows.h5")
    lines, event_columns = table_of(happened)
    events = [(line[0], float(line[1]), line[2]) for line in lines]
    message = (done.stderr.strip().splitlines() or [""])[-1]
    return Run(done.returncode, summary, message, columns, events, event_columns, seconds)


# --- rows


@dataclass
class RowErrors:
    times: np.ndarray
    error: np.ndarray
    limit: np.ndarray
    uncertainty: np.ndarray
    growth: np.ndarray

    @property
    def ratio(self) -> np.ndarray:
        return self.error / self.limit

    @property
    def wrong(self) -> np.ndarray:
        return self.error - self.uncertainty > self.limit

    @property
    def right(self) -> np.ndarray:
        return self.error + self.uncertainty <= self.limit


def some(times: np.ndarray) -> np.ndarray:
    """Which rows to look at: all, or early ones, the last, those of the shortest steps, and others evenly."""
    if len(times) <= MOST_ROWS:
        return np.arange(len(times))
    evenly = np.linspace(0, len(times) - 1, MOST_ROWS - 30).astype(int)
    fast = 1 + np.argsort(np.diff(times), kind="stable")[:20]
    return np.unique(np.concatenate([np.arange(10), fast, evenly]))


def row_errors(
    subject: truth.Subject, columns: dict[str, np.ndarray], run: dict, duration: float, ensemble: bool = False
) -> RowErrors:
    keep = some(columns["t"])
    columns = {name: column[keep] for name, column in columns.items()}
    times = [float(t) for t in columns["t"]]
    rows = truth.rows_at(subject, sorted(set(times)), duration)
    place = {float(t): k for k, t in enumerate(rows.columns["t"].astype(float))}
    known = np.array([t in place for t in times], dtype=bool)
    which = [place[t] for t in times if t in place]
    ours = subject.compared({name: column[known] for name, column in columns.items()}, rows.sizes)
    error = np.full(len(times), np.nan)
    uncertainty, growth = np.full(len(times), np.inf), np.full(len(times), np.inf)
    error[known] = truth.largest(ours - rows.numbers[which])
    uncertainty[known], growth[known] = rows.uncertainty[which], rows.growth[which]
    error = np.where(np.isnan(error), 0.0, error)
    limit = limits(run, np.where(np.isfinite(growth), growth, 1e300), ensemble)
    return RowErrors(np.array(times), error, limit, uncertainty, growth)


def column_faults(subject: truth.Subject, columns: dict[str, np.ndarray]) -> list[tuple[float, str]]:
    """Energies and points that do not belong to the coordinates and rates beside them."""
    if len(columns.get("t", [])) == 0:  # an event may end a run before its first row
        return []
    own, size = subject.derived({name: column.astype(truth.Real) for name, column in columns.items()})
    faults = []
    for name, numbers in own.items():
        off = np.abs(numbers - columns[name])
        if len(off) and off.max() > COLUMNS_AGREE * size[name]:
            k = int(off.argmax())
            faults.append(
                (
                    float(columns["t"][k]),
                    f"column {name} is {columns[name][k]!r}, {float(numbers[k])!r} by its row",
                )
            )
    return faults


def final_columns(summary: dict) -> dict[str, np.ndarray]:
    """The last state as one row of a trajectory."""
    final = summary.get("final") or {}
    columns = {"t": [final.get("t")]}
    if "theta" in final:
        for name in ("theta", "phi", "theta_dot", "phi_dot"):
            for i, value in enumerate(final.get(name, [])):
                columns[f"{name}_{i + 1}"] = [value]
        for i, bob in enumerate(final["bobs"]):
            columns |= {f"{axis}_{i + 1}": [value] for axis, value in zip("xyz", bob, strict=False)}
    else:
        columns |= {name: [value] for name, value in final.get("q", {}).items()}
        rates = final.get("v", {})
        columns |= {
            name if name.endswith("_dot") else f"{name}_dot": [value] for name, value in rates.items()
        }
    return {
        name: np.array([math.nan if v is None else v for v in values]) for name, values in columns.items()
    }


def spelled(name: str, columns: dict) -> str:
    """theta_1_dot is theta_dot_1."""
    other = truth.other_spelling(name)
    return other if name not in columns and other in columns else name


def with_final(columns: dict[str, np.ndarray], summary: dict) -> dict[str, np.ndarray]:
    last = final_columns(summary)
    if last["t"].dtype == object or not np.isfinite(last["t"]).all():
        return columns
    last = {spelled(name, columns): value for name, value in last.items()} if columns else last
    names = [name for name in columns if name in last] if columns else list(last)
    return {name: np.append(columns.get(name, []), last[name]) for name in names}


# --- verdicts


def judge_run(case: Case, room: truth.Room, program: Program) -> Verdict:
    tables = case.tables
    subject = subject_of(case, room)
    duration, run = tables["run"]["duration"], tables["run"]
    motion = ends = None
    if "event" in tables:
        motion, ends = truth.dense(subject, duration)
        if motion.unresolved > 1e-12:
            raise truth.NoReferenceError(f"not resolved, {motion.unresolved:.1e}")
        tables = closed(case, motion)
    else:
        truth.rows_at(subject, [duration], duration)  # before the program is run for nothing
    done = simulate(program, tables, case.model, case.resumed)
    by, asked = asked_of(run)
    verdict = Verdict(
        case.name, case.family, settings_of(run), "right", by=by, asked=asked, seconds=done.seconds
    )
    verdict.words = done.doubts
    if done.status is None:
        verdict.kind = "slow"
        return verdict
    if done.status != 0:
        verdict.words = [done.message]
    if done.status not in (0, 1, 2) or "Traceback" in done.message or (done.status and not done.message):
        verdict.kind, verdict.words = "crash", [f"exit status {done.status}", done.message]
        return verdict
    if done.status:
        verdict.kind = "refused" if done.status == 1 else "not taken"
        return verdict
    columns = with_final(done.columns, done.summary)
    errors = row_errors(subject, columns, run, duration)
    wrong = [
        (float(t), f"row at {float(t)!r}: off by {e:.2e}, {e / m:.1e} times what it may be (growth {g:.1e})")
        for t, e, m, g in zip(
            *(x[errors.wrong] for x in (errors.times, errors.error, errors.limit, errors.growth)), strict=True
        )
    ]
    sure = np.isfinite(errors.uncertainty)
    verdict.error = float(errors.error[sure].max(initial=0))
    verdict.ratio = float(errors.ratio[sure].max(initial=0))
    verdict.growth = float(errors.growth[sure].max(initial=1))
    verdict.expected = done.summary.get("expected_error")
    wrong += column_faults(subject, done.columns)
    if motion is not None:
        wrong += event_faults(case, tables, subject, motion, ends, done, errors, duration)
    decided = errors.right.all() and ends_are_sure(ends)
    verdict.narrow = passage(case, subject, duration) < SEEN * float(
        done.summary.get("largest_step") or run.get("step", 0)
    )
    return conclude(verdict, done, wrong, decided)


def passage(case: Case, subject: truth.Subject, duration: float) -> float:
    """About the least time in which something that is narrow is passed, s."""
    if not case.narrow:
        return math.inf
    times = np.linspace(0, duration, 601)
    columns = truth.rows_at(subject, [float(t) for t in times], duration).columns
    least = math.inf
    for text, width in case.narrow:
        g = crossings.Expression(text)(columns).astype(float)
        change = np.abs(np.diff(g))[np.flatnonzero(g[1:] * g[:-1] <= 0)]
        least = min(least, width * (times[1] - times[0]) / float(change.max(initial=1e-300)))
    return least


def ends_are_sure(ends: truth.Rows | None) -> bool:
    return ends is None or bool(np.isfinite(ends.uncertainty).all())


def conclude(verdict: Verdict, done: Run, wrong: list[tuple[float, str]], decided: bool) -> Verdict:
    until = done.trusted_until
    expected = done.summary.get("expected_error")
    silent = [text for t, text in wrong if t <= until]
    verdict.wrong = [text for _, text in wrong][:6]
    if silent:
        verdict.kind = "SILENT" if not verdict.narrow else "too narrow"
    elif wrong:
        told_less = expected and all("is not reached" in w for w in done.doubts)
        too_little = told_less and verdict.error > max(100 * expected, 10 * verdict.asked)
        verdict.kind = "SILENT" if too_little else "said"
        if too_little:
            verdict.wrong.insert(0, f"expected {expected:.1e}, is {verdict.error:.1e}")
    elif not decided:
        verdict.kind = "said" if done.doubts else "undecided"
    elif done.doubts and verdict.error < DOUBTFUL[verdict.by] * verdict.asked:
        verdict.kind = "false doubt"
    return verdict


def event_faults(case, tables, subject, motion, ends, done, errors, duration) -> list[tuple[float, str]]:
    """(time, sentence) of what is wrong with events. Times of those that are missed are the ends of their gaps."""
    run = tables["run"]
    rows = errors.error[np.isfinite(errors.uncertainty)]
    there = event_errors(subject, motion, ends, done)
    seen = max(100 * float(max(rows.max(initial=0), there[1].max(initial=0))), 2e-14)
    allowed = limits(run, ends.growth)
    allowed = np.maximum(np.minimum(allowed, seen), 10 * ends.uncertainty)
    times = ends.columns["t"].astype(float)
    until = min(float((done.summary.get("final") or {}).get("t") or duration), duration)
    faults = []
    for k, event in enumerate(tables["event"]):
        if any(w.startswith(f"event {event['name']}:") for w in done.summary.get("warnings", [])):
            continue
        if isinstance(subject, truth.ChainSubject) and subject.chain.spatial and "theta_dot" in event["when"]:
            continue  # it depends on which way theta went by a pole
        mine = [(t, direction) for name, t, direction in done.events if name == event["name"]]
        try:
            beside = case.around[k] if case.around else []
            beside = [filled(text, case.levels[k], case, motion) for text in beside]
            gaps = gaps_of(motion, ends, event["when"], allowed, beside)
        except OverflowError:
            continue
        step = float(done.summary.get("largest_step") or run.get("step", 0))
        wrong = crossings.compare(gaps, mine, event.get("direction", "both"), until, step)
        if case.around and ("sin(" in event["when"] or beside):  # it turns faster than the motion
            wrong = [fault for fault in wrong if fault.lasts > SEEN * step]
        told = {e["name"]: e["count"] for e in done.summary.get("events", [])}.get(event["name"])
        if told != len(mine):
            wrong.append(crossings.Fault(f"count {told}, {len(mine)} in the file", 0.0))
        faults += [(fault.time, f"event {event['name']} ({event['when']}): {fault.text}") for fault in wrong]
    part = np.interp(there[0], times, np.maximum(limits(run, ends.growth), 10 * ends.uncertainty))
    for t, e, m in zip(*there, part, strict=True):
        if e > m:
            faults.append(
                (
                    float(t),
                    f"state of the event at {float(t)!r}: off by {e:.2e}, {e / m:.1e} times what it may be",
                )
            )
    return faults


def event_errors(
    subject: truth.Subject, motion: truth.Dense, ends: truth.Rows, done: Run
) -> tuple[np.ndarray, np.ndarray]:
    """Times of some events, and how far the states are off that are told of them."""
    if not done.event_columns:
        return np.zeros(0), np.zeros(0)
    few = some(done.event_columns["t"])[:12]
    columns = {name: column[few] for name, column in done.event_columns.items()}
    numbers = subject.compared(subject.columns(motion.at(columns["t"])), ends.sizes)
    return columns["t"], truth.largest(subject.compared(columns, ends.sizes) - numbers)


def gaps_of(
    motion: truth.Dense, ends: truth.Rows, when: str, allowed: np.ndarray, beside: Iterable[str] = ()
) -> list[crossings.Gap]:
    """Of an event of a motion whose state may be off by `allowed`, relative to sizes, at `ends`. Beside zeros of
    `beside` it changes quickly."""
    expression = crossings.Expression(when)
    sizes = {name: size_of(motion.subject, name, ends.sizes) for name in expression.columns}
    times = ends.columns["t"].astype(float)

    g = partial(values_of, motion, expression)
    values = g(grid_of(motion, 0.0))
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0))
    level = re.search(r" - ([\d.e+-]+)$", when)  # what is left of a difference has the rounding of its parts
    largest += abs(float(level.group(1))) if level else 0

    def wide(at: np.ndarray) -> np.ndarray:
        part = np.interp(np.asarray(at, dtype=float), times, allowed)
        off = {name: (part + 4e-16) * size for name, size in sizes.items() if name != "t"}
        return crossings.doubt(expression, crossings.columns_of(motion, expression, at), off, largest)

    found = [float(x) for x in re.findall(r"([\d.e-]+)\*t\b", when)]
    found += [
        30 * float(x) for x in re.findall(r"sin\(([\d.e-]+)\*(?!t\b)", when)
    ]  # no faster than 30 of its units
    found += [2 * np.pi / float(x) for x in re.findall(r"fmod\(t, ([\d.e-]+)\)", when)]
    grid = grid_of(motion, max(found, default=0.0))
    # A turn between the last two points, or the first two, shows by no point beside it.
    ends = [np.linspace(grid[k], grid[k + 1], 65) for k in (0, -2)]
    grid = np.unique(np.concatenate([grid, *ends]))
    # Where these turn close to zero they may be zero twice between two points of the grid.
    factors = re.fullmatch(r"\((.*)\)\*\((.*)\)", when)
    for inner in map(crossings.Expression, [*beside, *(factors.groups() if factors else [])]):
        of = partial(values_of, motion, inner)
        turns = crossings.turns(of, grid, of(grid), np.zeros(len(grid)))
        grid = crossings.beside_zeros(of, np.unique(np.concatenate([grid, turns])))
    return crossings.gaps(g, wide, grid)


def values_of(motion: truth.Dense, expression: crossings.Expression, times: np.ndarray) -> np.ndarray:
    return expression(crossings.columns_of(motion, expression, times))


def size_of(subject: truth.Subject, name: str, sizes: np.ndarray) -> float:
    """Of a column."""
    if isinstance(subject, truth.ModelSubject):
        names = subject.model.names
        return float(sizes[names.index(name)]) if name in names else float(max(sizes))
    axes = 3 if subject.chain.spatial else 2
    speed = float(sizes[axes * subject.links])
    if name.startswith("theta_dot"):
        return 2 * speed / subject.chain.lengths[int(name.split("_")[-1]) - 1]
    return 1.0 if name.startswith("theta") else subject.chain.length


# --- ensembles


def judge_ensemble(case: Case, room: truth.Room, program: Program) -> Verdict:
    import h5py

    tables = case.tables
    run = tables["run"]
    if "event" in tables:
        motion, _ = truth.dense(subject_of(case, room), run["duration"])
        tables = closed(case, motion)
    folder = program.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scenario.toml").write_text(toml(tables))
    for old in folder.glob("out.h5*"):
        old.unlink() if old.is_file() else [*map(Path.unlink, old.iterdir()), old.rmdir()]
    began = time.monotonic()
    command = [program.file, "ensemble", "scenario.toml", "-o", "out.h5", "--json", "--threads", "1"]
    by, asked = asked_of(run, True)
    verdict = Verdict(case.name, case.family, settings_of(run), "right", by=by, asked=asked)
    verdict.settings += f", {tables['ensemble'].get('method', 'run')}"
    try:
        ended = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=program.patience
        )
    except subprocess.TimeoutExpired:
        verdict.kind = "slow"
        return verdict
    verdict.seconds = time.monotonic() - began
    summary = json.loads(ended.stdout) if ended.stdout.startswith("{") else {}
    if ended.returncode not in (0, 1) or not summary:
        verdict.kind, verdict.words = "crash", [f"exit status {ended.returncode}", ended.stderr[-300:]]
        return verdict
    verdict.words = Run(0, summary, "", {}, [], {}, verdict.seconds).doubts
    wrong, silent, falsely_doubted = [], [], []
    decided = True
    with h5py.File(folder / "out.h5") as file:
        kept = Kept(file)
        for member, changed in enumerate(members_of(tables, kept)):
            if kept.failed(member):
                continue
            try:
                found, sure, is_told, errors = member_faults(case, changed, room, kept, member)
            except truth.NoReferenceError:
                decided = False
                continue
            decided = decided and sure
            wrong += [text for _, text in found]
            is_doubted = kept.is_doubted(member)
            if found and not is_doubted:
                silent += [text for _, text in found]
            is_right = sure and is_told and not found
            if is_doubted and is_right and errors.error.max(initial=0) < DOUBTFUL[by] * asked:
                falsely_doubted.append(f"member {member} is right")
            verdict.error = max(verdict.error, float(errors.error.max(initial=0)))
            verdict.ratio = max(verdict.ratio, float(errors.ratio.max(initial=0)))
            verdict.growth = max(verdict.growth, float(errors.growth.max(initial=1)))
        if kept.failed_all():
            verdict.kind = "refused"
            return verdict
    verdict.wrong = [*silent, *wrong][:6]
    verdict.words = falsely_doubted + verdict.words
    if silent or wrong:
        verdict.kind = "SILENT" if silent else "said"
    elif falsely_doubted:
        verdict.kind = "false doubt"
    elif not decided:
        verdict.kind = "said" if verdict.words else "undecided"
    return verdict


class Kept:
    """Data sets of an ensemble by the words that the scenario has for them."""

    def __init__(self, file) -> None:
        self.sets = {}
        for name, data in file.items():
            long_name = data.attrs.get("long_name", b"")
            words = long_name.decode() if isinstance(long_name, bytes) else str(long_name)
            for key in {name, words} - {""}:
                self.sets.setdefault(key, data)
        self.meanings = str(self._text(file["status"].attrs["flag_meanings"])).split()
        self.values = np.asarray(file["status"].attrs.get("flag_values", range(len(self.meanings)))).tolist()

    @staticmethod
    def _text(value) -> str:
        return value.decode() if isinstance(value, bytes) else str(value)

    def find(self, *names: str):
        for name in names:
            if name in self.sets:
                return np.asarray(self.sets[name]).ravel()
        raise KeyError(f"none of {names} among {sorted(self.sets)}")

    def has(self, name: str) -> bool:
        return name in self.sets

    def status(self, member: int) -> str:
        value = int(self.find("status")[member])
        return self.meanings[self.values.index(value)] if value in self.values else "not run"

    def failed(self, member: int) -> bool:
        return self.status(member) not in ("ok", "stopped_by_event")

    def is_doubted(self, member: int) -> bool:
        return int(self.find("trusted")[member]) == 0

    def failed_all(self) -> bool:
        return all(self.failed(k) for k in range(len(self.find("status"))))


def underscored(key: str) -> str:
    return re.sub(r"\W+", "_", key).strip("_")


def members_of(tables: dict, kept: Kept) -> Iterable[dict]:
    """The scenario of each member, from the keys' values in the file."""
    ensemble = tables["ensemble"]
    if "axis" in ensemble:
        keys = [axis["key"] for axis in ensemble["axis"]]
        values = [kept.find(key, underscored(key)) for key in keys]
        grid = [v.ravel() for v in np.meshgrid(*values, indexing="ij")]
    else:
        keys = [each["key"] for each in ensemble["random"]]
        grid = [kept.find(key, underscored(key)) for key in keys]
    for numbers in zip(*grid, strict=True):
        changed = json.loads(json.dumps({k: v for k, v in tables.items() if k != "ensemble"}))
        for key, value in zip(keys, numbers, strict=True):
            place = changed
            *parts, last = re.findall(r"[a-z_]+|\d+", key)
            for part in parts:
                place = place[int(part) - 1] if part.isdigit() else place[part]
            place[int(last) - 1 if last.isdigit() else last] = float(value)
        yield changed


def member_faults(case, changed, room, kept, member):
    """What is wrong; whether ends, and whether events, can be judged; RowErrors."""
    subject, run = subject_of(case, room, changed), changed["run"]
    duration = run["duration"]
    names = [
        f"{name}_{i + 1}" for name in ("theta", "phi", "theta_dot", "phi_dot") for i in range(subject.links)
    ]
    columns = {}
    for name in ["t", *names]:
        base, _, index = name.rpartition("_")
        other = f"{base.removesuffix('_dot')}_{index}_dot" if base.endswith("_dot") else name
        if name == "t" or kept.has(name) or kept.has(other):
            columns[name] = np.array([float(kept.find(name, other)[member])])
    columns |= places(subject, columns)
    points = [name for name in kept.sets if re.fullmatch(r"[xyz]_\d+", name)]
    wrong = [
        (0.0, f"member {member}: {name} is {kept.find(name)[member]!r}, angles say {columns[name][0]!r}")
        for name in points
        if abs(kept.find(name)[member] - columns[name][0]) > 1e-12 * subject.chain.length
    ]
    errors = row_errors(subject, columns, run, duration, ensemble=True)
    for t, e, m, g in zip(
        *(x[errors.wrong] for x in (errors.times, errors.error, errors.limit, errors.growth)), strict=True
    ):
        wrong.append(
            (
                float(t),
                f"member {member} at {float(t)!r}: off by {e:.2e}, {e / m:.1e} times what it may be (growth {g:.1e})",
            )
        )
    sure, is_told = bool(errors.right.all()), True
    for event in changed.get("event", []):
        motion, ends = truth.dense(subject, duration)
        allowed = np.maximum(limits(run, ends.growth, True), 10 * ends.uncertainty)
        try:
            found = gaps_of(motion, ends, event["when"], allowed)
        except OverflowError:
            is_told = False
            continue
        crossed = [gap for gap in found if gap.left * gap.right < 0]
        most = len(crossed) + sum(max(gap.zeros, 2) for gap in found if gap.left * gap.right >= 0)
        name = f"event:{event['name']}"
        count = int(kept.find(f"{name}:count", f"{underscored(name)}_count")[member])
        first = float(kept.find(name, underscored(name))[member])
        if not len(crossed) <= count <= most:
            wrong.append((duration, f"member {member}: {count} events, {len(crossed)} to {most} are right"))
        elif (
            crossed
            and count
            and not any(
                gap.start * (1 - 1e-14) <= first <= gap.end * (1 + 1e-14)
                for gap in found
                if gap.start <= crossed[0].start
            )
        ):
            wrong.append(
                (first, f"member {member}: the first event at {first!r}, {crossed[0].start!r} is right")
            )
    return wrong, sure, is_told, errors


def places(subject, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Bobs from angles."""
    chain, found = subject.chain, {}
    x = y = z = 0.0
    for i, length in enumerate(chain.lengths):
        theta = columns[f"theta_{i + 1}"]
        if chain.spatial:
            phi = columns[f"phi_{i + 1}"]
            x, y = x + length * np.sin(theta) * np.cos(phi), y + length * np.sin(theta) * np.sin(phi)
            z = z - length * np.cos(theta)
            found[f"z_{i + 1}"] = z
        else:
            x, y = x + length * np.sin(theta), y - length * np.cos(theta)
        found |= {f"x_{i + 1}": x, f"y_{i + 1}": y}
    return found


def judge(case: Case, room: truth.Room, program: Program) -> Verdict:
    try:
        return (
            judge_ensemble(case, room, program)
            if case.kind == "ensembles"
            else judge_run(case, room, program)
        )
    except truth.NoReferenceError as error:
        return Verdict(
            case.name, case.family, settings_of(case.tables["run"]), "no reference", words=[str(error)]
        )


def environment(cache: Path) -> None:
    """Kernels of models stay with the campaign."""
    os.environ.setdefault("XDG_CACHE_HOME", str(cache))
