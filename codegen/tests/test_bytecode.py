"""Kernels as bytecode: carried out here as the runtime does it, and equal to what the models say."""

import math
import random
from collections.abc import Callable

import pytest
from mpmath import mp, mpf

from loaded import table_of
from pendula_codegen.backends.c import INTERFACE
from pendula_codegen.kernel_program import render_bytecode
from pendula_codegen.model import Model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.system_info import info_lines
from pendula_codegen.tape import triangle
from pendula_codegen.written import DIGITS
from series_truth import Decimals, by_tapes
from test_c_kernels import CASES, EVERYTHING, MANY, drawn, truth_of
from test_model_kernels import read

OPERATIONS: dict[str, Callable[..., float]] = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "multiply_add": lambda x, y, z: x * y + z,
    "multiply_subtract": lambda x, y, z: x * y - z,
    "subtract_product": lambda x, y, z: z - x * y,
    "negative": lambda x: -x,
    "inverse": lambda x: 1 / x,
    "pow": math.pow,
    **{name: getattr(math, name) for name in ("tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")},
    **{name: getattr(math, name) for name in ("exp", "log", "sqrt", "cbrt")},
}


def functions_of(text: str) -> dict[str, list[list[str]]]:
    """The lines of each function, as words; the first has how many registers it takes."""
    functions: dict[str, list[list[str]]] = {}
    *lines, end = (line.split("\t") for line in text.splitlines())
    assert end == ["end"]
    for words in lines:
        if words[0] == "function":
            functions[words[1]] = [words]
        elif functions:
            functions[[*functions][-1]].append(words)
    return functions


def carry_out(lines: list[list[str]], given: dict[str, list[float]]) -> dict[str, dict[int, float]]:
    """Arrays that a function gives, by rows."""
    (_, _, count), *steps = lines
    registers, found = [math.nan] * int(count), {}
    for kind, *words in steps:
        if kind == "read":
            registers[int(words[0])] = given[words[1]][int(words[2])]
        elif kind == "number":
            registers[int(words[0])] = float(words[1])
        elif kind == "write":
            found.setdefault(words[1], {})[int(words[2])] = registers[int(words[0])]
        else:
            numbers = [*map(int, words)]
            if kind == "sincos":
                sine, cosine, x = numbers
                angle = registers[x]
                registers[sine], registers[cosine] = math.sin(angle), math.cos(angle)
            elif kind in ("factor", "solve"):
                (factor if kind == "factor" else solve)(registers, numbers)
            else:
                to, *operands = numbers
                registers[to] = OPERATIONS[kind](*(registers[k] for k in operands))
    return found


def factor(registers: list[float], numbers: list[int]) -> None:
    size, first, *entries = numbers
    assert len(entries) == triangle(size) and not {*entries} & {*range(first, first + len(entries))}
    a = {(i, j): registers[entries[triangle(i) + j]] for i in range(size) for j in range(i + 1)}
    for k in range(size):
        a[k, k] = 1 / a[k, k]
        column = {i: a[i, k] for i in range(k + 1, size)}
        for i in column:
            a[i, k] = column[i] * a[k, k]
            for j in range(k + 1, i + 1):
                a[i, j] -= a[i, k] * column[j]
    registers[first : first + len(entries)] = a.values()


def solve(registers: list[float], numbers: list[int]) -> None:
    size, first, factors, *right = numbers
    assert len(right) == size and not {*right} & {*range(first, first + size)}
    x = [registers[k] for k in right]
    for k in range(size):
        for i in range(k + 1, size):
            x[i] -= registers[factors + triangle(i) + k] * x[k]
    for k in reversed(range(size)):
        x[k] *= registers[factors + triangle(k) + k]
        for i in range(k + 1, size):
            x[k] -= registers[factors + triangle(i) + k] * x[i]
    registers[first : first + size] = x


