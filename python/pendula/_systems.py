"""Systems: their common base class, and chains."""

from __future__ import annotations

import copy
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Never

import numpy as np

from . import _core, _toml
from ._core import InputError
from ._events import events_of
from ._inputs import Signals, inputs_of
from ._progress import bar
from ._runs import mapping, merged, numbers, places, plainly, state_names, tell, unknown
from ._solution import Solution, concluded

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._events import Event

Tables = dict[str, "dict[str, object] | list[dict[str, object]]"]


def tables_of(name: str, given: object) -> list[dict[str, object]]:
    """A sequence of mappings, as ``drives`` and ``feedback`` are."""
    if isinstance(given, (str, Mapping)) or not isinstance(given, Sequence):
        raise InputError(f"{name}: expected a sequence of mappings, got {type(given).__name__}")
    return copy.deepcopy([mapping(f"{name}[{k}]", one) for k, one in enumerate(given)])


def system_of(given: object) -> System:
    """A system. Raises InputError for anything else; for a result of ``pendula.model`` it says how to make one."""
    if isinstance(given, System):
        return given
    name, kind = getattr(given, "__name__", None), type(given).__name__
    got = f"the function {name}: {name}() is a Model" if kind == "ModelFunction" else kind
    raise InputError(f"system: expected a Chain or a Model, got {got}")


def times_of(given: object) -> NDArray[np.float64]:
    """Times of rows. Raises InputError."""
    times = numbers("t", given)
    if times.ndim != 1 or times.size == 0:
        raise InputError(f"t: expected a vector of times, got an array of shape {times.shape}")
    return times


def ascending_times(given: object) -> NDArray[np.float64]:
    """Times from 0 on. Raises InputError."""
    times = times_of(given)
    if not np.isfinite(times).all() or times[0] < 0 or np.any(np.diff(times) < 0):
        raise InputError(f"t: expected a vector of times from 0 on, ascending, got {given!r}")
    return times


def span_of(where: str, duration: Any, t: object) -> tuple[NDArray[np.float64] | None, Any]:
    """Times of rows, if given, and a duration, by default the last of these times."""
    times = None if t is None else times_of(t)
    if duration is None and times is None:
        raise TypeError(f"{where}: expected duration= or t=, got neither")
    return times, float(times[-1]) if duration is None and times is not None else duration


def starts_of(
    where: str,
    system: System,
    start: object,
    more: Mapping[str, object],
    options: Iterable[str] = (),
) -> dict[str, Any]:
    """A start from a mapping, keywords, or both. Raises InputError for other keywords; ``options`` are further keywords
    that may have been meant."""
    if more:
        known = system_of(system).start_names()
        for name in more:
            if (
                re.sub(r"(_\d+)_dot$", r"_dot\1", name) not in known
            ):  # the present name for an older one, theta_1_dot
                raise unknown(where, name, [*known, *options])
    return merged("start", start, more)


