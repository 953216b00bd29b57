"""Where an expression of a known motion crosses zero, and where that cannot be told from a miss.

Around the motion lies what the state, the time and the expression may be off by: `doubt`, as a function of time. Where
|g| is above it the sign of g is sure. Between two stretches of sure sign lies a gap: if they differ, there is a
crossing in it, one more than are the other way; if they are the same, there may be pairs.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from truth import Dense, Real

FUNCTIONS = {
    name: getattr(np, name)
    for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "fmod", "sign", "floor")
} | {"atan2": np.arctan2}
MOST_TURNS = 5000


@dataclass
class Gap:
    """left, right: signs beside it, 0 where it is at an end of the run; zeros: of g itself, in it."""

    start: float
    end: float
    left: int
    right: int
    zeros: int


@dataclass
class Fault:
    """What is wrong with events; where, and how long the shorter stretch of sure sign beside it lasts."""

    text: str
    time: float
    lasts: float = np.inf


class Expression:
    """Text of an event, for arrays of columns. exp(-(u/w)^2) - 0.5 is replaced by w sqrt(ln 2) - |u|, which has the
    same sign: where the exponential is 0, its slope does not tell how far zero is."""

    def __init__(self, text: str) -> None:
        if bell := re.fullmatch(r"exp\(-\((.*)/([\d.e-]+)\)\^2\) - 0\.5", text):
            text = f"{float(bell[2]) * math.sqrt(math.log(2))!r} - abs{bell[1]}"
        self.code = compile(text.replace("^", "**"), text, "eval")
        self.columns = [
            name for name in dict.fromkeys(re.findall(r"(?<![\w.])[a-z]\w*", text)) if name not in FUNCTIONS
        ]

    def __call__(self, columns: dict[str, np.ndarray]) -> np.ndarray:
        with np.errstate(all="ignore"):
            return eval(self.code, {"__builtins__": {}, **FUNCTIONS, "pi": np.pi}, columns) + 0 * columns["t"]


def columns_of(motion: Dense, expression: Expression, times: np.ndarray) -> dict[str, np.ndarray]:
    """What the expression needs; no state where it needs but the time."""
    if set(expression.columns) <= {"t"}:
        return {"t": np.asarray(times, dtype=Real)}
    columns = motion.subject.columns(motion.at(times))
    return {"t": columns["t"]} | {name: columns[name] for name in expression.columns}


def doubt(
    expression: Expression, columns: dict[str, np.ndarray], off: dict[str, np.ndarray], size: float
) -> np.ndarray:
    """How far g, whose values are up to `size`, may be off, where each column is by so much, and doubles are."""
    g = expression(columns)
    total = 1e-15 * size + 0 * g
    for name in expression.columns:
        column = columns[name]
        step = 4e-16 * np.abs(column) + off.get(name, 0.0)
        moved = [np.abs(expression({**columns, name: column + shift}) - g) for shift in (step, -step)]
        total = total + np.nan_to_num(np.maximum(*moved), nan=0.0, posinf=0.0)
    return total


def turns(
    g: Callable[[np.ndarray], np.ndarray], grid: np.ndarray, values: np.ndarray, wide: np.ndarray
) -> np.ndarray:
    """Times where g turns, of those that are not further than `wide` from zero."""
    slope = np.diff(values)
    k = 1 + np.flatnonzero(slope[1:] * slope[:-1] <= 0)
    beside = np.clip(k[:, None] + (-2, -1, 1, 2), 0, len(grid) - 1)  # of a grid that is uneven
    change = np.abs(values[beside] - values[k, None]).max(axis=1, initial=0)
    k = k[np.abs(values[k]) < 4 * change + 2 * wide[k]]
    if len(k) > MOST_TURNS:
        raise OverflowError("it turns too often")
    if len(k) == 0:
        return np.array([], dtype=Real)
    low, high = grid[k - 1], grid[k + 1]
    up = np.where(values[k] >= np.maximum(values[k - 1], values[k + 1]), 1, -1)
    parts = np.linspace(0, 1, 17, dtype=Real)
    for _ in range(7):
        times = low[:, None] + (high - low)[:, None] * parts
        found = up[:, None] * g(times.ravel()).reshape(times.shape)
        best = np.clip(found.argmax(axis=1), 1, len(parts) - 2)
        row = np.arange(len(k))
        low, high = times[row, best - 1], times[row, best + 1]
    return (low + high) / 2


def boundary(holds: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where what holds at low, and does not at high, ends; by halving."""
    for _ in range(60):
        middle = (low + high) / 2
        there = holds(middle)
        low, high = np.where(there, middle, low), np.where(there, high, middle)
    return (low + high) / 2


