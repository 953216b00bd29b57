"""Many motions at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from . import _core, _toml
from ._core import InputError
from ._ensemble_data import dataset_of, open_ensemble
from ._ensemble_rows import rows_of_members, threads_of
from ._ensemble_text import Design, ensemble_text
from ._events import event_tables
from ._progress import progress_line
from ._runs import RunFailed, mapping, places, plainly, tell, warn
from ._simulation import split
from ._systems import System, span_of, system_of

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike


def ensemble(
    system: System,
    duration: float | str | None = None,
    start: Mapping[str, object] | None = None,
    *,
    t: ArrayLike | None = None,
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
    """Moves many motions of one system at once. Results equal those of ``pendula ensemble`` to the last bit.

    Parameters
    ----------
    system : Chain or Model
    duration : float, optional
        In s; left out, the last of the times ``t``.
    t : array_like, optional
        Times of rows, in s. With them the dataset has the columns in ``keep`` of every member over ``t``. Members are
        then moved one by one, as by :meth:`Chain.simulate`, into memory: without ``file``, ``shard`` and ``client``.
    start : mapping, optional
        Coordinates and rates (or momenta, ``p_theta``) by name, in rad, m and their rates, as keyword arguments, too.
        What is left out is 0.

        A number, or a text such as ``"90 deg"``, holds for all members; for several links also an array (links,).
        Other arrays have one entry for each member: (members,), for several links (members, links). A tuple has a
        number or an axis of a grid for each link: ``{"theta": (grid_1, grid_2)}`` is the outer product of two vectors.
    axes : mapping, optional
        Further axes of the grid: values of any key of the scenario that takes a number, elements from 1:
        ``{"chain.lengths[1]": array, "run.duration": array}``.
    random : mapping, optional
        Keys that are drawn for each member: ``{"start.theta[1]": ("normal", mean, deviation)}`` or ``("uniform", from,
        to)``. Not beside axes.
    members, seed : int, optional
        Number of members and seed, for ``random``.
    keep : str or sequence of str, optional
        As in a scenario: "final", "points", "energy", "energy_error", "steps", "lyapunov", "ftle", "megno",
        "event:NAME"; by default final, energy_error, steps and all events. With ``t``: columns of rows, "theta", "x_2";
        by default all.
    events : mapping, optional
        As for :meth:`Chain.simulate`.
    tolerance, step, accuracy, method, stages, form, solver, iteration, estimate
        As ``[run]`` of a scenario; by default a tolerance of 1e-9. ``method="auto"`` is that of ``[ensemble]``: it
        takes the quickest method in lanes, for exponents, too.
    threads : int
        0: as many as there are processors.
    file : path, optional
        An HDF5 file for the result, with journals beside it, so that finished members are not lost if the process ends.
    shard : (int, int), optional
        ``(2, 8)``: only the second eighth. All shards name one file, which the last one completes; or each has its own
        file, for :func:`merge`.
    resume : bool
        Whether to continue from the journals that an interrupted ensemble has left beside ``file``.
    client : distributed.Client, optional
        Workers of a cluster move the members, one thread each, with the same result to the last bit. If a worker dies,
        others take over its members.
    progress : bool
        Whether to show how many members are done.

    Returns
    -------
    xarray.Dataset
        Over the axes, or over ``member``; names, units and attributes as in the file (docs/reference/ensembles.md).
        ``status`` is 0 for members that reached their end, ``trusted`` 1 or 0 for those that had a second look, else
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
        The number of members that failed or cannot be trusted, and the first of them.

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
    >>> data = pendula.ensemble(double, theta=numpy.zeros((4, 2)), t=numpy.linspace(0, 1, 11))
    >>> data["theta_2"].dims, data["theta_2"].shape
    (('member', 't'), (4, 11))
    """
    starts, runs = split(ensemble, system, start, options)
    times, how_long = span_of("ensemble", duration, t)
    kept = [keep] if isinstance(keep, str) else keep
    method = runs.pop("method", None)
    keys, drawn = mapping("axes", axes), mapping("random", random)
    design = Design(system_of(system))
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
        **runs,
    }
    tables = {**design.tables(), "run": run, "event": event_tables(events)}
    if times is not None:
        if file is not None or shard is not None or resume or client is not None:
            raise InputError("t: expected neither file, shard, resume nor client beside it, got one")
        text = ensemble_text(tables, method=None, members=members, seed=seed, keep=["steps"])
        alone = {key: one for key, one in tables.items() if not key.startswith("ensemble.")}
        alone["output"] = {"times": times.tolist()}
        return rows_of_members(text, _toml.document(alone), times, kept, threads, progress)
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
    """Moves the members of a scenario's text. Call it from a public function only: warnings name its caller."""
    how_many = threads_of(threads)
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


def _shard(given: object) -> tuple[int, int]:
    if isinstance(given, Sequence) and len(given) == 2 and all(type(one) is int for one in given):
        which, of = given
        if 1 <= which <= of:
            return which, of
    raise InputError(f"shard: expected (I, N) with 1 <= I <= N, got {given!r}")
