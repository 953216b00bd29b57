"""What moves: chains, models, scenarios."""

from __future__ import annotations

import copy
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _toml
from ._core import InputError
from ._runs import Solution, mapping, merged, number, numbers, run_text

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike, NDArray

Tables = dict[str, "dict[str, object] | list[dict[str, object]]"]


def _drives(given: object) -> list[dict[str, object]]:
    if isinstance(given, (str, Mapping)) or not isinstance(given, Sequence):
        raise InputError(f"drives: expected a sequence of mappings, got {type(given).__name__}")
    drives = [mapping(f"drives[{k}]", drive) for k, drive in enumerate(given)]
    return copy.deepcopy(drives)


def event_tables(events: object) -> list[dict[str, object]]:
    """Events as a scenario has them: expressions, or mappings with ``when``, by name."""
    return [
        {"name": name, **({"when": event} if isinstance(event, str) else mapping(f"events.{name}", event))}
        for name, event in mapping("events", events).items()
    ]


class System(ABC):
    """What chains and models have in common: how they are run."""

    @abstractmethod
    def tables(self) -> Tables:
        """Those of a scenario that say what moves."""

    def at_zero(self) -> dict[str, object]:
        """The start where all coordinates are 0."""
        return {}

    def model_file(self) -> Path | None:
        """The file that says what moves, if one does."""
        return None

    @abstractmethod
    def replaced(
        self, parameters: Mapping[str, NDArray[np.float64]], inputs: Mapping[str, NDArray[np.float64]]
    ) -> System:
        """The same system with other values of parameters, and of what is constant of inputs."""

    def simulate(
        self,
        duration: float | None = None,
        *,
        t: ArrayLike | None = None,
        start: Mapping[str, object] | None = None,
        events: Mapping[str, str | Mapping[str, object]] | None = None,
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
        **starts: object,
    ) -> Solution:
        """Moves the system from a start.

        Parameters
        ----------
        duration : float, optional
            How long, in s. Left out, the last of the times ``t``.
        t : array_like, optional
            Times of the rows, in s, increasing from 0 on. Left out, there is a row every ``every`` steps, or every
            ``interval`` seconds.
        start : mapping, optional
            Coordinates and rates at the start by name, as keyword arguments: ``theta="90 deg"``, ``theta_dot=[0, 1]``.
            A single number of a chain stands for every link; rates are 0 unless given.
        events : mapping, optional
            Expressions of the columns that change their sign where an event happens, by name:
            ``{"flip": "abs(theta_2) - pi"}``, or mappings with ``when``, ``direction`` ("up", "down", "both") and
            ``stop``.
        method, stages, form, solver, iteration, step, tolerance, accuracy, estimate
            As ``[run]`` of a scenario (``pendula help scenario``). Steps are chosen for an accuracy of 1e-9 unless one
            of ``accuracy``, ``tolerance`` and ``step`` says otherwise.

        Returns
        -------
        Solution

        Raises
        ------
        InputError
            An argument is wrong; the message names it, what was expected and what was got.
        RunFailed
            The computation failed; ``partial`` is the solution up to there.

        Warns
        -----
        TrustWarning
            How far the rows can be trusted, where that is less than was asked for.
        """
        times = None if t is None else numbers("t", t)
        if times is not None and (times.ndim != 1 or times.size == 0):
            raise InputError(f"t: expected a vector of times, got an array of shape {times.shape}")
        if duration is None:
            if times is None:
                raise TypeError("simulate: expected duration= or t=, got neither")
            duration = float(times[-1])
        if step is None and tolerance is None and accuracy is None:
            accuracy = 1e-9
        tables = self.tables()
        tables["start"] = merged("start", start, starts)
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
        if times is None and every is None and interval is None:
            every = 1
        tables["output"] = {
            "every": every,
            "interval": interval,
            "times": None if times is None else times.tolist(),
        }
        tables["event"] = event_tables(events)
        return run_text(_toml.document(tables))


