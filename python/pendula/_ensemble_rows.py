"""Members of ensembles over time: their rows."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _core
from ._core import InputError
from ._ensemble_data import dataset
from ._progress import progress_line
from ._runs import RunFailed, did_you_mean, in_order, places, plainly, tell, warn

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray


NOT_OF_MEMBERS = ("status", "trusted")  # they come of moving them


def rows_of_members(
    text: str,
    alone: str,
    times: NDArray[np.float64],
    keep: Sequence[str] | None,
    threads: int,
    progress: bool,
) -> xarray.Dataset:
    """Moves the members of an ensemble, each as a run of its own: that of the scenario ``alone`` with its numbers."""
    how_many = threads_of(threads) or os.cpu_count() or 1
    with plainly():
        made = _core.Ensemble(text, "pendula", [], "pendula.ensemble", *places(), tell)
    members = _Members(made)
    with plainly():
        prepared = _core.prepare(alone, "pendula", members.overrides(0), *places(), tell, False)
    columns = prepared.columns
    kept = _kept(columns, in_order(columns, prepared.state)[1:], keep)
    rows = np.full((made.members, times.size, len(kept)), np.nan)
    status = np.full(made.members, members.meanings.index("wrong_input") - 1, np.int8)
    trusted = np.full(made.members, -1, np.int8)
    problems: dict[int, str] = {}

    def move(member: int) -> None:
        try:
            with plainly():
                found = _core.simulate(alone, "pendula", members.overrides(member), [], None, *places(), tell)
        except InputError as error:
            problems[member] = str(error)
            return
        told = json.loads(found.summary)
        outcome = told.get("outcome", {})
        status[member] = members.meanings.index(outcome["status"]) - 1
        if status[member] > 1:
            problems[member] = outcome.get("message", outcome["status"])
        else:
            trusted[member] = not told["warnings"]
        at = np.searchsorted(times, found.rows[:, 0]).clip(max=times.size - 1)
        is_asked = times[at] == found.rows[:, 0]
        rows[member, at[is_asked]] = found.rows[is_asked][:, kept]

    with progress_line(bool(progress), made.members) as shown, _pool(how_many) as pool:
        for done, _ in enumerate(pool.map(move, range(made.members)), 1):
            if shown:
                shown(done)
    data = members.dataset(times)
    for k, column in enumerate(kept):
        name = columns[column]
        attrs = {"long_name": name, "units": prepared.units[name]}
        data[name] = ((*members.dims, "t"), rows[:, :, k].reshape(*made.shape, times.size), attrs)
    data["status"] = (members.dims, status.reshape(made.shape), data["status"].attrs)
    data["trusted"] = (members.dims, trusted.reshape(made.shape), data["trusted"].attrs)
    sentences = []
    if problems:
        first = min(problems)
        sentences.append(
            f"{len(problems)} of {made.members} members failed; member {first}: {problems[first]}"
        )
    if (trusted == 0).any():
        first = int(np.flatnonzero(trusted == 0)[0])
        sentences.append(
            f"{int((trusted == 0).sum())} of {made.members} members cannot be trusted to their ends; the first is "
            f"member {first}"
        )
    if len(problems) == made.members:
        raise RunFailed(f"all {sentences[0].split(' of ', 1)[1]}", data)
    warn(sentences, stacklevel=4)
    return data


def threads_of(given: object) -> int:
    """How many; 0 for all processors. Raises InputError."""
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and 0 <= given <= 1024:
        return int(given)
    raise InputError(f"threads: expected how many up to 1024, 0 for all processors, got {given!r}")


class _Key(NamedTuple):
    """A key of a scenario, and its numbers: of an axis, or one of each member."""

    key: str
    numbers: NDArray[np.float64]
    axis: int | None


class _Members:
    """What the members of an ensemble have each for itself."""

    def __init__(self, made: _core.Ensemble) -> None:
        self.dims: tuple[str, ...] = ()
        self.meanings: list[str] = []
        self._shape = made.shape
        self._attributes = dict(made.attributes)
        self._scales: dict[str, Any] = {}
        self._data: dict[str, Any] = {}
        self._keys: list[_Key] = []
        for k, (name, kind, attributes, flags) in enumerate(made.arrays):
            attrs: dict[str, Any] = dict(attributes)
            numbers: Any = None if name in (*NOT_OF_MEMBERS, "steps") else made.numbers(k)
            if name in NOT_OF_MEMBERS:
                attrs["flag_values"] = np.arange(-1, flags - 1, dtype=np.int8)
                self._data[name] = attrs
                if name == "status":
                    self.meanings = attrs["flag_meanings"].split()
            elif kind == "scale":
                self._scales[name] = (name, numbers, attrs)
                if name != "member":
                    self._keys.append(_Key(attrs["long_name"], numbers, len(self.dims)))
                self.dims = (*self.dims, name)
            elif name != "steps":
                self._keys.append(_Key(attrs["long_name"], numbers, None))
                self._scales[name] = (self.dims, numbers.reshape(made.shape), attrs)

    def overrides(self, member: int) -> list[str]:
        """Its numbers, as a scenario takes them."""
        place = np.unravel_index(member, self._shape)
        return [
            f"{one.key}={float(one.numbers[member if one.axis is None else place[one.axis]])!r}"
            for one in self._keys
        ]

    def dataset(self, times: NDArray[np.float64]) -> xarray.Dataset:
        """With all but the rows."""
        nothing = np.zeros(self._shape, np.int8)
        data = {name: (self.dims, nothing, attrs) for name, attrs in self._data.items()}
        members = int(np.prod(self._shape))
        attributes = {**self._attributes, "members_done": members, "complete": 1}
        return dataset(data, {**self._scales, "t": ("t", times, {"units": "s"})}, attributes)


@contextmanager
def _pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Threads; what has not begun is left where something is raised, as by Ctrl-C."""
    pool = ThreadPoolExecutor(threads)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _kept(columns: list[str], order: list[int], keep: Sequence[str] | None) -> list[int]:
    """Columns, in their order. Raises InputError."""
    if keep is None:
        return order
    found = {
        name: [k for k in order if columns[k] == name or columns[k].rsplit("_", 1)[0] == name]
        for name in keep
    }
    for name, places_of in found.items():
        if not places_of:
            near = did_you_mean(str(name), [columns[k] for k in order])
            raise InputError(f"keep: expected columns of rows beside t, got {name}{near}")
    wanted = {k for places_of in found.values() for k in places_of}
    return [k for k in order if k in wanted]
