"""Solutions: the results of runs."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from math import inf
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core, _pictures
from ._gradient import Gradient, gradient
from ._progress import bar
from ._runs import RunFailed, columns_of, in_order, missing, number, numbers, places, plainly, tell, warn

if TYPE_CHECKING:
    import xarray
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray


class Solution:
    """Rows of a run, with SciPy's names.

    Attributes
    ----------
    t : (rows,) array
        Times, in s.
    y : (coordinates + rates, rows) array
        Coordinates, then their rates, in the order of ``names``: for a chain all theta, then all phi.
    names : list of str
        Names of the rows of ``y``; :attr:`Simulation.state` and :func:`linearize` have the same order.
    t_events, y_events : dict of arrays
        Times (events,) and states (events, coordinates + rates) of each event, by its name.
    status : int
        0: the run reached its end; 1: an event ended it; -1: it failed.
    message : str
    success : bool
    summary : dict
        As ``pendula simulate --json``: method, steps, energy error, warnings and more.
    columns, units : list of str
        Names and units of all numbers of a row, the time first, then those of ``names``: ``run["theta_1"]``;
        ``run["theta"]`` has all links, (links, rows). Files of chains have another order, link by link.

    Notes
    -----
    Arrays are read-only. A zero at the very start or end of the run does not count as an event.
    """

    def __init__(self, result: _core.Result, summary: dict[str, Any] | None = None) -> None:
        self._result = result
        order = in_order(result.columns, result.state)
        self.columns: list[str] = [result.columns[k] for k in order]
        self.units: list[str] = [result.units[k] for k in order]
        self._places = dict(zip(self.columns, order, strict=True))  # among the columns of a row
        self.summary: dict[str, Any] = summary or json.loads(result.summary or "{}")
        self._rows: NDArray[np.float64] = result.rows
        self._state = np.array(result.state)
        self.names: list[str] = self.columns[1 : 1 + len(self._state)]
        self.t: NDArray[np.float64] = self._rows[:, 0]
        self.y: NDArray[np.float64] = self._rows[:, self._state].T
        self.y.flags.writeable = False
        happened = np.array(result.events, dtype=object)
        events = result.event_rows
        self.t_events: dict[str, NDArray[np.float64]] = {
            name: events[happened == name, 0] for name in result.event_names
        }
        self.y_events: dict[str, NDArray[np.float64]] = {
            name: events[happened == name][:, self._state] for name in result.event_names
        }
        outcome = self.summary.get("outcome", {"status": "unfinished", "message": "The run was cut off."})
        status = outcome["status"]
        self.status: int = 0 if status == "ok" else 1 if status == "stopped_by_event" else -1
        by_event = f"Event {outcome.get('event')} ended the run."
        usual = by_event if self.status == 1 else "The run came to its end."
        self.message: str = outcome.get("message") or usual
        self.success: bool = self.status >= 0

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A column by its name; without an index, of all links, (links, rows)."""
        found = [self._places[column] for column in self._columns(name)]
        return self._rows[:, found[0]] if name in self._places else self._rows[:, found].T

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and bool(columns_of(name, self.columns))

    def __iter__(self) -> Iterator[str]:
        """Names of the columns."""
        return iter(self.columns)

    def _columns(self, name: str) -> list[str]:
        if name not in self:
            raise KeyError(f"{name}: expected one of {', '.join(self.columns)}")
        return columns_of(name, self.columns)

    def sol(self, t: ArrayLike) -> NDArray[np.float64]:
        """The motion at any times of the run, in any order, at the full order of the method.

        The run is repeated for it, by the same steps, from its start to its end.

        Parameters
        ----------
        t : float or (m,) array_like
            In s.

        Returns
        -------
        (coordinates + rates,) or (coordinates + rates, m) array
            In the order of ``names``.
        """
        when = numbers("t", t)
        if when.ndim > 1:
            raise _core.InputError(
                f"t: expected a time or a vector of times, got an array of shape {when.shape}"
            )
        begin, end = self._span()
        if self.t.size == 0 or not np.all((when >= begin) & (when <= end)):
            there = f"times from {begin} to {end} s" if self.t.size else "a solution with rows"
            raise _core.InputError(f"t: expected {there}, got {t!r}")
        times, order = np.unique(when, return_inverse=True)
        return self._rows_at(times)[:, self._state].T[:, order.reshape(when.shape)]

    def _rows_at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows of the same run, made again, at ascending times."""
        with plainly():
            return _core.rows_at(self._result, (times - self._result.begin).tolist(), *places(), tell)

    def _span(self) -> tuple[float, float]:
        """Start and end of the motion. Rows at given times need not reach its end."""
        last = float(self.t[-1]) if self.t.size else self._result.begin
        return self._result.begin, max(last, self.summary.get("final", {}).get("t", last))

    def go_on(self, duration: float, *, progress: bool | None = None) -> Solution:
        """The same run to a later end, by its method and its steps: equal, to the last bit, to a run in one go.

        Parameters
        ----------
        duration : float
            Of the whole run, in s.
        progress : bool, optional
            As for :meth:`Chain.simulate`.

        Returns
        -------
        Solution
            With the rows of this one, too.

        Raises
        ------
        InputError
            The run is longer already; or it was made by another version of pendula, or on another instruction set.

        Examples
        --------
        >>> import pendula
        >>> double = pendula.Chain(links=2)
        >>> run = double.simulate(1.0, theta=1.0, step=0.01).go_on(2.0)
        >>> bool((run.y == double.simulate(2.0, theta=1.0, step=0.01).y).all())
        True
        """
        end = number("duration", duration)
        with bar(end, progress) as told, plainly():
            result = _core.go_on(self._result, [f"run.duration={end!r}"], told, *places(), tell)
        return concluded(result)

    def save(self, file: str | PathLike[str]) -> None:
        """Writes the rows: CSV, or a run file (HDF5) that ends in .h5, .hdf5 or .nc.

        A run file has names and units, the scenario, events, and a checkpoint from which the run can go on:
        :func:`pendula.open`, ``pendula plot``, ``pendula simulate --resume``, xarray and netCDF read it.

        Raises
        ------
        InputError
            The file cannot be opened; OSError if it cannot be written.
        """
        with plainly():
            _core.save(self._result, fspath(file))

    def to_netcdf(self, file: str | PathLike[str]) -> None:
        """Writes a run file, as :meth:`save`: run files are netCDF files."""
        if not fspath(file).endswith((".nc", ".h5", ".hdf5")):
            raise _core.InputError(
                f"file: expected a name that ends in .nc, .h5 or .hdf5, got {fspath(file)}"
            )
        self.save(file)

    def to_html(self, file: str | PathLike[str]) -> None:
        """Writes the page that ``pendula simulate --view`` writes: one file with the moving picture and plots.

        The run is repeated for it, by the same steps. The page that the program writes also has the laboratory.
        """
        with plainly():
            _core.write_page(self._result, fspath(file), *places(), tell)

    def _repr_html_(self) -> str | None:
        """The page for a notebook, if the run took no more than a few seconds; else use :meth:`to_html`."""
        if not self.summary.get("wall_seconds", inf) < 5 or self.t.size == 0:
            return None
        with TemporaryDirectory() as folder:
            page = Path(folder) / "page.html"
            self.to_html(page)
            return _pictures.iframe(page.read_text(encoding="utf-8"))

    def __getstate__(self) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "run.h5"
            self.save(file)
            return {"file": file.read_bytes(), "summary": self.summary}

    def __setstate__(self, state: dict[str, Any]) -> None:
        with TemporaryDirectory() as folder:
            file = Path(folder) / "run.h5"
            file.write_bytes(state["file"])
            Solution.__init__(self, opened(file), state["summary"])

    def gradient(self, by_end: ArrayLike) -> Gradient:
        """The gradient of a number that depends on the states of the run.

        The run is repeated for it, forward and backward, by steps that end at the rows in question. The times of
        rows are held fixed, also that of an event that ended the run.

        Parameters
        ----------
        by_end : (coordinates + rates,) or (coordinates + rates, rows) array_like
            The number's gradient by the state of the last row, or by the states of all rows, in the order of ``names``.

        Returns
        -------
        Gradient
            With respect to the start, parameters and inputs.

        Raises
        ------
        InputError
            An argument is wrong, or the method's steps have no derivative.

        Examples
        --------
        >>> import pendula
        >>> run = pendula.Chain(links=1).simulate(1.0, theta=0.5, step=0.01)
        >>> by_length = run.gradient([1, 0]).parameters["lengths"]  # of theta at the end
        """
        given = numbers("by_end", by_end)
        if given.shape not in ((len(self.names),), self.y.shape):
            raise _core.InputError(
                f"by_end: expected shape ({len(self.names)},) or {self.y.shape}, got {given.shape}"
            )
        if not np.isfinite(given).all():
            raise _core.InputError("by_end: expected finite numbers, got others")
        with plainly():
            made = _core.prepare_again(self._result, *places(), tell)
        last = given.ndim == 1
        return gradient(made, made.start, self.t[-1:] if last else self.t, given[:, None] if last else given)

    @property
    def nfev(self) -> int:
        """Number of iterations on the stages of implicit steps, each an evaluation at all stages; for other methods
        the number of tried steps."""
        return int(self._told("newton_iterations") or self._told("steps") + self._told("rejected_steps"))

    @property
    def energy(self) -> NDArray[np.float64]:
        """T + U of each row, in J."""
        return self["energy"]

    @property
    def nsteps(self) -> int:
        """Number of steps."""
        return int(self._told("steps"))

    def _told(self, key: str) -> Any:
        if key not in self.summary:
            raise RuntimeError(f"{key}: expected a run that came to an end, got one that was cut off")
        return self.summary[key]

    def __repr__(self) -> str:
        rows = f"{self.t.size} rows to t = {self.t[-1]:.6g} s" if self.t.size else "no rows"
        s = self.summary
        by = "change" if self._result.loaded else "error"
        how = f", {s['steps']} steps of {s['method']}, energy {by} {s['energy_error_max']:.2g}" if s else ""
        return f"<Solution: {rows}{how}: {self.message}>"

    def plot(self, *names: str, axes: Axes | None = None, label: str | None = None) -> Axes:
        """Draws columns over time with matplotlib; without names, some coordinates.

        Columns of one unit share a panel. A run that takes no more than a few seconds is repeated, by the same steps,
        for as many points as a picture can show.

        Parameters
        ----------
        *names : str
            Columns; without an index, of all links.
        axes : matplotlib Axes, optional
            Axes to draw into, beside what is there; for columns of one unit.
        label : str, optional
            The name of this run in the legend.

        Returns
        -------
        Axes
            The panel of the first column.

        Examples
        --------
        >>> import pendula
        >>> double = pendula.Chain(links=2)
        >>> axes = double.simulate(1.0, theta=1.0).plot("theta_2", label="1")
        >>> axes = double.simulate(1.0, theta=1.1).plot("theta_2", axes=axes, label="1.1")
        >>> axes.get_ylabel(), [line.get_label() for line in axes.lines]
        ('$θ_{2}$ [rad]', ['1', '1.1'])
        """
        columns = [column for name in names for column in self._columns(name)]
        rows = self._fine_rows()
        return _pictures.plot(
            {name: rows[:, place] for name, place in self._places.items()},
            dict(zip(self.columns, self.units, strict=True)),
            columns,
            axes,
            label,
        )

    def _fine_rows(self) -> NDArray[np.float64]:
        """Rows dense enough for a picture, if a run of a few seconds gives them; else the present ones."""
        quick = self.summary.get("wall_seconds", inf) < 5
        if not quick or not 2 <= self.t.size < _pictures.POINTS or not self.t[-1] > self.t[0]:
            return self._rows
        times = np.linspace(self.t[0], self.t[-1], _pictures.POINTS)
        for more in (self.t, *self.t_events.values()):
            times = np.union1d(times, more[: _pictures.POINTS])
        try:
            rows = self._rows_at(times[(times >= self.t[0]) & (times <= self.t[-1])])
        except _core.InputError:  # the run is from a file of another build
            return self._rows
        return rows if len(rows) else self._rows

    def animate(self, *, seconds: float | None = None, fps: int = 30) -> FuncAnimation:
        """A matplotlib animation of the points, in the plane or in space, in a figure of its own.

        The run is repeated for it, by the same steps.

        Parameters
        ----------
        seconds : float, optional
            Duration of the animation; by default that of the motion.
        fps : int
            Frames a second.

        Examples
        --------
        >>> import pendula
        >>> run = pendula.Chain(links=2).simulate(1.0, theta=1.0)
        >>> run.animate(fps=10).save("double.gif")  # doctest: +SKIP
        """
        times = _pictures.frames(self.t, seconds, fps)
        return _pictures.animation(
            times, self._rows_at(times), self._result.points, self._result.units, 1000 / fps
        )

    def to_xarray(self) -> xarray.Dataset:
        """All columns by name over ``t``, with their units; columns of links are also over ``link``, from 1.

        >>> import pendula
        >>> run = pendula.Chain(links=2).simulate(1.0, theta=1.0).to_xarray()
        >>> run["theta"].dims, run["energy"].dims, run["theta"].sel(link=2).attrs["units"]
        (('t', 'link'), ('t',), 'rad')
        """
        try:
            import xarray
        except ImportError as error:
            raise missing("data", error) from None
        units = dict(zip(self.columns, self.units, strict=True))
        of_links = self._columns_of_links()
        joined = {column: stem for stem, columns in of_links.items() for column in columns}
        data: dict[str, Any] = {}
        for name in self.columns[1:]:
            stem = joined.get(name)
            if stem is None:
                data[name] = ("t", self[name], {"units": units[name]})
            elif stem not in data:
                data[stem] = (("t", "link"), self[stem].T, {"units": units[name]})
        scales: dict[str, Any] = {"t": ("t", self.t, {"units": self.units[0]})}
        if of_links:
            scales["link"] = np.arange(1, 1 + max(map(len, of_links.values())))
        return xarray.Dataset(data, coords=scales)

    def _columns_of_links(self) -> dict[str, list[str]]:
        """Columns by name without index: theta_1, theta_2, … by theta; only if there is one for each link."""
        found: dict[str, list[str]] = {}
        for name in self.columns:
            stem = re.sub(r"_\d+$", "", name)
            if stem not in self._places:
                found.setdefault(stem, []).append(name)
        whole = {
            stem: names
            for stem, names in found.items()
            if names == [f"{stem}_{k + 1}" for k in range(len(names))]
        }
        links = max(map(len, whole.values()), default=0)
        return {stem: names for stem, names in whole.items() if len(names) == links}


def concluded(
    result: _core.Result, names: Mapping[str, str] | None = None, in_file: bool = False
) -> Solution:
    """The solution of a run; issues its warnings at the caller's caller. Raises RunFailed."""
    solution = Solution(result)
    warn(solution.summary["warnings"], 4, names, in_file)
    if solution.status < 0:
        raise RunFailed(solution.message, solution)
    return solution


def opened(file: str | PathLike[str]) -> _core.Result:
    with plainly():
        return _core.open(fspath(file), *places(), tell)


def open(file: str | PathLike[str]) -> Solution:
    """Reads the solution in a run file, from :meth:`Solution.save` or ``pendula simulate -o run.h5``.

    A run that was interrupted, or is still running, has the rows so far, ``status`` -1 and an empty ``summary``.

    Raises
    ------
    InputError
        The file is no run file, or it is damaged.

    Examples
    --------
    >>> import pathlib, pendula, tempfile
    >>> run = pendula.Chain(links=2).simulate(1.0, theta=1.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run.save(pathlib.Path(folder) / "run.h5")
    ...     again = pendula.open(pathlib.Path(folder) / "run.h5")
    >>> bool((again.y == run.y).all()), again.success
    (True, True)
    """
    return Solution(opened(file))
