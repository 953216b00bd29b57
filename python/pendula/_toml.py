"""Scenarios as TOML text: how the arguments of Python reach the reader of scenarios."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from ._core import InputError
from ._runs import arrayed


def value(given: object, key: str) -> str:
    """One value in TOML. Raises InputError, with the key, for a value that TOML cannot have."""
    if isinstance(given, (bool, np.bool_)):
        return "true" if given else "false"
    if isinstance(given, (int, np.integer)):
        return str(int(given)) if abs(int(given)) <= 2**53 else repr(float(given))
    if isinstance(given, (float, np.floating)):
        number = float(given)
        if math.isnan(number):
            return "nan"
        if math.isinf(number):
            return "inf" if number > 0 else "-inf"
        return repr(number)
    if isinstance(given, str):
        return _text(given)
    if isinstance(given, Mapping):
        inside = (f"{_text(str(name))} = {value(one, f'{key}.{name}')}" for name, one in given.items())
        return "{" + ", ".join(inside) + "}"
    if hasattr(given, "__array__") or hasattr(given, "__dlpack__"):
        array = np.asarray(arrayed(key, given))
        if array.dtype == np.float64 and array.ndim > 0:
            return str(array.tolist())  # as TOML has them, and fast
        return value(array.tolist(), key)
    if isinstance(given, Sequence) and not isinstance(given, (bytes, bytearray)):
        return "[" + ", ".join(value(one, key) for one in given) + "]"
    raise InputError(f"{key}: expected a number, a string, an array or a mapping, got {type(given).__name__}")


def _text(given: str) -> str:
    """A basic string. TOML has no surrogates, into which JSON would escape characters beyond 16 bits."""
    return json.dumps(given, ensure_ascii=False).replace("\x7f", "\\u007F")


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def document(tables: Mapping[str, Mapping[str, object] | Sequence[Mapping[str, object]]]) -> str:
    """A whole document; a sequence of tables becomes ``[[name]]``. Values that are None are left out."""
    lines: list[str] = []

    def table(name: str, heading: str, keys: Mapping[str, object]) -> None:
        lines.append(heading)
        lines.extend(
            f"{_key(str(key))} = {value(one, f'{name}.{key}')}"
            for key, one in keys.items()
            if one is not None
        )

    for name, given in tables.items():
        if isinstance(given, Mapping):
            table(name, f"[{name}]", given)
        else:
            for one in given:
                table(name, f"[[{name}]]", one)
    return "\n".join(lines) + "\n"
