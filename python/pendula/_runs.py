"""Arguments, errors and warnings of all functions."""

from __future__ import annotations

import difflib
import math
import os
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core

if TYPE_CHECKING:
    from numpy.typing import NDArray


class TrustWarning(UserWarning):
    """The rows of a run are less accurate than was asked for; the message says by how much, and what helps."""


class RunFailed(RuntimeError):  # noqa: N818  (the name is fixed)
    """The computation failed. ``partial`` is the solution up to there, or the dataset of an ensemble if none of its
    members reached its end; None for a :class:`Simulation`."""

    def __init__(self, message: str, partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial

    def __reduce__(self) -> tuple[type[RunFailed], tuple[str, Any]]:
        return RunFailed, (str(self), self.partial)


# For files made of functions: the origin of each line, "page.py:12".
written_from: dict[str, dict[int, str]] = {}


def _where_written(sentence: str) -> str:
    """Replaces lines of files made of functions by the lines of these functions."""
    for file, lines in written_from.items():
        for told in re.findall(re.escape(file) + r":(\d+)", sentence):
            before = max((line for line in lines if line <= int(told)), default=min(lines))
            sentence = re.sub(
                re.escape(f"{file}:{told}") + r"\b", lines[before].replace("\\", r"\\"), sentence
            )
        sentence = sentence.replace(file, lines[min(lines)])
    return sentence


class Raised(Exception):  # noqa: N818  (nobody sees it)
    """Carries an exception of a user's function, its first argument, through C++."""


_WORDS = {  # of the program, and ours
    "--resume": "resume=True",
    "signal: expected a system without signals, got one with": "inputs: expected numbers, got tables over time",
}


@contextmanager
def plainly(names: Mapping[str, str] | None = None) -> Iterator[None]:
    """Makes errors name arguments, not lines and keys of the scenario text that was made from them.

    ``names`` are those of numbered tables: ``{"event[1]": "events.flip"}``.
    """
    try:
        yield
    except Raised as raised:
        raise raised.args[0] from None
    except _core.StepFailed as error:
        raise RunFailed(str(error)) from None
    except ValueError as error:
        sentence = _where_written(str(error))
        for theirs, ours in _WORDS.items():
            sentence = sentence.replace(theirs, ours)
        made = sentence.startswith(("pendula:", "run."))
        raise _core.InputError(in_arguments(sentence, names) if made else sentence) from None


def in_arguments(sentence: str, names: Mapping[str, str] | None = None) -> str:
    """Rewrites a sentence about a scenario in terms of the arguments that it was made from."""

    def numbered(table: re.Match[str]) -> str:
        plural = {"feedback": "feedback"}.get(table[2], f"{table[2]}s")
        return (names or {}).get(table[1], f"{plural}[{int(table[3]) - 1}]")

    sentence = re.sub(r"^pendula(:\d+)?: ", "", sentence)
    sentence = re.sub(r"\b(?:chain\.|system\.)?((drive|event|feedback|signal)\[(\d+)\])", numbered, sentence)
    sentence = re.sub(r"\boutput\.times\b", "t", sentence)
    return re.sub(r"\b(?:run|output|chain|system)\.(?=[a-z])(?:parameters\.)?", "", sentence)


def places() -> tuple[str, str]:
    """The folder of this package's program, and the Python that derives kernels."""
    return str(Path(__file__).parent / "bin"), os.environ.get("PENDULA_PYTHON") or sys.executable


def warn(
    sentences: list[str], stacklevel: int, names: Mapping[str, str] | None = None, in_file: bool = False
) -> None:
    """Issues each sentence as a TrustWarning at the caller of pendula, about arguments or keys of a file."""
    for sentence in sentences:
        told = sentence if in_file else in_arguments(sentence, names)
        warnings.warn(told, TrustWarning, stacklevel=stacklevel)


def mapping(name: str, given: object) -> dict[str, Any]:
    """A mapping with names as keys; None is an empty one. Raises InputError."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise _core.InputError(f"{name}: expected a mapping by names, got {type(given).__name__}")
    return {str(key): one for key, one in given.items()}


def merged(name: str, given: object, more: Mapping[str, object]) -> dict[str, Any]:
    """The same with keyword arguments added; none may be given twice."""
    found = mapping(name, given)
    for key in more:
        if key in found:
            raise _core.InputError(f"{name}: {key} is given twice")
    return {**found, **more}


SCIPY = {  # words of SciPy, and ours
    "args": "parameters of the system",
    "atol": "accuracy= (of every row) or tolerance= (of each step)",
    "dense_output": "run.sol(t), which every run has",
    "dt": "interval=, between rows, or step=, constant steps",
    "first_step": "step=, constant steps",
    "max_step": "step=, constant steps; events and rows need none",
    "rtol": "accuracy= (of every row) or tolerance= (of each step)",
    "t_eval": "t=",
    "t_span": "duration=",
    "tol": "accuracy= (of every row) or tolerance= (of each step)",
    "y0": "start=",
}


def unknown(where: str, given: str, known: Iterable[str]) -> _core.InputError:
    """The error for an unknown keyword."""
    told = f"{where}: unknown keyword {given}"
    if given in SCIPY:
        return _core.InputError(f"{told}: here it is {SCIPY[given]}")
    names = list(dict.fromkeys(known))
    return _core.InputError(told + (did_you_mean(given, names) or f", expected some of {', '.join(names)}"))


def did_you_mean(given: str, names: Iterable[str]) -> str:
    """A hint with the nearest names; empty if none is near."""
    near = difflib.get_close_matches(given, list(names), 2)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def require_known(where: str, given: Iterable[str], known: Iterable[str], hint: str = "") -> None:
    """Raises InputError for an unknown name, with near names or else the hint."""
    names = list(known)
    for name in given:
        if name not in names:
            listed = f"some of {', '.join(names)}" if names else "none"
            raise _core.InputError(
                f"{where}: expected {listed}, got {name}{did_you_mean(name, names) or hint}"
            )


def columns_of(name: str, columns: Sequence[str]) -> list[str]:
    """The column of a name; for a name without an index those of all links. Empty if there is none."""
    if name in columns:
        return [name]
    return [column for column in columns if re.fullmatch(re.escape(name) + r"_\d+", column)]


def missing(extra: str, error: ImportError) -> ImportError:
    """The error for an optional package that is not installed."""
    return ImportError(
        f'pendula: expected {error.name}, which pip install "pendula[{extra}]" brings, got none'
    )


def number(name: str, given: object) -> float:
    """A finite number; booleans and texts are none. Raises InputError."""
    if isinstance(given, (int, float, np.integer, np.floating)) and not isinstance(given, bool):
        found = float(given)
        if math.isfinite(found):
            return found
    raise _core.InputError(f"{name}: expected a finite number, got {given!r}")


def quantity(name: str, given: object, info: _core.Prepared | _core.ModelInfo, of: str = "t") -> float:
    """The same, or a text with a unit of the kind that a column, an input or a parameter has."""
    found = info.with_unit(given, of) if isinstance(given, str) else given
    if found is None:
        raise _core.InputError(
            f"{name}: expected a finite number or a string in {info.units[of]}, got {given!r}"
        )
    return number(name, found)


def positive(name: str, given: object) -> float:
    """The same for a number > 0."""
    found = number(name, given)
    if found <= 0:
        raise _core.InputError(f"{name}: expected a number > 0, got {given!r}")
    return found


def whole(name: str, given: object, least: int) -> int:
    """A whole number that is at least ``least``. Raises InputError."""
    if isinstance(given, (int, np.integer)) and not isinstance(given, bool) and given >= least:
        return int(given)
    raise _core.InputError(f"{name}: expected a whole number >= {least}, got {given!r}")


def duration_of(given: object, made: _core.Prepared) -> float:
    """A duration in s. Raises InputError."""
    found = quantity("duration", given, made)
    if found < 0:
        raise _core.InputError(f"duration: expected a number, not negative, got {given!r}")
    return found


def arrayed(name: str, given: object) -> object:
    """Converts an array of another package to NumPy, if only DLPack can. Raises InputError for masked arrays."""
    if isinstance(given, np.ma.MaskedArray):
        raise _core.InputError(f"{name}: expected an array without a mask, got one with a mask")
    is_lent = hasattr(given, "__dlpack__") and not hasattr(given, "__array__")
    return np.from_dlpack(given) if is_lent else given  # type: ignore[arg-type]


def numbers(name: str, given: object) -> NDArray[np.float64]:
    """An array of numbers; NaN may be among them. Raises InputError."""
    try:
        array = np.asarray(arrayed(name, given))
    except ValueError as error:
        raise _core.InputError(f"{name}: expected an array of numbers, got {error}") from None
    if array.dtype.kind not in "iuf" and array.size > 0:
        raise _core.InputError(f"{name}: expected an array of numbers, got one of {array.dtype}")
    return array.astype(float)


def has_texts(given: object) -> bool:
    """Whether texts are among the elements: numbers with units."""
    return isinstance(given, (list, tuple)) and any(isinstance(one, str) for one in given)


def in_order(columns: list[str], state: Sequence[int]) -> list[int]:
    """Indices of the time, of coordinates and rates in the order of states, and of the other columns of a row."""
    first = dict.fromkeys([0, *state])
    return [*first, *(k for k in range(len(columns)) if k not in first)]


def state_names(made: _core.Prepared) -> list[str]:
    """Names of the numbers of a state: coordinates, then their rates."""
    columns = made.columns
    return [columns[k] for k in made.state]


def tell(what: str) -> None:
    print(f"pendula: {_where_written(what)}", file=sys.stderr)
