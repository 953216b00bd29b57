"""Many motions at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._core import InputError
from ._ensemble_data import dataset_of, open_ensemble
from ._ensemble_text import Design, ensemble_text, some_start
from ._events import event_tables
from ._progress import progress_line
from ._runs import RunFailed, mapping, number, places, plainly, tell, warn
from ._simulation import RUN_OPTIONS, Beginning
from ._systems import System, system_of

if TYPE_CHECKING:
    import xarray


def ensemble(
    system: System,
    duration: float,
    start: Mapping[str, object] | None = None,
    *,
    axes: Mapping[str, object] | None = None,
    random: Mapping[str, object] | None = None,
    members: int | None = None,
    seed: int | None = None,
    keep: str | Sequence[str] | None = None,
    events: Mapping[str, str | Mapping[str, object]] | None = None,
    tolerance: float | None = None,
    step: float | None = None,
    accuracy: float | None = None,
    estimate: bool | None = None,
    threads: int = 0,
    file: str | PathLike[str] | None = None,
    shard: tuple[int, int] | None = None,
    resume: bool = False,
    client: Any = None,
    progress: bool = False,
    **options: object,
) -> xarray.Dataset:
    """Moves many motions of one system at once, as ``pendula ensemble`` does, to the bit.

    Parameters
    ----------
    system : Chain or Model
    duration : float
        In s.
    start : mapping, optional
        Coordinates and rates (or momenta, ``p_theta``) by name, in rad, m and their rates. What is left out is 0.

        A number, or a text such as ``"90 deg"``: that of all members. An array lists them: (members,), of all links
        of a chain (members, links). A tuple has a number or an axis of a grid for each link: ``{"theta": (grid_1,
        grid_2)}`` is the outer product of two vectors.
    axes : mapping, optional
        Further axes of the grid: values of any key of the scenario that takes a number, elements from 1:
        ``{"chain.lengths[1]": array, "run.duration": array}``.
    random : mapping, optional
        Keys that are drawn for each member: ``{"start.theta[1]": ("normal", mean, deviation)}`` or ``("uniform", from,
        to)``. Not beside axes.
    members, seed : int, optional
        Of what is drawn.
    keep : str or sequence of str, optional
        As in a scenario: "final", "points", "energy", "energy_error", "steps", "lyapunov", "ftle", "megno",
        "event:NAME". Left out: final, energy_error, steps and all events.
    events : mapping, optional
        As for :meth:`Chain.simulate`.
    tolerance, step, accuracy, method, stages, form, solver, iteration, estimate
        As ``[run]`` of a scenario; a tolerance of 1e-9 where nothing says otherwise. ``method="auto"`` is
        that of ``[ensemble]``: exponents, too, go by what is quickest in lanes.
    threads : int
        0: as many as there are processors.
    file : path, optional
        An HDF5 file for the result, with journals beside it, so that nothing is lost whatever ends the process.
    shard : (int, int), optional
        ``(2, 8)``: only the second eighth. All shards name one file, which the last one completes; or one each, for
        :func:`merge`.
    resume : bool
        Whether to go on with what an interrupted one has left beside ``file``.
    client : distributed.Client, optional
        Workers of a cluster move the members, one thread each; the same bytes come back. A worker that dies loses
        nothing.
    progress : bool
        Whether to show on the way how many members are done.

    Returns
    -------
    xarray.Dataset
        Over the axes, or over ``member``; names, units and attributes as in the file (docs/reference/ensembles.md):
        ``status`` is 0 of members that came to their end, ``trusted`` 1 or 0 of those that were looked at again, else
        -1. With ``shard`` members that are not done have status -1, and the attribute ``complete`` is 0 until all are.

    Raises
    ------
    InputError
        An argument is wrong.
    RunFailed
        All members failed; ``partial`` is the dataset.

    Warns
    -----
    TrustWarning
        How many members failed or cannot be trusted, and the first one.

    Examples
    --------
    >>> import numpy, pendula
    >>> double = pendula.Chain(masses=[1, 1])
    >>> grid = numpy.linspace(-1, 1, 5)
    >>> data = pendula.ensemble(double, 1.0, {"theta": (grid, grid[:3])}, keep=["final", "energy"])
    >>> data["theta_2"].dims, data["theta_2"].shape, data["energy_start"].attrs["units"]
    (('start_theta_1', 'start_theta_2'), (5, 3), 'J')
    >>> data = pendula.ensemble(double, 1.0, {"theta": numpy.zeros((4, 2))})
    >>> data.sizes["member"], int(data["trusted"].sum())
    (4, 4)
    """
    how_long = number("duration", duration)
    if how_long < 0:
        raise InputError(f"duration: expected a number, not negative, got {duration!r}")
    for name in options:
        if name not in RUN_OPTIONS:
            raise InputError(f"ensemble: expected options among {', '.join(RUN_OPTIONS)}, got {name}")
    kept = [keep] if isinstance(keep, str) else keep
    method = options.pop("method", None)
    starts, keys, drawn = mapping("start", start), mapping("axes", axes), mapping("random", random)
    # A model may have no start where all is zero.
    begin = system_of(system).at_zero() or some_start(starts, keys, drawn)
    # Names alone are asked for, which feedback does not change; a program cannot step what is sampled.
    made = Beginning.of(system, begin, tolerance=None, step=None, options={}, feeds_back=False).prepare()
    design = Design(system, [made.columns[k] for k in made.state])
    design.add_start(starts)
    design.add_axes(keys)
    design.add_random(drawn)
    if step is None and tolerance is None and accuracy is None:
        tolerance = 1e-9
    run = {
        "duration": how_long,
        "method": None if method == "auto" else method,
        "tolerance": tolerance,
        "step": step,
        "accuracy": accuracy,
        "estimate": estimate,
        **options,
    }
    tables = {**design.tables(), "run": run, "event": event_tables(events)}
    text = ensemble_text(tables, method=method, members=members, seed=seed, keep=kept)
    return move_members(
        text,
        "pendula",
        [],
        threads=threads,
        file=file,
        shard=shard,
        resume=resume,
        client=client,
        progress=progress,
    )


def move_members(
    text: str,
    name: str,
    overrides: list[str],
    *,
    threads: int,
    file: str | PathLike[str] | None,
    shard: tuple[int, int] | None,
    resume: bool,
    client: Any,
    progress: bool,
) -> xarray.Dataset:
    """Moves the members of a scenario's text, for whoever was called from outside."""
    how_many = _threads(threads)
    part = None if shard is None else _shard(shard)
    if file is None and (part or resume):
        raise InputError("file: expected the file that shards share, or that is resumed, got none")
    if client is not None and file is not None:
        raise InputError("client: expected no file beside it, got one; the dataset has .to_netcdf")
    with plainly():
        made = _core.Ensemble(text, name, overrides, "pendula.ensemble", *places(), tell)
    is_complete = True
    with progress_line(bool(progress), made.members) as shown:
        if client is not None:
            from . import _cluster

            _cluster.move(made, _cluster.Work.of(made, text, name, overrides), client, shown)
        elif file is None:
            with plainly():
                made.move(how_many, shown)
        else:
            with plainly():
                is_complete = made.write(fspath(file), part, bool(resume), how_many, shown)
        if shown and is_complete:
            shown(made.members)
    data = dataset_of(made) if file is None else open_ensemble(file)
    if data.attrs["complete"]:
        warn(made.warnings, stacklevel=4)
    if made.has_failed:
        raise RunFailed(f"all {made.members} members failed; {made.warnings[-1]}", data)
    return data


def _threads(given: object) -> int:
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and 0 <= given <= 1024:
        return int(given)
    raise InputError(f"threads: expected how many up to 1024, 0 for all processors, got {given!r}")


def _shard(given: object) -> tuple[int, int]:
    if isinstance(given, Sequence) and len(given) == 2 and all(type(one) is int for one in given):
        which, of = given
        if 1 <= which <= of:
            return which, of
    raise InputError(f"shard: expected (I, N) with 1 <= I <= N, got {given!r}")
