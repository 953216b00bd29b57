"""The motion between rows: as many points as a picture can show, by the values and the rates of rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .run import Run

SEEN = 5e-4  # part of a curve's range by which a straight line may leave the motion
MOST_PIECES = 64  # of the time between two rows
OFF = 0.01  # part of its range by which a curve through rows may leave the motion before that is said
OFTEN = 0.01  # part of the rows
BLOW = 8  # rates that change so many times faster than before and after do it at a blow
RESTS = 1e-6  # part of the range of others that a coordinate at rest stays within


def finer(run: Run) -> Run:
    """The run with as many rows in between as it takes to see no corners."""
    count = pieces(run)
    if not np.any(count > 1):
        return run
    place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    begin, length = np.repeat(run.time[:-1], count), np.repeat(np.diff(run.time), count)
    return at(run, np.append(begin + length * (place / np.repeat(count, count)), run.time[-1]))


def at(run: Run, times: np.ndarray) -> Run:
    """The run at any times between its first row and its last."""
    columns = {name: np.interp(times, run.time, values) for name, values in run.columns.items()}
    for values, rates, name, rate in curves(run):
        columns[name], found = between(run.time, values, rates, times)
        if rate:
            columns[rate] = found
    columns["t"] = times
    return replace(run, columns=columns)


def curves(run: Run) -> list[tuple[np.ndarray, np.ndarray, str, str]]:
    """Values and rates of what is between rows by them: its column, and that of its rate, if it has one."""
    if len(run.time) < 2 or np.any(np.diff(run.time) <= 0):
        return []
    found = [
        (run.columns[each.name], run.columns[each.rate], each.name, each.rate) for each in run.coordinates
    ]
    rates = point_rates(run)
    for k, point in enumerate(run.points):
        for axis, column in enumerate(point.columns):
            values = run.columns[column]
            rate = np.gradient(values, run.time) if rates is None else rates[:, k, axis]
            found.append((values, rate, column, ""))
    return found


def between(
    t: np.ndarray, values: np.ndarray, rates: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cubics through values with their rates, and the rates of these; straight lines over blows."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    h = t[k + 1] - t[k]
    s = (times - t[k]) / h
    before, after, slope = rates[k], rates[k + 1], (values[k + 1] - values[k]) / h
    bend, twist = 3 * slope - 2 * before - after, before + after - 2 * slope
    curve = values[k] + h * s * (before + s * (bend + s * twist))
    rate = before + s * (2 * bend + s * 3 * twist)
    blow = blows(t, values, rates)[k]
    curve = np.where(blow, values[k] + (times - t[k]) * slope, curve)
    rate = np.where(blow, before + s * (after - before), rate)
    return np.where(s == 1, values[k + 1], curve), np.where(s == 1, after, rate)


def blows(t: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Between which rows a rate jumps, as far as one can see, or is far from how fast values change."""
    fast = np.maximum(np.abs(rates[1:]), np.abs(rates[:-1]))
    apart = np.abs((rates[1:] + rates[:-1]) / 2 - np.diff(values) / np.diff(t)) > fast / 2
    change = np.abs(np.diff(rates) / np.diff(t))
    padded = np.pad(change, 2)
    beside = np.max([padded[k : len(change) + k] for k in (0, 1, 3, 4)], axis=0)
    return (change > BLOW * beside) & (len(change) > 4) | apart


def pieces(run: Run) -> np.ndarray:
    """Into how many each time between rows is cut."""
    count = np.ones(max(len(run.time) - 1, 0), dtype=int)
    for values, rates, _, rate in curves(run):
        h, change = np.diff(run.time), np.abs(np.diff(rates))
        slope, mean = np.diff(values) / h, (rates[1:] + rates[:-1]) / 2
        bends = [(h * (change / 8 + np.abs(mean - slope) / 5), values)]
        if rate:
            bends.append((1.5 * np.abs(slope - mean), rates))
        for bend, curve in bends:
            with np.errstate(divide="ignore", invalid="ignore"):
                wanted = np.ceil(np.sqrt(np.nan_to_num(bend / (SEEN * np.ptp(curve)), posinf=0)))
            wanted = np.where(blows(run.time, values, rates), 1, np.clip(wanted, 1, MOST_PIECES))
            count = np.maximum(count, wanted.astype(int))
    return count


def point_rates(run: Run) -> np.ndarray | None:
    """Of a chain's bobs, (rows, points, dimension): rods turn. None where columns do not tell them."""
    if not run.is_chain:
        return None

    def of_links(name: str) -> np.ndarray:
        return np.column_stack([run.columns[f"{name}_{k + 1}"] for k in range(len(run.points))])[..., None]

    places = run.positions()
    rods = np.diff(places, axis=1, prepend=np.zeros((len(places), 1, run.dimension)))
    length = np.linalg.norm(rods, axis=2, keepdims=True)
    try:
        theta, turning = of_links("theta"), of_links("theta_dot")
        phi, going_round = (
            (of_links("phi"), of_links("phi_dot")) if run.dimension == 3 else (0 * theta, 0 * theta)
        )
    except KeyError:
        return None
    down = -np.eye(run.dimension)[-1]
    level = np.concatenate([np.cos(phi), np.sin(phi), 0 * phi][: run.dimension - 1], axis=2)
    level = np.concatenate([level, 0 * phi], axis=2)
    across = np.concatenate([-np.sin(phi), np.cos(phi), 0 * phi][: run.dimension], axis=2)
    along = np.sin(theta) * level + np.cos(theta) * down
    if np.max(np.abs(rods - length * along)) > 1e-6 * np.max(length):
        return None
    turned = turning * (np.cos(theta) * level - np.sin(theta) * down) + going_round * np.sin(theta) * across
    return np.cumsum(length * turned, axis=1)


def trouble(run: Run) -> str | None:
    """Why the motion between rows is not known, if it is not: rows left out would not be where the others say."""
    wrong = off(run)
    if wrong is None or wrong <= OFF:
        return None
    rows = "1 row" if len(run.time) == 1 else f"{len(run.time)} rows"
    return (
        f"{run.name}: {rows} are too few to tell the motion between them, which pictures may miss by "
        f"{min(wrong, 1):.0%} of its range; more rows (output.interval) show it"
    )


def off(run: Run) -> float | None:
    """How far curves through rows may be from the motion, as a part of its range; None where nothing is known."""
    rates = point_rates(run)
    known = [each for each in curves(run) if each[3] or rates is not None]
    known = [each for each in known if bool(each[3]) == (rates is None)]
    if len(run.time) < 3 or not known:
        return None
    reach = max(np.ptp(values) for values, *_ in known)
    worst = 0.0
    for values, rate, *_ in known:
        scale = np.ptp(values)
        if scale <= RESTS * reach:
            continue
        missed = np.concatenate([missed_rows(run.time, values, rate, first) for first in (0, 1)])
        worst = max(worst, float(np.quantile(missed, 1 - OFTEN)) / scale / 16)
    return worst


def missed_rows(t: np.ndarray, values: np.ndarray, rates: np.ndarray, first: int) -> np.ndarray:
    """How far every other row, but `first` and those like it, is from where these tell it: the error grows with the
    fourth power of the distance, so with all rows it is a sixteenth."""
    kept, left = (
        slice(first, None, 2),
        slice(first + 1, -1 if (len(t) - first) % 2 == 0 else None, 2),
    )
    if len(t[kept]) < 2:
        return np.zeros(0)
    return np.abs(between(t[kept], values[kept], rates[kept], t[left])[0] - values[left])
