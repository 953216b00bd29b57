"""Values of inputs: numbers, which are held, and tables of numbers over time."""

from __future__ import annotations

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from ._core import InputError
from ._runs import has_texts, mapping, numbers, require_known

Signals = dict[str, dict[str, object]]
MOTIONS = '; a motion of the model is no input: drives=[{"input": "NAME", "value": "sin(t)"}] moves one'
_KEYS = ("file", "column", "times", "values", "hold")


def inputs_of(given: Mapping[str, object]) -> tuple[dict[str, object], Signals]:
    """Held inputs, as given, and signals, each as keys of a table ``[[system.signal]]``. Raises InputError."""
    held: dict[str, object] = {}
    signals: Signals = {}
    for name, one in given.items():
        where = f"inputs.{name}"
        if callable(one):
            raise InputError(
                f"{where}: expected a number, (times, values) or a CSV file, got {type(one).__name__} (a drive has a "
                'function of time: value="t < 1 ? 2 : 0"; Simulation.step holds another number from step to step)'
            )
        if isinstance(one, Mapping):
            signals[name] = _signal(name, where, mapping(where, one))
        elif isinstance(one, str) and re.match(r"\s*[-+]?\.?\d", one) and not one.endswith(".csv"):
            held[name] = one  # with a unit
        elif isinstance(one, (str, PathLike)):
            signals[name] = _signal(name, where, {"file": one})
        elif isinstance(one, (tuple, list)):
            if len(one) != 2:
                raise InputError(f"{where}: expected (times, values), got {len(one)} of them")
            signals[name] = _signal(name, where, {"times": one[0], "values": one[1]})
        else:
            held[name] = one
    return held, signals


def _signal(name: str, where: str, given: Mapping[str, object]) -> dict[str, object]:
    require_known(where, given, _KEYS)
    table = {"input": name, **given}
    if "file" in given:
        table["file"] = str(Path(str(given["file"])).resolve())
    for key in ("times", "values"):
        if key not in given:
            continue
        if has_texts(given[key]):
            table[key] = list(given[key])  # type: ignore[call-overload]  # with units
            continue
        array = numbers(f"{where}.{key}", given[key])
        if array.ndim != 1:
            raise InputError(f"{where}.{key}: expected a vector, got an array of shape {array.shape}")
        table[key] = array.tolist()
    return table
