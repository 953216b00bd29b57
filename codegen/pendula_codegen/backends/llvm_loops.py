"""Functions of kernels that loop, as LLVM's text: the same as templates/iterate.c.j2, solve.c.j2, kernel.c.j2 in C."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pendula_codegen.backends.llvm_text import LlvmFunction, literal

# Computes velocities and forces of a stage from coordinates and momenta, of the register that begins at some state.
Form = Callable[[LlvmFunction, int | str, list[str]], list[str]]


def iteration(f: LlvmFunction, states: int, size: int, form: Form) -> str:
    """One fixed-point iteration on the stages of a step, of a model with `size` coordinates."""
    m, hb, start, weights, increments = (f.pointer("%on", k) for k in range(5))
    before = [
        [f.read_one(f.place(increments, k * states + j)) for j in range(states)] for k in range(2 * size)
    ]
    weight = [f.splat(f.read_one(f.place(weights, k))) for k in range(2 * size)]
    sums = [f.slot("double", f.width) for _ in range(3)]
    for sum_ in sums:
        f.write(sum_, f.number(0.0))
    with f.each_register(states) as lane:
        columns = [f.read(f.place(f.place(m, j * states), lane)) for j in range(states)]
        found = form(f, lane, [_reached(f, columns, f.place(start, 2 * k), x) for k, x in enumerate(before)])
        factor = f.read(f.place(hb, lane))
        largest, scale, total = map(f.read, sums)
        for k, rate in enumerate(found):
            place = f.place(f.place(increments, k * states), lane)
            now = f.multiply(factor, rate)
            change = f.subtract(now, f.read(place))
            f.write(place, now)
            largest = _larger(f, largest, f.multiply(weight[k], change))
            scale = _larger(f, scale, f.multiply(weight[k], now))
            total = f.add(total, change)
        for sum_, one in zip(sums, (largest, scale, total), strict=True):
            f.write(sum_, one)
    _give_change(f, *map(f.read, sums))
    return f.text()


def _reached(f: LlvmFunction, columns: Sequence[str], start: str, increments: Sequence[str]) -> str:
    """The stages from their increments, in two partial sums, so that few products wait for one another."""
    strands = [f.splat(f.read_one(f.place(start, 1))), ""]
    for j, (column, x) in enumerate(zip(columns, increments, strict=True)):
        product = f.multiply(column, f.splat(x))
        strands[j % 2] = f.add(strands[j % 2], product) if strands[j % 2] else product
    even = f.add(*strands) if strands[1] else strands[0]
    return f.add(even, f.splat(f.read_one(start)))


def _larger(f: LlvmFunction, most: str, one: str) -> str:
    size = f.intrinsic("fabs", one)
    return f.choose(f.compare("ogt", size, most), size, most)


def _give_change(f: LlvmFunction, largest: str, scale: str, total: str) -> None:
    """Returns the change and the scale. The change is NaN if any is: a NaN reaches the sum, not always the maximum."""
    change, size, sum_ = map(f.lanes, (largest, scale, total))

    def folded(lanes: list[str], how: str) -> str:
        found = lanes[0]
        for lane in lanes[1:]:
            if how == "sum":
                found = f.let(f"fadd double {found}, {lane}")
            else:
                more = f.let(f"fcmp ogt double {lane}, {found}")
                found = f.let(f"select i1 {more}, double {lane}, double {found}")
        return found

    all_ = f.let(f"call double @llvm.fabs.f64(double {folded(sum_, 'sum')})")
    finite = f.let(f"fcmp olt double {all_}, {literal(math.inf)}")
    most = f.let(f"select i1 {finite}, double {folded(change, 'most')}, double {literal(math.nan)}")
    f.line(f"ret {{ double, double }} {f.pair(most, folded(size, 'most'), 'double')}")


def factorization(width: int, size: int) -> str:
    """Replaces the lower triangle of a symmetric matrix L D Lᵀ, row by row, by L and 1/D."""
    f = LlvmFunction(f"internal fastcc void @factor.{width}(ptr %a)", width)
    with f.each(0, size) as k:
        pivots = _row(f, k)
        diagonal = _entry(f, "%a", f.whole("add", pivots, k))
        inverse = f.do("fdiv", f.number(1.0), f.read(diagonal))
        f.write(diagonal, inverse)
        with f.each(size - 1, k, step=-1) as i:
            row = _row(f, i)
            left = _entry(f, "%a", f.whole("add", row, k))
            entry = f.multiply(f.read(left), inverse)
            with f.each(f.whole("add", k, 1), f.whole("add", i, 1)) as j:
                above = f.read(_entry(f, "%a", f.whole("add", _row(f, j), k)))
                place = _entry(f, "%a", f.whole("add", row, j))
                f.write(place, f.subtract(f.read(place), f.multiply(entry, above)))
            f.write(left, entry)
    f.line("ret void")
    return f.text()


def solution(width: int, size: int) -> str:
    """Replaces the right-hand side by the solution."""
    f = LlvmFunction(f"internal fastcc void @solve.{width}(ptr %a, ptr %x)", width)

    def subtract(i: str, k: str, row: str, column: str) -> None:
        """x_i less the entry of that row and column times x_k."""
        entry = f.read(_entry(f, "%a", f.whole("add", _row(f, row), column)))
        place = _entry(f, "%x", i)
        f.write(place, f.subtract(f.read(place), f.multiply(entry, f.read(_entry(f, "%x", k)))))

    with f.each(0, size) as k, f.each(f.whole("add", k, 1), size) as i:
        subtract(i, k, i, k)
    with f.each(size - 1, -1, step=-1) as k:
        place = _entry(f, "%x", k)
        inverse = f.read(_entry(f, "%a", f.whole("add", _row(f, k), k)))
        f.write(place, f.multiply(f.read(place), inverse))
        with f.each(f.whole("add", k, 1), size) as i:
            subtract(k, i, i, k)
    f.line("ret void")
    return f.text()


def _row(f: LlvmFunction, k: str) -> str:
    """The index of the first entry of a row of a lower triangle."""
    return f.let(f"lshr i64 {f.whole('mul', k, f.whole('add', k, 1))}, 1")


def _entry(f: LlvmFunction, array: str, k: str) -> str:
    return f.let(f"getelementptr inbounds {f.numbers}, ptr {array}, i64 {k}")


def rows_of_eight(states: int) -> list[str]:
    """Functions that widen rows of fewer numbers to eight, by repetition, and narrow them again."""
    found = []
    for name, given, wanted in (("widen", states, 8), ("narrow", 8, states)):
        f = LlvmFunction(f"internal fastcc void @{name}_{states}(ptr %from, i64 %rows, ptr %to)", 1)
        with f.each(0, "%rows") as k:
            row, there = (f.whole("mul", k, count) for count in (given, wanted))
            for j in range(wanted):
                number = f.read_one(f.place("%from", f.whole("add", row, j % given)))
                f.write(f.place("%to", f.whole("add", there, j)), number)
        f.line("ret void")
        found.append(f.text())
    return found
