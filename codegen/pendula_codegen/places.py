"""Where the numbers of a kernel stand, whatever language it is written in."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """An argument of a function, or a field of it, or one entry of either; only a backend knows how that is written.

    argument   its name
    field      of a structure, the field that is meant
    index      (row) of a vector, (row, column) of a matrix, () of a number
    """

    argument: str
    field: str = ""
    index: tuple[int, ...] = ()