def error(model: Model, seed: int) -> float:
    """The largest of all functions, relative to the largest number that an array has, or 1."""
    truth, worst = truth_of(model), 0.0
    given = {array: [row[0] for row in rows] for array, rows in drawn(truth, 1, seed).items()}
    for name, lines in functions_of(render_bytecode(model)).items():
        if name.startswith("series_"):
            continue
        found = carry_out(lines, given)
        true = truth.exact(name, given)
        assert {array: len(rows) for array, rows in found.items()} == {
            a: len(rows) for a, rows in true.items()
        }
        for array, rows in found.items():
            size = max(1.0, *(abs(float(value)) for value in true[array]))
            worst = max(worst, *(abs(float(rows[k] - value)) / size for k, value in enumerate(true[array])))
    return worst


def series_error(model: Model, seed: int) -> float:
    """Of Taylor coefficients, relative to the largest of an order, against the tapes in 50 digits."""
    table, order, draw = table_of(model), 12, random.Random(seed)
    size, rows = 2 * len(model.coordinates), table.rows
    given = {
        "parameters": [draw.uniform(0.5, 1.5) for _ in range(rows["parameters"])],
        "times": [draw.uniform(-1, 1)],
        "state": [draw.uniform(-1, 1) for _ in range(size)],
        "unit": [0.125],
    }
    inputs = [[draw.uniform(-1, 1) for _ in range(rows["inputs"])] for _ in range(order + 1)]
    text = render_bytecode(model)
    sums = [tuple(map(int, line.split("\t")[1:])) for line in text.splitlines() if line.startswith("sum\t")]
    functions = functions_of(text)
    begun = carry_out(functions["series_start"], {**given, "inputs": inputs[0]})
    kept = begun.get("kept", {})
    found, operands = [given["state"], [begun["next"][k] for k in range(size)]], [{}]
    for k in range(1, order):
        here = {
            "order": [float(k), 1 / k, 0.125 / (k + 1), 0.125 if k == 1 else 0.0],
            "state": found[k],
            "kept": kept,
            "inputs": inputs[k],
            "sums": [sum(operands[j][a] * operands[k - j][b] for j in range(1, k)) for a, b in sums],
        }
        made = carry_out(functions["series_next"], here)
        found.append([made["next"][j] for j in range(size)])
        operands.append(made.get("operands", {}))
    with mp.workdps(DIGITS):
        exact = {array: [*map(mpf, numbers)] for array, numbers in given.items()}
        true = by_tapes(table.series, Decimals(), exact, [[*map(mpf, row)] for row in inputs], order)
    return max(
        float(max(abs(x - y) for x, y in zip(row, other, strict=True)) / max(map(abs, other)))
        for row, other in zip(found, true, strict=True)
    )


@pytest.mark.parametrize(("name", "links"), CASES)
def test_programs_compute_what_models_say(name, links):
    assert error(read(name, links), 1) < 1e-14
    assert series_error(read(name, links), 1) < 1e-12  # measured 3.2e-14


def test_every_function_of_models(own):
    model = own(EVERYTHING, "everything")
    assert error(model, 2) < 1e-14
    assert series_error(model, 2) < 1e-13  # measured 2.8e-16


def test_large_linear_systems(own):
    model = own(MANY, "many", 12)
    assert error(model, 3) < 1e-14
    assert series_error(model, 3) < 1e-13  # measured 1.4e-15


def test_a_program_says_what_it_is_of():
    model = read("furuta", None)
    first, *lines = render_bytecode(model).splitlines()
    said = info_lines(ModelKernel(model), table_of(model).series)
    assert first == f"program\t{INTERFACE}" and lines[: len(said)] == said
    rest = [line for line in lines[len(said) :] if not line.startswith("sum\t")]
    assert rest[0].startswith("function\thamiltonian_form\t")


def test_registers_are_taken_again():
    """And products go into the sums that need them."""
    lines = functions_of(render_bytecode(read("cart_chain", 5)))["residual_with_jacobians"]
    kinds = [words[0] for words in lines]
    assert int(lines[0][2]) < 160  # measured 152, of which it gives 114
    assert kinds.count("multiply_add") + kinds.count("subtract_product") > 100  # measured 115
