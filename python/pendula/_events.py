"""Events: expressions, and functions of Python as SciPy has them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ._core import InputError
from ._runs import Raised, mapping, number, require_known

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Event = str | Callable[..., float] | Mapping[str, object]  # a function is one of (t, y)


def events_of(events: object) -> tuple[list[dict[str, object]], list[tuple[str, Any, int, bool]]]:
    """Tables of a scenario, and functions: name, function, direction, whether it ends the run. Raises InputError."""
    tables: list[dict[str, object]] = []
    functions: list[tuple[str, Any, int, bool]] = []
    for name, event in mapping("events", events).items():
        given = (
            {"when": event} if isinstance(event, str) or callable(event) else mapping(f"events.{name}", event)
        )
        if callable(given.get("when")):
            functions.append(_function(name, given))
        else:
            tables.append({"name": name, **given})
    return tables, functions


def event_tables(events: object) -> list[dict[str, object]]:
    """The same for expressions only. Raises InputError."""
    tables, functions = events_of(events)
    if functions:
        raise InputError(f"events.{functions[0][0]}: expected an expression, got a function")
    return tables


def _function(name: str, given: Mapping[str, Any]) -> tuple[str, Any, int, bool]:
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise InputError(f"events: expected a name of letters, digits, - and _, got {name!r}")
    require_known(f"events.{name}", given, ("when", "direction", "stop"))
    function = given["when"]
    terminal = given.get("stop", getattr(function, "terminal", False))
    if terminal not in (False, True):
        raise InputError(f"events.{name}.terminal: expected True or False, got {terminal!r}")
    named = {"up": 1, "down": -1, "both": 0}
    direction = given.get("direction", getattr(function, "direction", 0))
    if isinstance(direction, str):
        if direction not in named:
            raise InputError(f"events.{name}.direction: expected up, down or both, got {direction!r}")
        direction = named[direction]
    sign = number(f"events.{name}.direction", direction)

    def asked(t: float, y: NDArray[np.float64]) -> Any:
        try:
            return function(t, y)
        except Exception as error:
            raise Raised(error) from None

    return name, asked, (sign > 0) - (sign < 0), bool(terminal)
