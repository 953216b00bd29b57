"""Taylor series in C: the text of what templates/series.c.j2 leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pendula_codegen.backends.c import Printer
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.series_tape import SeriesTapes
from pendula_codegen.tape import Row

# Of one motion, up to how many sums the newest coefficients are added one by one; beyond, their rows are made in
# registers.
NEWEST_ADDED = 16
AT_A_TIME = 10  # sums of many motions that are made together: as many as registers hold


@dataclass(frozen=True)
class CSeries:
    """What a kernel's text says of its series: numbers, and lines of C.

    padded_state   numbers of a row of one motion's state
    padded_sums    lanes of one motion's sums
    """

    form: str
    sums: int
    operands: int
    operations: int
    padded_state: int
    padded_sums: int
    adds_newest: bool
    start: list[str]
    next: list[str]
    sums_of_one: list[str]
    sums_of_many: list[str]
    rows_of_one: list[str]
    rows_of_many: list[str]


def print_series(tapes: SeriesTapes, names: Mapping[Row, str]) -> CSeries:
    series = tapes.series
    order = {("order", k): f"order_{k}" for k in range(4)}
    sums = {("sums", k): f"sum_{k}" for k in range(len(series.sums))}
    start = tapes.start.written_out(UNROLLED)
    following = Printer({}, {**order, **sums}, conditions=())
    steps = following.steps(tapes.next)
    written = {row: following.pack(value) for row, value in tapes.next.outputs.items()}
    operands = [written["operands", k] for k in range(len(series.operands))]
    lanes = lanes_of(len(series.sums))
    adds_newest = len(series.sums) <= NEWEST_ADDED
    return CSeries(
        form=series.form.capitalize(),
        sums=len(series.sums),
        operands=len(operands),
        operations=tapes.operations,
        padded_state=padded_state(series.size),
        padded_sums=lanes,
        adds_newest=adds_newest,
        start=Printer(names).lines(start),
        next=[*steps, *(f"WRITE(next, {k}) = {written['next', k]};" for k in range(2 * series.size))],
        sums_of_one=_sums_of_one(series.places, adds_newest, lanes),
        sums_of_many=_sums_of_many(series.places),
        rows_of_one=_rows_of_one(series.places, operands, adds_newest, lanes),
        rows_of_many=[f"WRITE(row, {k}) = {value};" for k, value in enumerate(operands)],
    )


def padded_state(size: int) -> int:
    """Numbers of a row that a motion's state takes, so that registers can sum many of them."""
    return 4 if 2 * size <= 4 else lanes_of(2 * size)


def lanes_of(count: int) -> int:
    return (count + 7) // 8 * 8


def _sums_of_one(places: list[tuple[int, int]], adds_newest: bool, lanes: int) -> list[str]:
    names = [f"sum_{k} = sums[{k}]" for k in range(len(places))]
    lines = [f"double {', '.join(names)};"]
    if not adds_newest:
        return lines
    early = "operands + OPERAND_ROW"
    lines += [f"const double *const early = {early}, *const late = row - OPERAND_ROW;", "if (k > 1) {"]
    lines += [f"  sum_{k} += early[{k}] * late[{lanes + k}];" for k in range(len(places))]
    lines += ["}", "if (k > 2) {"]
    # An operand with itself has the same product again.
    lines += [f"  sum_{k} += late[{k}] * early[{lanes + k}];" for k in range(len(places))]
    return [*lines, "}"]


def _sums_of_many(places: list[tuple[int, int]]) -> list[str]:
    groups = -(-len(places) // AT_A_TIME)
    lines = [f"V {', '.join(f'sum_{k} = SPLAT(0.0)' for k in range(len(places)))};"]
    for group in range(groups):
        held = range(group * len(places) // groups, (group + 1) * len(places) // groups)
        lines += [
            "for (int j = (k - 1) / 2; j > 0; --j) {",
            "  const double *const early = operands + j * OPERAND_ROW;",
            "  const double *const late = operands + (k - j) * OPERAND_ROW;",
        ]
        for k in held:
            a, b = places[k]
            lines.append(f"  sum_{k} += READ(early, {a}) * READ(late, {b});")
            if a != b:
                lines.append(f"  sum_{k} += READ(late, {a}) * READ(early, {b});")
        lines.append("}")
    lines += [f"sum_{k} += sum_{k};" for k, (a, b) in enumerate(places) if a == b]
    lines += ["if (k % 2 == 0) {", "  const double *const middle = operands + k / 2 * OPERAND_ROW;"]
    lines += [
        f"  sum_{k} += READ(middle, {a}) * READ(middle, {b});" for k, (a, b) in enumerate(places)
    ]
    return [*lines, "}"]


def _rows_of_one(
    places: list[tuple[int, int]], operands: list[str], adds_newest: bool, lanes: int
) -> list[str]:
    lines = []
    for half in range(2):
        values = [operands[pair[half]] for pair in places]
        if adds_newest:
            lines += [f"row[{half * lanes + k}] = {value};" for k, value in enumerate(values)]
        else:
            values += ["0.0"] * (lanes - len(values))
            lines += [
                f"WRITE_EIGHT(row + {half * lanes + k}, {', '.join(values[k : k + 8])});"
                for k in range(0, lanes, 8)
            ]
    return lines
