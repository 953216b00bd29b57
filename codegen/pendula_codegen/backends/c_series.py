"""Taylor series in C: the text that fills templates/series.c.j2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pendula_codegen.backends.c import Printer
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.series_tape import SeriesTapes
from pendula_codegen.tape import Row

# Up to so many sums of one motion the newest coefficients are added one by one; with more, their rows are made in
# registers.
NEWEST_ADDED = 16
AT_A_TIME = 30  # most registers for the sums of many motions that one loop computes


@dataclass(frozen=True)
class CSeries:
    """The parts of a kernel's text for its series: numbers, and lines of C.

    padded_state   numbers in a row of one motion's state
    padded_sums    lanes of one motion's sums
    before, after  statements that set the state that an order reads: before the first order, and after each
    """

    form: str
    sums: int
    operands: int
    operations: int
    padded_state: int
    padded_sums: int
    adds_newest: bool
    start: list[str]
    before: list[str]
    before_of_one: list[str]
    sums_of_one: list[str]
    sums_of_many: list[str]
    next: list[str]
    rows_of_one: list[str]
    rows_of_many: list[str]
    after: list[str]


def print_series(tapes: SeriesTapes, names: Mapping[Row, str]) -> CSeries:
    series = tapes.series
    state = [step.row for step in tapes.next.steps if step.operation == "read" and step.row[0] == "state"]
    variables = {("order", k): f"order_{k}" for k in range(4)} | {row: f"state_{row[1]}" for row in state}
    variables |= {("sums", k): f"sum_{k}" for k in range(len(series.sums))}
    printer = Printer({}, variables, conditions=())
    steps = printer.steps(tapes.next)
    written = {row: printer.value(value) for row, value in tapes.next.outputs.items()}
    operands = [written["operands", k] for k in range(len(series.operands))]
    one = _One(series.places, operands)
    return CSeries(
        form=series.form.capitalize(),
        sums=len(series.sums),
        operands=len(operands),
        operations=tapes.operations,
        padded_state=padded_state(series.size),
        padded_sums=one.lanes,
        adds_newest=one.adds_newest,
        start=Printer(names).lines(tapes.start.written_out(UNROLLED)),
        before=[f"V state_{k} = READ(state, {k});" for _, k in state],
        before_of_one=one.before(),
        sums_of_one=one.sums(),
        sums_of_many=_sums_of_many(series.places),
        next=[*steps, *(f"WRITE(next, {k}) = {written['next', k]};" for k in range(2 * series.size))],
        rows_of_one=one.rows(),
        rows_of_many=[f"WRITE(row, {k}) = {value};" for k, value in enumerate(operands)],
        after=[f"state_{k} = {written['next', k]};" for _, k in state],
    )


def padded_state(size: int) -> int:
    """Numbers in a row of a motion's state, padded so that registers can sum several."""
    return 4 if 2 * size <= 4 else lanes_of(2 * size)


def lanes_of(count: int) -> int:
    return (count + 7) // 8 * 8


def _sums_of_many(places: list[tuple[int, int]]) -> list[str]:
    """Statements for the sums of many motions. Sums that share operands are in one loop, which reads these once."""
    lines = [f"V {', '.join(f'sum_{k} = SPLAT(0.0)' for k in range(len(places)))};"]
    for group in groups_of(places):
        operands = sorted({operand for k in group for operand in places[k]})
        lines += [
            "for (int j = (k - 1) / 2; j > 0; --j) {",
            "  const double *const early = operands + j * OPERAND_ROW;",
            "  const double *const late = operands + (k - j) * OPERAND_ROW;",
        ]
        for operand in operands:
            names = (f"early_{operand}", f"late_{operand}")
            lines.append(f"  V {names[0]} = READ(early, {operand}), {names[1]} = READ(late, {operand});")
            lines.append(f"  IN_REGISTER({names[0]}); IN_REGISTER({names[1]});")
        for k in group:
            a, b = places[k]
            lines.append(f"  sum_{k} += early_{a} * late_{b};")
        for k in group:
            a, b = places[k]
            if a != b:
                lines.append(f"  sum_{k} += late_{a} * early_{b};")
        lines.append("}")
    lines += [f"sum_{k} += sum_{k};" for k, (a, b) in enumerate(places) if a == b]
    lines += ["if (k % 2 == 0) {", "  const double *const middle = operands + k / 2 * OPERAND_ROW;"]
    lines += [f"  sum_{k} += READ(middle, {a}) * READ(middle, {b});" for k, (a, b) in enumerate(places)]
    return [*lines, "}"]


def groups_of(places: list[tuple[int, int]]) -> list[list[int]]:
    """Groups of sums that share operands, as many as registers hold with these."""
    waiting, groups = [*range(len(places))], []
    while waiting:
        group, held = [], set()

        def more(k: int, held: set[int]) -> int:
            return len({*places[k]} - held)

        while waiting:
            best = min(waiting, key=lambda k: (more(k, held), k))
            if group and len(group) + 1 + 2 * (len(held) + more(best, held)) > AT_A_TIME:
                break
            waiting.remove(best)
            group.append(best)
            held |= {*places[best]}
        groups.append(group)
    return groups


class _One:
    """Statements for one motion: rows have the first operands of all sums, then the second ones."""

    def __init__(self, places: list[tuple[int, int]], operands: list[str]):
        self._places = places
        self._operands = operands
        self.lanes = lanes_of(len(places))
        self.adds_newest = len(places) <= NEWEST_ADDED

    def before(self) -> list[str]:
        """The operands of the order before the first one."""
        where = {
            pair[half]: half * self.lanes + k for k, pair in enumerate(self._places) for half in range(2)
        }
        return [
            f"double last_{operand} = first > 1 ? before[{k}] : 0.0;" for operand, k in sorted(where.items())
        ]

    def sums(self) -> list[str]:
        lines = [f"double {', '.join(f'sum_{k} = sums[{k}]' for k in range(len(self._places)))};"]
        if not self.adds_newest:
            return lines
        lines += ["const double *const early = operands + OPERAND_ROW;", "if (k > 1) {"]
        lines += [f"  sum_{k} += early[{k}] * last_{b};" for k, (_, b) in enumerate(self._places)]
        lines += ["}", "if (k > 2) {"]
        lines += [
            f"  sum_{k} += early[{self.lanes + k}] * last_{a};" for k, (a, _) in enumerate(self._places)
        ]
        return [*lines, "}"]

    def rows(self) -> list[str]:
        lines = []
        for half in range(2):
            values = [self._operands[pair[half]] for pair in self._places]
            if self.adds_newest:
                lines += [f"row[{half * self.lanes + k}] = {value};" for k, value in enumerate(values)]
            else:
                values += ["0.0"] * (self.lanes - len(values))
                lines += [
                    f"WRITE_EIGHT(row + {half * self.lanes + k}, {', '.join(values[k : k + 8])});"
                    for k in range(0, self.lanes, 8)
                ]
        if self.adds_newest:
            lines += [f"last_{operand} = {value};" for operand, value in enumerate(self._operands)]
        return lines
