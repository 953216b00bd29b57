"""Where an expression of a known motion crosses zero, and where that cannot be told from a miss.

Around the motion lies what the state, the time and the expression may be off by: `doubt`, as a function of time. Where
|g| is above it the sign of g is sure. Between two stretches of sure sign lies a gap: if they differ, there is a
crossing in it, one more than are the other way; if they are the same, there may be pairs.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from truth import Dense, Real

FUNCTIONS = {
    name: getattr(np, name)
    for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "fmod", "sign", "floor")
}
MOST_TURNS = 5000


@dataclass
class Gap:
    """left, right: signs beside it, 0 where it is at an end of the run; zeros: of g itself, in it."""

    start: float
    end: float
    left: int
    right: int
    zeros: int


class Expression:
    def __init__(self, text: str) -> None:
        self.code = compile(text.replace("^", "**"), text, "eval")
        self.columns = [
            name for name in dict.fromkeys(re.findall(r"[a-z]\w*", text)) if name not in FUNCTIONS
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
    expression: Expression, columns: dict[str, np.ndarray], off: dict[str, np.ndarray | float]
) -> np.ndarray:
    """How far g may be off, where each column is by so much, and doubles are."""
    g = expression(columns)
    total = 1e-15 * np.abs(g).max() + 0 * g
    for name in expression.columns:
        column = columns[name]
        rounding = 4e-16 * np.maximum(np.abs(column), np.abs(column).max() if name != "t" else 0)
        step = rounding + (off.get(name, 0.0) if name != "t" else 0.0)
        for shift in (step, -step):
            moved = np.abs(expression({**columns, name: column + shift}) - g)
            total = total + np.where(np.isfinite(moved), moved, 0) / 2
    return total


def turns(
    g: Callable[[np.ndarray], np.ndarray], grid: np.ndarray, values: np.ndarray, wide: np.ndarray
) -> np.ndarray:
    """Times where g turns, of those that are not further than `wide` from zero."""
    slope = np.diff(values)
    k = 1 + np.flatnonzero(slope[1:] * slope[:-1] <= 0)
    change = np.maximum(np.abs(slope[k - 1]), np.abs(slope[k]))
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


def crossing(
    g: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """Times between low and high where g passes its level, by halving."""
    below = g(low) < level
    for _ in range(70):
        middle = (low + high) / 2
        same = (g(middle) < level) == below
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


def gaps(
    g: Callable[[np.ndarray], np.ndarray], wide: Callable[[np.ndarray], np.ndarray], grid: np.ndarray
) -> list[Gap]:
    """`wide` is the doubt at times. Raises OverflowError where g turns too often to be looked at."""
    values = g(grid)
    extra = turns(g, grid, values, wide(grid))
    if len(extra):
        grid = np.unique(np.concatenate([grid, extra]))
        values = g(grid)
    width = wide(grid)
    label = np.where(values > width, 1, np.where(values < -width, -1, 0))
    # Boundaries of sure stretches.
    marks: list[tuple[float, int, int]] = []  # time, the label before and after
    k = np.flatnonzero(label[1:] != label[:-1])
    if len(k):
        for before, after in ((-1, 0), (0, 1), (1, 0), (0, -1)):
            # −1 to 1 passes both levels
            these = k[
                (label[k] * (after - before) <= before * (after - before))
                & (label[k + 1] * (after - before) >= after * (after - before))
            ]
            if len(these) == 0:
                continue
            sign = before or after
            levels = sign * (width[these] + width[these + 1]) / 2
            found = crossing(g, grid[these], grid[these + 1], levels)
            marks += [(float(t), before, after) for t in found]
    marks.sort(key=lambda m: (m[0], (m[2] - m[1]) * m[1]))
    zero = np.flatnonzero((values[1:] > 0) != (values[:-1] > 0))
    zeros = (grid[zero] + grid[zero + 1]) / 2
    found: list[Gap] = []
    start, left = (float(grid[0]), 0) if label[0] == 0 else (None, int(label[0]))
    for time, before, after in marks:
        if after == 0 and start is None:
            start, left = time, before
        elif before == 0 and start is not None:
            found.append(Gap(start, time, left, after, 0))
            start = None
    if start is not None:
        found.append(Gap(start, float(grid[-1]), left, 0, 0))
    for gap in found:
        gap.zeros = int(np.sum((zeros >= gap.start) & (zeros <= gap.end)))
    return found


def compare(found: list[Gap], events: list[tuple[float, str]], direction: str, until: float) -> list[str]:
    """What is wrong with events (time, "up" or "down") that were found until then."""
    wrong, slack = [], 1e-15
    taken = np.zeros(len(events), dtype=bool)
    times = np.array([t for t, _ in events])
    for gap in found:
        edge = slack * max(abs(gap.end), 1e-300) * 8
        mine = (times >= gap.start - edge) & (times <= gap.end + edge) & ~taken if len(events) else taken
        taken |= mine
        if gap.start > until:
            continue
        over = gap.end >= until - edge  # a crossing may lie behind the end
        ups = sum(1 for k in np.flatnonzero(mine) if events[k][1] == "up")
        downs = int(mine.sum()) - ups
        if gap.left * gap.right < 0 and not over:
            wanted = "up" if gap.right > 0 else "down"
            if direction in ("both", wanted) and (ups if wanted == "up" else downs) == 0:
                wrong.append(f"missed: {wanted} in [{gap.start!r}, {gap.end!r}]")
            elif direction == "both" and ups - downs != gap.right:
                wrong.append(
                    f"{ups} up and {downs} down in [{gap.start!r}, {gap.end!r}], one {wanted} more is right"
                )
        if gap.left * gap.right > 0 and not over and direction == "both" and ups != downs:
            wrong.append(f"{ups} up and {downs} down in [{gap.start!r}, {gap.end!r}], a pair")
        if ups + downs > max(gap.zeros, 1) + 3:
            wrong.append(f"{ups + downs} events in [{gap.start!r}, {gap.end!r}], where {gap.zeros} are")
        if direction != "both" and (downs if direction == "up" else ups):
            wrong.append(f"another direction than {direction} in [{gap.start!r}, {gap.end!r}]")
    wrong += [f"false: {events[k][1]} at {events[k][0]!r}" for k in np.flatnonzero(~taken)]
    return wrong