def beside_zeros(g: Callable[[np.ndarray], np.ndarray], grid: np.ndarray) -> np.ndarray:
    """The grid, and times that close in on where g crosses zero."""
    values = g(grid)
    k = np.flatnonzero(values[1:] * values[:-1] <= 0)
    if len(k) == 0 or len(k) > MOST_TURNS // 20:
        return grid
    positive = values[k] > 0
    zeros = boundary(lambda at: (g(at) > 0) == positive, grid[k], grid[k + 1])
    away = np.concatenate([[0.0], np.diff(grid).max() * 2 * Real(1.3) ** -np.arange(130, dtype=Real)])
    near = np.concatenate([zeros[:, None] + away, zeros[:, None] - away]).ravel()
    return np.unique(np.concatenate([grid, near[(near > grid[0]) & (near < grid[-1])]]))


def gaps(
    g: Callable[[np.ndarray], np.ndarray], wide: Callable[[np.ndarray], np.ndarray], grid: np.ndarray
) -> list[Gap]:
    """`wide` is the doubt at times. Raises OverflowError where g turns too often to be looked at."""
    values = g(grid)
    extra = turns(g, grid, values, wide(grid))
    if len(extra):
        grid = np.unique(np.concatenate([grid, extra]))
        values = g(grid)

    def sure(values: np.ndarray, width: np.ndarray) -> np.ndarray:
        return np.where(values > width, 1, np.where(values < -width, -1, 0))

    label = sure(values, wide(grid))
    k = np.flatnonzero(label[1:] != label[:-1])
    marks: list[tuple[float, int, int]] = []  # time, the label before and after
    for old, new in ((label[k], 0 * k), (0 * k, label[k + 1])):
        those = np.flatnonzero(old != new)
        low, high = grid[k[those]], grid[k[those] + 1]
        here = old[those] + new[those]  # the label that is not 0
        ends = old[those] != 0
        if len(those) == 0:
            continue
        where = boundary(lambda at, here=here, ends=ends: (sure(g(at), wide(at)) == here) == ends, low, high)
        marks += list(zip(map(float, where), old[those], new[those], strict=True))
    marks.sort(key=lambda m: (m[0], m[2] != 0))
    zero = np.flatnonzero((values[1:] > 0) != (values[:-1] > 0))
    zeros = (grid[zero] + grid[zero + 1]) / 2
    found: list[Gap] = []
    start, left = (float(grid[0]), 0) if label[0] == 0 else (None, int(label[0]))
    for time, before, after in marks:
        if after == 0 and start is None:
            start, left = time, int(before)
        elif before == 0 and start is not None:
            found.append(Gap(start, time, left, int(after), 0))
            start = None
    if start is not None:
        found.append(Gap(start, float(grid[-1]), left, 0, 0))
    for gap in found:
        gap.zeros = int(np.sum((zeros >= gap.start) & (zeros <= gap.end)))
    return found


def compare(
    found: list[Gap], events: list[tuple[float, str]], direction: str, until: float, step: float = 0.0
) -> list[Fault]:
    """What is wrong with events (time, "up" or "down") that were found until then. A time within a step is rounded as
    the size of the step is, too: hence `step`."""
    wrong, slack = [], 8e-15
    taken = np.zeros(len(events), dtype=bool)
    times = np.array([t for t, _ in events])
    ends = [gap.end for gap in found]
    starts = [gap.start for gap in found]
    for k, gap in enumerate(found):
        edge = slack * max(abs(gap.end), step, 1e-300)
        mine = (times >= gap.start - edge) & (times <= gap.end + edge) & ~taken if len(events) else taken
        taken |= mine
        if gap.start > until:
            continue
        over = gap.end >= until - edge  # a crossing may lie behind the end
        ups = sum(1 for k in np.flatnonzero(mine) if events[k][1] == "up")
        downs = int(mine.sum()) - ups
        before = gap.start - ends[k - 1] if k else np.inf
        after = starts[k + 1] - gap.end if k + 1 < len(found) else np.inf
        place = f"in [{gap.start!r}, {gap.end!r}]"

        def tell(text: str, place=place, end=gap.end, lasts=(before, after)) -> None:
            wrong.append(Fault(f"{text} {place}", end, min(lasts)))

        if gap.left * gap.right < 0 and not over:
            wanted = "up" if gap.right > 0 else "down"
            if direction in ("both", wanted) and (ups if wanted == "up" else downs) == 0:
                tell(f"missed: {wanted}")
            elif direction == "both" and ups - downs != gap.right:
                tell(f"one {wanted} more is right than {ups} up and {downs} down")
        if gap.left * gap.right > 0 and not over and direction == "both" and ups != downs:
            tell(f"half a pair: {ups} up and {downs} down")
        # Errors of the state may lead to and fro across two levels that are closer than they: six events were seen
        # where there are none (events 165).
        if ups + downs > 2 * max(gap.zeros, 1) + 6:
            tell(f"{ups + downs} events where {gap.zeros} are")
        if direction != "both" and (downs if direction == "up" else ups):
            tell(f"another direction than {direction}")
    wrong += [
        Fault(f"false: {events[k][1]} at {events[k][0]!r}", events[k][0]) for k in np.flatnonzero(~taken)
    ]
    return wrong
