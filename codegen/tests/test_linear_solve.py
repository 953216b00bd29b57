"""The emitted solver of A x = b, run as Python: its C++ is simple enough to be read line by line."""

import random
import re

import pytest

from pendula_codegen.linear_solve import UNROLLED, solve_lines


def as_python(lines: list[str]) -> str:
    """The statements that solve_lines emits, in Python."""
    loop = r"for \(int (\w) = (.*?); \w (<=|<|>=) (.*?); (\+\+|--)\w\)"
    translated = []
    for line in lines:
        line = re.sub(r"\b([A-Za-z_]+)\((\w+), (\w+)\)", r"\1[\2][\3]", line.replace("Real(1.0)", "1.0"))
        line = re.sub(r"^(\s*)(?:const )?Real ", r"\1", line)
        if "Vector<Real>" in line:
            line = "inverse_pivot = [0.0] * coordinates"
        line = re.sub(loop, as_range, line)
        translated.append(line.rstrip(" {;"))
    return "\n".join(line for line in translated if line.strip() not in ("}", ""))


def as_range(match: re.Match) -> str:
    name, start, comparison, end, step = match.groups()
    stop = {"<": end, "<=": f"{end} + 1", ">=": f"{end} - 1"}[comparison]
    return f"for {name} in range({start}, {stop}, {1 if step == '++' else -1}):"


def positive_definite(size: int, draw: random.Random) -> list[list[float]]:
    factor = [[draw.uniform(-1, 1) for _ in range(size)] for _ in range(size)]
    return [
        [sum(a * b for a, b in zip(factor[i], factor[j], strict=True)) + (i == j) for j in range(size)]
        for i in range(size)
    ]


@pytest.mark.parametrize("size", [1, 2, 3, 6, UNROLLED, UNROLLED + 1, UNROLLED + 3])
def test_solves_with_the_lower_triangle_alone(size):
    draw = random.Random(size)
    A = positive_definite(size, draw)
    x = [draw.uniform(-1, 1) for _ in range(size)]
    b = [sum(a * value for a, value in zip(row, x, strict=True)) for row in A]
    lower = [[A[i][j] if j <= i else float("nan") for j in range(size)] for i in range(size)]
    exec(as_python(solve_lines(size)), {"M": lower, "b": b, "coordinates": size})
    assert max(abs(p - q) for p, q in zip(b, x, strict=True)) < 1e-14  # measured 9e-16