class Chain(System):
    """A chain of rods with a bob at the end of each, in the plane or in space.

    Parameters
    ----------
    masses, lengths : float or array_like
        Of each link, in kg and m; a single number stands for every link.
    space : {"planar", "spatial"}
    links : int, optional
        Needed where no array tells it.
    gravity : float
        In m/s².
    damping, torque : float or array_like, optional
        Of each link, in N m s and N m.
    drives : sequence of mappings, optional
        Torques that depend on time: ``link``, ``amplitude``, ``frequency``, ``phase``.
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
        units: str | None = None,
    ) -> None:
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
        self._drives = _drives(drives)

    def __repr__(self) -> str:
        given = ", ".join(f"{key}={one!r}" for key, one in self._numbers.items() if one is not None)
        return f"Chain({given})"

    def tables(self) -> Tables:
        return {"chain": dict(self._numbers), "chain.drive": list(self._drives)}

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

    def at_zero(self) -> dict[str, object]:
        return {"theta": 0.0, "phi": 0.0} if self._numbers["space"] == "spatial" else {"theta": 0.0}


class Model(System):
    """Any other mechanical system: a built-in model by its name, or a model file.

    Parameters
    ----------
    model : str or path
        ``"furuta"`` (``pendula models`` lists them), or a file that defines ``define(model, links)``.
    links : int, optional
        Of models with as many links as asked for.
    inputs : mapping, optional
        Constant values of inputs, by name.
    drives : sequence of mappings, optional
        Inputs that depend on time: ``input``, ``amplitude``, ``frequency``, ``phase``, ``constant``.
    parameters
        By name; the model has defaults.
    """

    def __init__(
        self,
        model: str | PathLike[str],
        links: int | None = None,
        *,
        inputs: Mapping[str, float] | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        **parameters: object,
    ) -> None:
        name = str(model)
        self._name = str(Path(name).resolve()) if name.endswith(".py") else name
        self._links = links
        self._parameters = copy.deepcopy(parameters)
        self._drives = [
            {"input": key, "constant": number(f"inputs.{key}", one)}
            for key, one in mapping("inputs", inputs).items()
        ]
        self._drives += _drives(drives)

    def __repr__(self) -> str:
        return f"Model({self._name!r})"

    def model_file(self) -> Path | None:
        return Path(self._name) if self._name.endswith(".py") else None

    def replaced(
        self, parameters: Mapping[str, NDArray[np.float64]], inputs: Mapping[str, NDArray[np.float64]]
    ) -> Model:
        other = copy.copy(self)
        sizes = {name: float(one[0]) if one.size == 1 else one for name, one in parameters.items()}
        other._parameters = {**self._parameters, **sizes}
        others = [
            {**drive, "constant": 0.0} if drive.get("input") in inputs else drive for drive in self._drives
        ]
        other._drives = others + [{"input": name, "constant": float(one[0])} for name, one in inputs.items()]
        return other

    def tables(self) -> Tables:
        system: dict[str, object] = {
            "model": self._name,
            "links": self._links,
            "parameters": self._parameters or None,
        }
        return {"system": system, "system.drive": list(self._drives)}


class Scenario:
    """A scenario file, as the command line runs it.

    Parameters
    ----------
    file : path
    set : mapping, optional
        Keys to replace, ``{"run.step": 1e-4}``.
    """

    def __init__(self, file: str | PathLike[str], set: Mapping[str, object] | None = None) -> None:
        self.file = Path(file)
        self._overrides = []
        for key, one in mapping("set", set).items():
            if not re.fullmatch(r"[A-Za-z_][\w.\[\]]*", key):
                raise InputError(f"set: expected a key of a scenario, such as run.step, got {key!r}")
            self._overrides.append(f"{key}={_toml.value(one, key)}")

    def __repr__(self) -> str:
        return f"Scenario({str(self.file)!r})"

    def run(self) -> Solution:
        """Runs it; as :meth:`Chain.simulate`, and to the bit as ``pendula simulate``."""
        return run_text(self.file.read_text(encoding="utf-8"), str(self.file), self._overrides)

    def ensemble(
        self,
        *,
        threads: int = 0,
        file: str | PathLike[str] | None = None,
        shard: tuple[int, int] | None = None,
        resume: bool = False,
        client: Any = None,
        progress: bool = False,
    ) -> xarray.Dataset:
        """Moves all members of a scenario with ``[ensemble]``; as :func:`ensemble`, and to the bit as ``pendula
        ensemble``."""
        from ._ensemble import move_members

        return move_members(
            self.file.read_text(encoding="utf-8"),
            str(self.file),
            self._overrides,
            threads=threads,
            file=file,
            shard=shard,
            resume=resume,
            client=client,
            progress=progress,
        )
