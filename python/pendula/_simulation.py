"""Step by step: simulations, linearizations, Lyapunov exponents and ensembles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _core, _toml
from ._runs import places, plainly, tell

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike, NDArray

    from ._systems import System

RUN_OPTIONS = ("method", "stages", "form", "solver", "iteration")


def _options(tolerance: float | None, step: float | None, options: Mapping[str, object]) -> dict[str, object]:
    if step is None and tolerance is None:
        tolerance = 1e-9
    return {"duration": 1.0, "step": step, "tolerance": tolerance, **options}


def _prepare(
    system: System, start: Mapping[str, object], run: Mapping[str, object]
) -> tuple[str, _core.Prepared]:
    text = _toml.document({**system.tables(), "start": dict(start), "run": run})
    return text, _prepared(text)


def _prepared(text: str) -> _core.Prepared:
    with plainly():
        return _core.prepare(text, *places(), tell)


def _split(
    system_starts: Mapping[str, object], options: Mapping[str, object]
) -> tuple[dict[str, object], dict[str, object]]:
    runs = {name: one for name, one in options.items() if name in RUN_OPTIONS}
    starts = {**system_starts, **{name: one for name, one in options.items() if name not in RUN_OPTIONS}}
    return starts, runs


class Simulation:
    """A motion that goes on as far as it is asked to.

    Parameters
    ----------
    system : Chain or Model
    start : mapping, optional
        As for :meth:`Chain.simulate`.
    tolerance, step : float, optional
        Steps of its own choice, to a tolerance of 1e-9 unless told otherwise; or constant ones, in s.
    method, stages, form, solver, iteration
        As ``[run]`` of a scenario.

    Notes
    -----
    Copies and pickles go on as the first does, to the bit.

    Examples
    --------
    >>> import pendula
    >>> cart = pendula.Simulation(pendula.Model("cart_chain"), {"theta": 0.1}, tolerance=1e-9)
    >>> cart.step(0.5, push=2.0).time
    0.5
    """

    def __init__(
        self,
        system: System,
        start: Mapping[str, object] | None = None,
        *,
        tolerance: float | None = None,
        step: float | None = None,
        **options: object,
    ) -> None:
        starts, runs = _split(start or {}, options)
        self._text, self._made = _prepare(system, starts, _options(tolerance, step, runs))
        with plainly():
            self._core = _core.Simulation(self._made)

    @property
    def time(self) -> float:
        """In s."""
        return self._core.time

    @property
    def steps(self) -> int:
        """Steps that were taken."""
        return self._core.steps

    @property
    def state(self) -> NDArray[np.float64]:
        """Coordinates, then their rates."""
        return self._core.state

    @property
    def inputs(self) -> dict[str, float]:
        """What is held, by name."""
        return dict(zip(self._made.inputs, self._core.held.tolist(), strict=True))

    @property
    def columns(self) -> list[str]:
        """Names that ``simulation[name]`` knows."""
        return self._made.columns

    def __getitem__(self, column: str) -> float:
        """A number of the row where it is: ``simulation["x_2"]``, ``simulation["energy"]``."""
        with plainly():
            return self._core.number(column)

    def hold(self, **inputs: float) -> Simulation:
        """Holds inputs from now on, until others are held."""
        with plainly():
            for name, value in inputs.items():
                self._core.hold(name, float(value))
        return self

    def advance_to(self, time: float) -> Simulation:
        """Goes on to ``time``, in s, where a step ends."""
        with plainly():
            self._core.advance_to(float(time))
        return self

    def step(self, duration: float, **inputs: float) -> Simulation:
        """Holds inputs, and goes on by ``duration``, in s: a zero-order hold, with steps chosen inside."""
        return self.hold(**inputs).advance_to(self.time + duration)

    def at(self, time: float) -> NDArray[np.float64]:
        """The state at any time since the start, at the full order of the method."""
        with plainly():
            return self._core.at(float(time))

    def linearize(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A and B of d(q, v)/dt = A (q, v) + B inputs beside where it is, exactly."""
        with plainly():
            return self._core.linearize()

    def copy(self) -> Simulation:
        """One that goes on as this one does, to the bit."""
        other = Simulation.__new__(Simulation)
        other._text, other._made, other._core = self._text, self._made, self._core.copy()
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: object) -> Simulation:
        return self.copy()

    def __getstate__(self) -> dict[str, object]:
        return {"text": self._text, "saved": self._core.save()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._text = state["text"]
        self._made = _prepared(self._text)
        self._core = _core.Simulation(self._made)
        self._core.resume(np.ascontiguousarray(state["saved"], dtype=float))

    def __repr__(self) -> str:
        return f"<Simulation: t = {self.time:.6g} s after {self.steps} steps>"


def linearize(
    system: System, at: Mapping[str, object] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The linear system beside a state, exactly.

    Parameters
    ----------
    system : Chain or Model
    at : mapping, optional
        Coordinates and rates, as for :meth:`Chain.simulate`; left out, all are 0.

    Returns
    -------
    A : (2n, 2n) array
    B : (2n, inputs) array
        d(q, v)/dt = A (q, v) + B inputs, of deviations from the state.
    """
    return Simulation(system, {**system.at_zero(), **(at or {})}).linearize()


class Lyapunov(NamedTuple):
    """Lyapunov exponents of a motion, in 1/s."""

    exponents: NDArray[np.float64]  #: descending
    errors: NDArray[np.float64]  #: infinite where the run was too short to tell
    sum: float  #: of all of them the mean divergence
    duration: float  #: that was run, in s
    ftle: float  #: finite-time exponent of one tangent
    megno: float  #: 2 where motion is regular


def lyapunov(
    system: System,
    duration: float = 1000.0,
    *,
    count: int = 0,
    start: Mapping[str, object] | None = None,
    tolerance: float | None = None,
    step: float | None = None,
    **starts: object,
) -> Lyapunov:
    """The leading Lyapunov exponents, by the exact derivatives of the steps; ``count`` of them, 0: all.

    >>> import pendula
    >>> pendula.lyapunov(pendula.Chain(links=1), 20.0, theta=0.5, step=0.02).exponents.shape
    (2,)
    """
    given, runs = _split(start or {}, starts)
    _, made = _prepare(system, given, _options(tolerance, step, runs))
    with plainly():
        return Lyapunov(*_core.lyapunov(made, float(duration), count))


def ensemble(
    system: System,
    duration: float,
    start: Mapping[str, ArrayLike],
    *,
    tolerance: float | None = None,
    step: float | None = None,
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
        Coordinates and rates by name. An array is (members,), of a chain (members, links); a single number is that of
        all members. What is left out is 0.
    tolerance, step : float, optional
        As for :class:`Simulation`.
    threads : int
        0: as many as there are processors.

    Returns
    -------
    xarray.Dataset
        Where each member ends, by the names of columns over ``member``, with ``status`` (0: ok, 2: stopped, 3: failed)
        and ``energy_error``, relative.

    Examples
    --------
    >>> import numpy, pendula
    >>> double = pendula.Chain(masses=[1, 1])
    >>> ends = pendula.ensemble(double, 1.0, {"theta": numpy.linspace(0, 1, 12).reshape(6, 2)})
    >>> ends["theta_2"].shape
    (6,)
    """
    import xarray

    unknown = set(options) - set(RUN_OPTIONS)
    if unknown:
        raise TypeError(f"ensemble: expected the options of a run, got {', '.join(sorted(unknown))}")
    _, made = _prepare(system, system.at_zero(), _options(tolerance, step, options))
    names = made.columns[1 : 1 + 2 * made.coordinates]
    columns: dict[str, NDArray[np.float64]] = {}
    for name, given in start.items():
        for column, values in _columns_of(name, np.asarray(given, dtype=float), names):
            if column in columns:
                raise ValueError(f"start: {column} is given twice")
            columns[column] = values
    sizes = {values.size for values in columns.values() if values.ndim > 0}
    if len(sizes) > 1:
        raise ValueError(f"start: expected as many members of each, got {', '.join(map(str, sorted(sizes)))}")
    members = sizes.pop() if sizes else 1
    order = _state_order(names)
    starts = np.zeros((members, len(names)))
    for column, values in columns.items():
        if not np.isfinite(values).all():
            raise ValueError(
                f"start: expected finite numbers for {column}, got {values[~np.isfinite(values)][0]}"
            )
        starts[:, order.index(column)] = values
    with plainly():
        q, v, how, errors = _core.propagate(made, starts, float(duration), threads)
    ends = np.hstack([q, v])
    data: dict[str, Any] = {name: ("member", ends[:, k]) for k, name in enumerate(order)}
    data["status"] = ("member", np.array(how))
    data["energy_error"] = ("member", errors)
    return xarray.Dataset(data)


def _state_order(names: Sequence[str]) -> list[str]:
    """Columns of a file are link by link; the state has coordinate by coordinate, then rates."""
    rates = [name for name in names if _is_rate(name)]
    places = [name for name in names if not _is_rate(name)]

    def by_coordinate(some: list[str]) -> list[str]:
        stems: list[str] = []
        for name in some:
            if _stem(name) not in stems:
                stems.append(_stem(name))
        return sorted(some, key=lambda name: (stems.index(_stem(name)), some.index(name)))

    return by_coordinate(places) + by_coordinate(rates)


def _stem(name: str) -> str:
    stem, _, index = name.rpartition("_")
    return stem if index.isdigit() else name


def _is_rate(name: str) -> bool:
    return _stem(name).endswith("_dot")


def _columns_of(
    name: str, values: NDArray[np.float64], names: Sequence[str]
) -> list[tuple[str, NDArray[np.float64]]]:
    if name in names:
        if values.ndim > 1:
            raise ValueError(f"start: expected a number or (members,) for {name}, got shape {values.shape}")
        return [(name, values)]
    links = [column for column in names if _stem(column) == name and column != name]
    if not links:
        raise ValueError(f"start: expected one of {', '.join(names)}, got {name}")
    if values.ndim == 0 or (len(links) == 1 and values.ndim == 1):
        return [(column, values) for column in links]
    if values.ndim != 2 or values.shape[1] != len(links):
        raise ValueError(f"start: expected (members, {len(links)}) for {name}, got shape {values.shape}")
    return [(column, values[:, k]) for k, column in enumerate(links)]
