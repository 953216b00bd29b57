"""Arguments and results of a function in CasADi's external interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Side:
    """An argument or a result: a dense matrix, or one that is zero by its structure."""

    name: str
    rows: int
    columns: int = 1
    place: int = 0
    empty: bool = False


def quoted(sides: Sequence[Side]) -> str:
    return ", ".join(f'"{side.name}"' for side in sides)


def shapes(sides: Sequence[Side]) -> str:
    """In CasADi's words: rows, columns, and that it is dense."""
    return ", ".join(f"{{{side.rows}, {side.columns}, 1}}" for side in sides)


def slopes_of(out: Side, ins: Sequence[Side], without: Sequence[str]) -> list[Side]:
    """The derivatives of a result with respect to each argument; zero for those in `without`."""
    return [
        Side(f"D{out.name}D{given.name}", out.rows, given.rows, place, given.name in without)
        for place, given in enumerate(ins)
    ]
