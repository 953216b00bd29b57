"""Rows of the members of ensembles, over time."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from . import _core
from ._core import InputError
from ._ensemble_data import MOVED, dataset_of
from ._progress import progress_line
from ._runs import RunFailed, columns_of, did_you_mean, in_order, places, plainly, tell, warn

if TYPE_CHECKING:
    import xarray
    from numpy.typing import NDArray


def rows_of_members(
    text: str,
    alone: str,
    times: NDArray[np.float64],
    keep: Sequence[str] | None,
    threads: int,
    progress: bool,
) -> xarray.Dataset:
    """Moves the members of an ensemble, each as a run of the scenario ``alone`` with the numbers of the member."""
    how_many = threads_of(threads) or os.cpu_count() or 1
    with plainly():
        made = _core.Ensemble(text, "pendula", [], "pendula.ensemble", *places(), tell)
    before = dataset_of(made, has_moved=False)
    dims, meanings = before["status"].dims, before["status"].attrs["flag_meanings"].split()
    lists = [name for name in before.data_vars if name not in MOVED]
    own = {
        before[name].attrs["long_name"]: before[name].broadcast_like(before["status"]).transpose(*dims)
        for name in (*dims, *lists)
        if name != "member"
    }

    def overrides(member: int) -> list[str]:
        return [f"{key}={float(numbers.values.flat[member])!r}" for key, numbers in own.items()]

    with plainly():
        prepared = _core.prepare(alone, "pendula", overrides(0), *places(), tell)
    columns = prepared.columns
    kept = _kept(columns, in_order(columns, prepared.state)[1:], keep)
    rows = np.full((made.members, times.size, len(kept)), np.nan)
    status = np.full(made.members, meanings.index("wrong_input") - 1, np.int8)
    trusted = np.full(made.members, -1, np.int8)
    problems: dict[int, str] = {}

    def move(member: int) -> None:
        try:
            with plainly():
                found = _core.simulate(alone, "pendula", overrides(member), [], None, *places(), tell)
        except InputError as error:
            problems[member] = str(error)
            return
        told = json.loads(found.summary)
        outcome = told.get("outcome", {})
        status[member] = meanings.index(outcome["status"]) - 1
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
    data = before.drop_vars("steps").set_coords(lists).assign_coords(t=("t", times, {"units": "s"}))
    data = data.assign_attrs(members_done=made.members, complete=1)
    for k, column in enumerate(kept):
        name = columns[column]
        attrs = {"long_name": name, "units": prepared.units[name]}
        data[name] = ((*dims, "t"), rows[:, :, k].reshape(*made.shape, times.size), attrs)
    data["status"] = (dims, status.reshape(made.shape), data["status"].attrs)
    data["trusted"] = (dims, trusted.reshape(made.shape), data["trusted"].attrs)
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
    """The number of threads; 0 for all processors. Raises InputError."""
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and 0 <= given <= 1024:
        return int(given)
    raise InputError(f"threads: expected how many up to 1024, 0 for all processors, got {given!r}")


@contextmanager
def _pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """A pool of threads. An exception, as by Ctrl-C, cancels work that has not begun."""
    pool = ThreadPoolExecutor(threads)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _kept(columns: list[str], order: list[int], keep: Sequence[str] | None) -> list[int]:
    """Indices of the columns to keep, in their order. Raises InputError."""
    if keep is None:
        return order
    names = [columns[k] for k in order]
    wanted: set[str] = set()
    for name in keep:
        found = columns_of(str(name), names)
        if not found:
            near = did_you_mean(str(name), names)
            raise InputError(f"keep: expected columns of rows beside t, got {name}{near}")
        wanted.update(found)
    return [k for k in order if columns[k] in wanted]