class System(ABC):
    """The common base class of chains and models, which runs them.

    Systems are equal if they are of the same kind and have the same numbers.
    """

    _signals: Signals

    @abstractmethod
    def tables(self) -> Tables:
        """The tables of a scenario for this system."""

    @property
    @abstractmethod
    def coordinates(self) -> list[str]:
        """Names of the coordinates."""

    @property
    @abstractmethod
    def inputs(self) -> list[str]:
        """Names of the inputs."""

    @property
    @abstractmethod
    def parameters(self) -> dict[str, object]:
        """Parameters by name."""

    @property
    def units(self) -> dict[str, str]:
        """Units of coordinates, rates, inputs and parameters, by name."""
        known = self._info.units
        return {
            name: known[name] for name in (*self.coordinates, *self.rates, *self.inputs, *self.parameters)
        }

    @cached_property
    @abstractmethod
    def _info(self) -> _core.Prepared | _core.ModelInfo:
        """The description of the system by the program."""

    @property
    @abstractmethod
    def rates(self) -> list[str]:
        """Names of the rates of the coordinates."""

    @abstractmethod
    def start_names(self) -> list[str]:
        """Names that a start may have."""

    def _require_right(self, tables: Tables, names: Mapping[str, str] | None = None) -> None:
        """Raises InputError for wrong arguments, when they are given, not when the system moves."""
        text = _toml.document({**tables, "start": self.at_zero(), "run": {"duration": 1.0}})
        try:
            with plainly(names):
                _core.check(text, *places(), tell)
        except InputError as error:
            if not str(error).startswith("start:"):  # a system may be singular where all coordinates are 0
                raise

    def _tables_over_time(self) -> dict[str, str]:
        """Names of signals as arguments."""
        return {f"signal[{k + 1}]": f"inputs.{name}" for k, name in enumerate(self._signals)}

    def __getstate__(self) -> dict[str, Any]:
        """The state without cached values: for pickles, and for copies, which get other numbers."""
        return {name: one for name, one in vars(self).items() if name != "_info"}

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other._told == self._told

    def __hash__(self) -> int:
        return hash(self._told)

    @property
    def _told(self) -> str:
        return _toml.document(self.tables())

    def at_zero(self) -> dict[str, object]:
        """The start where all coordinates are 0."""
        return {}

    def model_file(self) -> Path | None:
        """The file of the model, if there is one."""
        return None

    @abstractmethod
    def replaced(
        self, parameters: Mapping[str, NDArray[np.float64]], inputs: Mapping[str, NDArray[np.float64]]
    ) -> System:
        """The same system with other parameters and constant parts of inputs."""

    @abstractmethod
    def unforced(self) -> System:
        """The same without constant parts of inputs."""

    @abstractmethod
    def held(self, inputs: Mapping[str, object]) -> System:
        """The same with these inputs, in place of its own. Raises InputError."""

    def simulate(
        self,
        duration: float | str | None = None,
        start: Mapping[str, object] | None = None,
        *,
        t: ArrayLike | None = None,
        inputs: Mapping[str, object] | None = None,
        events: Mapping[str, Event] | None = None,
        method: str | None = None,
        stages: int | None = None,
        form: str | None = None,
        solver: str | None = None,
        iteration: str | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        accuracy: float | None = None,
        estimate: bool | None = None,
        every: int | None = None,
        interval: float | None = None,
        columns: Mapping[str, str] | None = None,
        progress: bool | None = None,
        **starts: object,
    ) -> Solution:
        """Moves the system from a start.

        Parameters
        ----------
        duration : float, optional
            In s, or as a text ``"1 min"``. By default the last of the times ``t``.
        t : array_like, optional
            Times of the rows, in s, increasing from 0 on. By default there is a row every ``every`` steps, or every
            ``interval`` seconds; without these, some hundreds or a few thousand evenly in time, and the last state.
        start : mapping, optional
            Coordinates and rates at the start by name, as keyword arguments: ``theta="90 deg"``, ``theta_dot=[0, 1]``.
            A single number of a chain stands for every link; rates are 0 unless given. Of a model with constraints
            what is not given is found; ``assemble=["theta_2", "theta_3"]`` lists what is found instead.
        events : mapping, optional
            Expressions of the columns that change their sign where an event happens, by name:
            ``{"flip": "abs(theta_2) - pi"}``, or mappings with ``when``, ``direction`` ("up", "down", "both") and
            ``stop``. They are located on the motion within each step. A function of the time and the state, as SciPy
            has it (with its attributes ``terminal`` and ``direction``), is only called at a fixed number of times in
            each step: if its sign changes twice between two of them, both changes are missed.
        inputs : mapping, optional
            Values of inputs, in place of the system's own: numbers, which are held, or tables of numbers over time, as
            for :class:`Model`: ``{"push": (times, values)}``. For a chain only tables of ``torque_1`` ….
        method, stages, form, solver, iteration, step, tolerance, accuracy, estimate
            As ``[run]`` of a scenario (``pendula help scenario``). Without ``accuracy``, ``tolerance`` and ``step``,
            steps are chosen for an accuracy of 1e-9.

        columns : mapping, optional
            Expressions of the columns as further columns, by name: ``{"height": "1 - cos(theta_1)"}``.
        progress : bool, optional
            Whether a bar (of tqdm) is shown for a run of more than a second; by default on terminals and in notebooks.

        Returns
        -------
        Solution

        Raises
        ------
        InputError
            An argument is wrong; the message names it, and says what was expected and what was given.
        RunFailed
            The computation failed; ``partial`` is the solution up to there.

        Warns
        -----
        TrustWarning
            The rows are less accurate than was asked for; the message says by how much.
        """
        begin = starts_of("simulate", self, start, starts, System.simulate.__kwdefaults__ or ())
        times, duration = span_of("simulate", duration, t)
        if step is None and tolerance is None and accuracy is None:
            accuracy = 1e-9
        system = self.held(mapping("inputs", inputs))
        tables = system.tables()
        tables["start"] = begin
        tables["run"] = {
            "duration": duration,
            "method": method,
            "stages": stages,
            "form": form,
            "solver": solver,
            "iteration": iteration,
            "step": step,
            "tolerance": tolerance,
            "accuracy": accuracy,
            "estimate": estimate,
        }
        tables["output"] = {
            "every": every,
            "interval": interval,
            "times": None if times is None else times.tolist(),
            "columns": mapping("columns", columns) or None,
        }
        expressions, functions = events_of(events)
        tables["event"] = expressions
        names = {f"event[{k + 1}]": f"events.{one['name']}" for k, one in enumerate(expressions)}
        names |= system._tables_over_time()
        text = _toml.document(tables)
        with bar(duration, progress) as told, plainly(names):
            result = _core.simulate(text, "pendula", [], functions, told, *places(), tell)
        return concluded(result, names)


