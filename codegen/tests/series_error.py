"""How far the Taylor coefficients of a compiled kernel are from those of its tapes, in 50 digits."""

import math
import random
from functools import cache
from typing import Any

from mpmath import mp, mpf

from loaded import LoadedKernel, table_of
from pendula_codegen.model import Model
from pendula_codegen.written import DIGITS
from series_truth import Decimals, by_tapes

SERIES_ORDER = 20


@cache
def _case(model: Model, width: int, seed: int) -> tuple[Any, ...]:
    """What a series begins with, the inputs of each order, the unit, and of each state its coefficients."""
    draw, table = random.Random(seed), table_of(model)

    def drawn(count: int, low: float, high: float) -> list[list[float]]:
        return [[draw.uniform(low, high) for _ in range(width)] for _ in range(count)]

    given = {"parameters": drawn(table.rows["parameters"], 0.5, 1.5), "times": drawn(1, -1, 1)}
    given["state"] = drawn(2 * table.rows["q"], -1, 1)
    inputs = [drawn(table.rows["inputs"], -1, 1) for _ in range(SERIES_ORDER + 1)]
    unit = [draw.uniform(0.1, 0.2) for _ in range(width)]
    true = []
    with mp.workdps(DIGITS):
        for lane in range(width):
            at = {array: [mpf(each[lane]) for each in rows] for array, rows in given.items()}
            at["unit"] = [mpf(unit[lane])]
            given_inputs = [[mpf(each[lane]) for each in rows] for rows in inputs]
            true.append(by_tapes(table.series, Decimals(), at, given_inputs, SERIES_ORDER))
    return given, inputs, unit, true


def series_error(loaded: LoadedKernel, width: int, seed: int) -> float:
    """Of Taylor coefficients, relative to the largest of an order, against the same tapes in 50 digits."""
    given, inputs, unit, true = _case(loaded.model, width, seed)
    found = loaded.series(width, given, inputs, unit, [range(1, 3), range(3, SERIES_ORDER)])
    worst = 0.0
    for lane, coefficients in enumerate(true):
        for row, expected in zip(found, coefficients, strict=True):
            size = max(abs(float(value)) for value in expected) or 1.0
            for value, other in zip(row, expected, strict=True):
                error = abs(float(value[lane] - other)) / size
                worst = max(worst, error) if math.isfinite(error) else math.inf
    return worst
