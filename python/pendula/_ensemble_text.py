"""Ensembles as scenarios: the numbers of their members."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _toml
from ._core import InputError
from ._runs import columns_of, has_texts, numbers, require_known
from ._systems import Chain, System

if TYPE_CHECKING:
    from numpy.typing import NDArray

DRAWN = {"normal": ("mean", "deviation"), "uniform": ("from", "to")}


class Design:
    """The numbers that all members of a system share, and those that each has for itself."""

    def __init__(self, system: System) -> None:
        self._system = system
        coordinates = system.coordinates
        self._columns = [*coordinates, *system.rates, *(f"p_{name}" for name in coordinates)]
        self._fixed: dict[str, object] = {}
        self._axes: dict[str, NDArray[np.float64]] = {}
        self._lists: dict[str, NDArray[np.float64]] = {}
        self._drawn: dict[str, Sequence[object]] = {}
        self._families = dict.fromkeys(system.at_zero())  # of a chain's start: theta, phi, ...

    def add_start(self, start: Mapping[str, object]) -> None:
        """Adds a start. Tuples are axes of a grid, arrays have an entry for each member, others hold for all."""
        for name, given in start.items():
            for column, one in self._columns_of(name, given):
                self._add(column, one, is_axis=isinstance(given, tuple))
        sizes = {one.size for one in self._lists.values()}
        if len(sizes) > 1:
            told = ", ".join(map(str, sorted(sizes)))
            raise InputError(f"start: expected as many members of each, got {told}")

    def add_axes(self, axes: Mapping[str, object]) -> None:
        for key, given in axes.items():
            if key in self._axes:
                raise InputError(f"axes: {key} is given twice")
            self._axes[key] = _values(f"axes: {key}", given)

    def add_random(self, random: Mapping[str, object]) -> None:
        for key, given in random.items():
            expected = f'random: expected ("normal", mean, deviation) or ("uniform", from, to) for {key}'
            if not isinstance(given, Sequence) or len(given) != 3 or str(given[0]) not in DRAWN:
                raise InputError(f"{expected}, got {given!r}")
            self._drawn[key] = given

    def tables(self) -> dict[str, Any]:
        """The tables of a scenario for the system, its start, and the numbers of members."""
        of_each = bool(self._lists or self._drawn)
        if bool(self._axes) == of_each:
            raise InputError(
                "ensemble: expected axes of a grid, or numbers of each member (arrays of starts, random keys), got "
                + ("both" if of_each else "neither")
            )
        tables: dict[str, Any] = {**self._system.tables(), "start": self._start()}
        keys = [*self._axes, *self._drawn]
        if isinstance(self._system, Chain):
            for key in keys:
                self._write_as_array(tables, key)
        tables["ensemble.axis"] = [{"key": key, "values": values} for key, values in self._axes.items()]
        tables["ensemble.random"] = [
            {"key": key, **dict(zip(DRAWN[str(given[0])], given[1:], strict=True))}
            for key, given in self._drawn.items()
        ]
        tables["ensemble.list"] = [{"key": key, "values": values} for key, values in self._lists.items()]
        return tables

    def _add(self, column: str, given: object, is_axis: bool) -> None:
        key = self._key(column)
        self._families[column.rsplit("_", 1)[0]] = None
        if column in self._fixed or key in self._axes or key in self._lists:
            raise InputError(f"start: {column} is given twice")
        if np.ndim(given) == 0:  # type: ignore[arg-type]
            self._fixed[column] = given
            return
        values = _values(f"start: {column}", given)
        if is_axis:
            self._axes[key] = values
        else:
            self._lists[key] = values

    def _columns_of(self, name: str, given: object) -> list[tuple[str, object]]:
        """Each column with its value: a number, a text, or an array of one axis."""
        links = columns_of(name, self._columns)
        if not links:
            require_known("start", [name], self._columns)
        if isinstance(given, tuple) or has_texts(given):
            if len(given) != len(links):  # type: ignore[arg-type]
                raise InputError(f"start: expected {len(links)} of {name}, got {len(given)}")  # type: ignore[arg-type]
            return list(zip(links, given, strict=True))  # type: ignore[call-overload]
        if isinstance(given, str):
            return [(column, given) for column in links]
        array = numbers(f"start: {name}", given)
        if array.ndim == 0 or (array.ndim == 1 and len(links) == 1):
            return [(column, array if array.ndim else float(array)) for column in links]
        if array.shape == (len(links),):  # one of each link, for all members
            return list(zip(links, array.tolist(), strict=True))
        if array.ndim != 2 or array.shape[1] != len(links):
            members = "(members,)" if name in self._columns else f"(members, {len(links)})"
            raise InputError(f"start: expected {members} for {name}, got shape {array.shape}")
        return [(column, array[:, k]) for k, column in enumerate(links)]

    def _key(self, column: str) -> str:
        """The key of a column. Scenarios of chains have arrays over links, others each coordinate by its name."""
        if not isinstance(self._system, Chain):
            return f"start.{column}"
        family, link = column.rsplit("_", 1)
        return f"start.{family}[{link}]"

    def _start(self) -> dict[str, object]:
        """A start amid those of the members: at the ends of a range a model is singular more often."""
        if not isinstance(self._system, Chain):
            of_members = {**self._axes, **self._lists}
            amid: dict[str, object] = {
                key: float(values[values.size // 2]) for key, values in of_members.items()
            }
            amid |= {key: _mean(given) for key, given in self._drawn.items()}
            starts = {
                key.removeprefix("start."): one for key, one in amid.items() if key.startswith("start.")
            }
            return {**starts, **self._fixed}
        return {
            name: [self._fixed.get(one, 0.0) for one in columns_of(name, self._columns)]
            for name in self._families
        }

    def _write_as_array(self, tables: dict[str, Any], key: str) -> None:
        """Writes the array that contains the key of one link."""
        found = re.fullmatch(r"(chain|start)\.(\w+)\[\d+\]", key)
        if found is None:
            return
        table, name = tables[found[1]], found[2]
        known = name in tables["chain"] if found[1] == "chain" else columns_of(name, self._columns)
        one = table.get(name)
        if known and np.ndim(one) == 0:  # None, too
            table[name] = [0.0 if one is None else one] * len(columns_of("theta", self._columns))


def _mean(given: Sequence[Any]) -> object:
    """The mean of ("normal", mean, deviation) or ("uniform", from, to)."""
    try:
        return given[1] if given[0] == "normal" else (given[1] + given[2]) / 2
    except TypeError:
        return given[1]  # not a number: the reader of scenarios reports it


def ensemble_text(
    tables: Mapping[str, Any], *, method: object, members: object, seed: object, keep: object
) -> str:
    """The text of a scenario. Arguments that are None are left to defaults."""
    if keep is not None and (not isinstance(keep, Sequence) or not all(isinstance(x, str) for x in keep)):
        raise InputError(f"keep: expected names of what is kept, got {keep!r}")
    ensemble = {
        "count": members,
        "seed": seed,
        "method": "auto" if method == "auto" else None,
        "keep": None if keep is None else list(keep),
    }
    return _toml.document({**tables, "ensemble": ensemble})


def _values(name: str, given: object) -> NDArray[np.float64]:
    array = numbers(name, given)
    if array.ndim != 1 or array.size == 0:
        raise InputError(f"{name}: expected an array of numbers along one axis, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name}: expected finite numbers, got {array[~np.isfinite(array)][0]}")
    return array