def _depth(given: object) -> int:
    """Number of axes of an array; 1 for a ragged list."""
    try:
        return np.ndim(given)  # type: ignore[arg-type]
    except ValueError:
        return 1


class Chain(System):
    """A chain of rods with a bob at the end of each, in the plane or in space.

    Parameters
    ----------
    masses, lengths : float or array_like
        Of each link, in kg and m; a single number stands for every link.
    space : {"planar", "spatial"}
    links : int, optional
        Needed if no array has the number of links.
    gravity : float
        In m/s².
    damping, torque : float or array_like, optional
        Of each link, in N m s and N m.
    drives : sequence of mappings, optional
        Torques that depend on time: ``link``, ``amplitude``, ``frequency``, ``phase``.
    feedback : sequence of mappings, optional
        Torques that follow from the motion: ``input`` ("torque_1"), ``value`` (an expression of the columns),
        ``sample`` (s), ``limit``. They are held from sample to sample.
    end : mapping, optional
        What holds the last bob: ``{"at": [1.2, 0.0]}``, in m from the pivot, or ``{"ring": True}``, the pivot itself.
        ``amplitude``, ``frequency``, ``phase`` by axis for a hook that moves. Without it the last bob hangs free.
        A start ``shape="hanging"`` needs no angles, then.
    units : {"SI", "natural"}
    """

    def __init__(
        self,
        masses: ArrayLike = 1.0,
        lengths: ArrayLike = 1.0,
        *,
        space: str = "planar",
        links: int | None = None,
        gravity: float = 9.81,
        damping: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        feedback: Sequence[Mapping[str, object]] = (),
        end: Mapping[str, object] | None = None,
        units: str | None = None,
        **others: Never,
    ) -> None:
        for name in others:
            raise unknown("Chain", name, ["masses", "lengths", *(Chain.__init__.__kwdefaults__ or ())])
        self._numbers: dict[str, object] = copy.deepcopy(
            {
                "space": space,
                "links": links,
                "masses": masses,
                "lengths": lengths,
                "gravity": gravity,
                "damping": damping,
                "torque": torque,
                "units": units,
            }
        )
        self._end = None if end is None else copy.deepcopy(mapping("end", end))
        self._drives = tables_of("drives", drives)
        self._feedback = tables_of("feedback", feedback)
        self._signals: Signals = {}
        if self._tells_links():
            self._require_right(self._without("chain.end"))  # where it is, a start at zero does not close
        else:  # a start will tell the number of links
            self._require_right({"chain": {**self._numbers, "links": 1}})

    def _tells_links(self) -> bool:
        depth = {
            "masses": 1,
            "lengths": 1,
            "damping": 1,
            "torque": 2 if self._numbers["space"] == "spatial" else 1,
        }
        arrays = (_depth(self._numbers[key]) >= least for key, least in depth.items())
        return self._numbers["links"] is not None or any(arrays)

    def __repr__(self) -> str:
        given = {**self._numbers, "drives": self._drives, "feedback": self._feedback, "end": self._end}
        told = ", ".join(f"{key}={one!r}" for key, one in given.items() if one is not None and one != [])
        return f"Chain({told})"

    @cached_property
    def _info(self) -> _core.Prepared:
        tables = self._without("chain.feedback", "chain.end")
        text = _toml.document({**tables, "start": self.at_zero(), "run": {"duration": 1.0}})
        with plainly():
            return _core.prepare(text, "pendula", [], *places(), tell)

    @property
    def links(self) -> int:
        """Number of links. Raises InputError, as all that follows, if only a start would tell it."""
        return len(self.coordinates) // (2 if self._numbers["space"] == "spatial" else 1)

    @property
    def masses(self) -> NDArray[np.float64]:
        """Masses of the links, in kg."""
        return self._per_link("masses")

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Lengths of the links, in m."""
        return self._per_link("lengths")

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates: all theta, then all phi."""
        names = state_names(self._info)
        return names[: len(names) // 2]

    @property
    def rates(self) -> list[str]:
        """Names of their rates."""
        names = state_names(self._info)
        return names[len(names) // 2 :]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs: torques."""
        return self._info.inputs

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters by name; those of links are arrays."""
        return {
            "gravity": self._numbers["gravity"],
            **{name: self._per_link(name) for name in ("masses", "lengths", "damping")},
        }

    def _per_link(self, name: str) -> NDArray[np.float64]:
        given = self._numbers[name]
        if any(isinstance(one, str) for one in np.ravel(np.asarray(given, dtype=object))):  # with units
            given = self._info.constants[name]
        return np.array(np.broadcast_to(numbers(name, 0.0 if given is None else given), self.links))

    @property
    def _told(self) -> str:
        tables = self.tables()
        if self._tells_links():
            tables["chain"] = {**self._numbers, **self.parameters, "links": None}
        return _toml.document(tables)

    def _without(self, *names: str) -> Tables:
        return {key: one for key, one in self.tables().items() if key not in names}

    def start_names(self) -> list[str]:
        shape = [] if self._end is None else ["shape"]
        return shape + [
            form.format(angle)
            for form in ("{}", "{}_dot", "p_{}")
            for angle in (("theta", "phi") if self._numbers["space"] == "spatial" else ("theta",))
        ]

    def tables(self) -> Tables:
        end: Tables = {} if self._end is None else {"chain.end": dict(self._end)}
        return {
            "chain": dict(self._numbers),
            **end,
            "chain.drive": list(self._drives),
            "chain.feedback": list(self._feedback),
            "chain.signal": list(self._signals.values()),
        }

    def held(self, inputs: Mapping[str, object]) -> Chain:
        numbers, signals = inputs_of(inputs)
        if numbers:
            raise InputError(
                f"inputs: expected tables over time of a chain, which has torque for numbers, got {', '.join(numbers)}"
            )
        other = copy.copy(self)
        other._signals = signals
        return other

    def replaced(
        self, parameters: Mapping[str, NDArray[np.float64]], inputs: Mapping[str, NDArray[np.float64]]
    ) -> Chain:
        other = copy.copy(self)
        other._numbers = {
            **self._numbers,
            **{name: float(one[0]) if name == "gravity" else one for name, one in parameters.items()},
        }
        if "torque" in inputs:
            per_link = (-1, 3) if self._numbers["space"] == "spatial" else (-1,)
            other._numbers["torque"] = inputs["torque"].reshape(per_link)
        return other

    def unforced(self) -> Chain:
        other = copy.copy(self)
        other._numbers = {**self._numbers, "torque": None}
        return other

    def at_zero(self) -> dict[str, object]:
        return {"theta": 0.0, "phi": 0.0} if self._numbers["space"] == "spatial" else {"theta": 0.0}
