"""Many motions at once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._core import InputError
from ._runs import mapping, number, numbers, plainly, warn
from ._simulation import RUN_OPTIONS, Beginning
from ._systems import System

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray

# By RunEnd of C++.
STATUSES = ("ok", "event", "stopped", "failed", "failed", "failed")


def ensemble(
    system: System,
    duration: float,
    start: Mapping[str, object],
    *,
    tolerance: float | None = None,
    step: float | None = None,
    estimate: bool = True,
    threads: int = 0,
    **options: object,
) -> xarray.Dataset:
    """Moves many motions of one system at once.

    Parameters
    ----------
    system : Chain or Model
    duration : float
        In s.
    start : mapping of arrays
        Coordinates and rates by name, in rad, m and their rates. An array is (members,), of all links of a chain
        (members, links); a single number is that of all members. What is left out is 0.
    tolerance, step : float, optional
        As for :class:`Simulation`.
    estimate : bool
        Whether members are moved a second time to see how far they can be trusted.
    threads : int
        0: as many as there are processors.

    Returns
    -------
    xarray.Dataset
        Where each member ends, by the names of columns over ``member``, with ``run_status`` ("ok", "failed"),
        ``run_trusted`` (where it was estimated) and ``run_energy_error``, relative.

    Warns
    -----
    TrustWarning
        How many members cannot be trusted, and why the first one.

    Examples
    --------
    >>> import numpy, pendula
    >>> double = pendula.Chain(masses=[1, 1])
    >>> ends = pendula.ensemble(double, 1.0, {"theta": numpy.linspace(0, 1, 12).reshape(6, 2)})
    >>> ends["theta_2"].shape, bool(ends["run_trusted"].all())
    ((6,), True)
    """
    import xarray

    how_long = number("duration", duration)
    if how_long < 0:
        raise InputError(f"duration: expected a number, not negative, got {duration!r}")
    if not isinstance(threads, (int, np.integer)) or isinstance(threads, bool) or threads < 0:
        raise InputError(f"threads: expected how many, 0 for all processors, got {threads!r}")
    for name in options:
        if name not in RUN_OPTIONS:
            raise InputError(f"ensemble: expected options among {', '.join(RUN_OPTIONS)}, got {name}")
    at_zero = system.at_zero() if isinstance(system, System) else {}
    made = Beginning.of(system, at_zero, tolerance=tolerance, step=step, options=options).prepare()
    columns = made.columns
    names = [columns[k] for k in made.state]
    starts = _starts(mapping("start", start), names)
    with plainly():
        ends, how, errors, doubts = _core.propagate(made, starts, how_long, int(threads), bool(estimate))
    data: dict[str, Any] = {name: ("member", ends[:, k]) for k, name in enumerate(names)}
    if not data.keys().isdisjoint(("run_status", "run_trusted", "run_energy_error")):
        raise InputError("system: expected coordinates with names that do not begin with run_")
    data["run_status"] = ("member", np.array([STATUSES[one] for one in how]))
    if estimate:
        data["run_trusted"] = ("member", np.array([doubt == "" for doubt in doubts], dtype=bool))
    data["run_energy_error"] = ("member", errors)
    untrusted = [k for k, doubt in enumerate(doubts) if doubt]
    if untrusted:
        first = untrusted[0]
        warn(
            [f"{len(untrusted)} of {len(how)} members cannot be trusted; member {first}: {doubts[first]}"], 3
        )
    return xarray.Dataset(data)


def _starts(given: Mapping[str, object], names: list[str]) -> NDArray[np.float64]:
    """(members, state) of arrays by name. Raises InputError."""
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in given.items():
        for column, one in _columns_of(name, numbers(f"start: {name}", values), names):
            if column in columns:
                raise InputError(f"start: {column} is given twice")
            columns[column] = one
    sizes = {one.size for one in columns.values() if one.ndim > 0}
    if len(sizes) > 1:
        raise InputError(f"start: expected as many members of each, got {', '.join(map(str, sorted(sizes)))}")
    starts = np.zeros((sizes.pop() if sizes else 1, len(names)))
    for column, one in columns.items():
        if not np.isfinite(one).all():
            wrong = next(x for x in one.ravel() if not math.isfinite(x))
            raise InputError(f"start: expected finite numbers for {column}, got {wrong}")
        starts[:, names.index(column)] = one
    return starts


def _columns_of(
    name: str, values: NDArray[np.float64], names: list[str]
) -> list[tuple[str, NDArray[np.float64]]]:
    if name in names:
        if values.ndim > 1:
            raise InputError(f"start: expected a number or (members,) for {name}, got shape {values.shape}")
        return [(name, values)]
    links = [column for column in (f"{name}_{k + 1}" for k in range(len(names))) if column in names]
    if not links:
        raise InputError(f"start: expected some of {', '.join(names)}, got {name}")
    if values.ndim == 0 or (len(links) == 1 and values.ndim == 1):
        return [(column, values) for column in links]
    if values.ndim != 2 or values.shape[1] != len(links):
        raise InputError(f"start: expected (members, {len(links)}) for {name}, got shape {values.shape}")
    return [(column, values[:, k]) for k, column in enumerate(links)]
