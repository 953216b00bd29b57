"""Taylor series of motions as LLVM's text: what templates/series.c.j2 and c_series.py have in C."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from pendula_codegen.backends.c_series import NEWEST_ADDED, groups_of, lanes_of, padded_state
from pendula_codegen.backends.llvm_steps import Steps
from pendula_codegen.backends.llvm_text import LlvmFunction, literal
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.series import Series
from pendula_codegen.table import CONDITIONS, KernelTable

TOGETHER = 4  # registers of one motion's sums that one loop makes


def series_start(table: KernelTable, states: int, width: int) -> str:
    tape = table.series.start.written_out(UNROLLED)
    f = LlvmFunction(f"internal void @series_start_{states}(ptr readonly %at, ptr readonly %rows)", width)
    unit, state, kept = (f.pointer("%rows", k) for k in range(3))
    following = f.place(state, _state_row(table, states))
    arrays = {"unit": unit, "state": state, "kept": kept, "next": following}
    with f.each_register(states) as lane:
        steps = Steps(f, states, lane, arrays=arrays)
        steps.carry_out(tape)
        steps.write(tape.outputs)
    f.line("ret void")
    return f.text()


def series_next(table: KernelTable, states: int, width: int, most: int) -> str:
    """`most`: numbers of the widest register."""
    head = f"internal void @series_next_{states}(ptr readonly %at, ptr readonly %rows, i32 %first, i32 %last)"
    f = LlvmFunction(head, width)
    series, tape, state_row = table.series.series, table.series.next, _state_row(table, states)
    unit, state, kept, operands = (f.pointer("%rows", k) for k in range(4))
    inputs = f.pointer("%at", 1 + CONDITIONS.index("inputs"))
    first, last = (f.let(f"sext i32 %{name} to i64") for name in ("first", "last"))
    sums = _OneMotion(f, series, operands, most) if states == 1 else _Motions(f, series, operands, states)
    read = {step.row for step in tape.steps if step.operation == "read"}

    with f.each_register(states) as lane:
        orders = _Orders(f, f.read(f.place(unit, lane)), first)
        # What an order gives to the next one has slots: it stays in registers.
        begun = Steps(f, states, lane, arrays={"state": f.place(state, f.whole("mul", first, state_row))})
        held = {k: f.slot(f.numbers) for k in range(2 * series.size) if ("state", k) in read}
        for k, slot in held.items():
            f.write(slot, f.read(begun.place(("state", k))))
        sums.begin(first, lane)
        with _each(f, first, f.whole("add", last, 1)) as order:
            following = f.whole("add", order, 1)
            given = {("order", k): value for k, value in enumerate(orders.of(order, following))}
            given |= {("state", k): f.read(slot) for k, slot in held.items()}
            given |= {("sums", k): value for k, value in enumerate(sums.of(order))}
            arrays = {
                "kept": kept,
                "inputs": f.place(inputs, f.whole("mul", order, table.rows["inputs"] * states)),
                "next": f.place(state, f.whole("mul", following, state_row)),
            }
            steps = Steps(f, states, lane, given, arrays)
            steps.carry_out(tape)
            made = {row: steps.names[value] for row, value in tape.outputs.items()}
            for k in range(2 * series.size):
                f.write(steps.place(("next", k)), made["next", k])
            sums.keep(order, [made["operands", k] for k in range(len(series.operands))])
            for k, slot in held.items():
                f.write(slot, made["next", k])
    f.line("ret void")
    return f.text()


def _state_row(table: KernelTable, states: int) -> int:
    size = table.series.series.size
    return padded_state(size) if states == 1 else 2 * size * states


class _Orders:
    """What a tape reads of an order k: k, 1/k, unit/(k + 1), and unit for k = 1."""

    def __init__(self, f: LlvmFunction, unit: str, first: str):
        self._f = f
        self._one = f.of_width(1)
        self._unit = unit
        self._share = self._one.slot("double")
        self._one.write(self._share, self._inverse(first))

    def of(self, order: str, following: str) -> list[str]:
        f, one, unit = self._f, self._one, self._unit
        share, next_share = one.read(self._share), self._inverse(following)
        one.write(self._share, next_share)
        is_first = one.let(f"icmp eq i64 {order}, 1")
        time = f.let(f"select i1 {is_first}, {f.numbers} {unit}, {f.numbers} {f.number(0.0)}")
        return [f.splat(self._number(order)), f.splat(share), f.multiply(unit, f.splat(next_share)), time]

    def _number(self, order: str) -> str:
        return self._one.let(f"sitofp i64 {order} to double")

    def _inverse(self, order: str) -> str:
        return self._one.do("fdiv", literal(1.0), self._number(order))


class _OneMotion:
    """Each sum has a lane: rows of operands have the first ones of all sums, then the second ones."""

    def __init__(self, f: LlvmFunction, series: Series, operands: str, most: int):
        self._f = f
        self._wide = f.of_width(most)
        self._places = series.places
        self._operands = operands
        self._lanes = lanes_of(len(series.sums))
        self._adds_newest = len(series.sums) <= NEWEST_ADDED
        self._last: dict[int, str] = {}  # operands of the order before

    def begin(self, first: str, lane: int | str) -> None:
        if not self._adds_newest:
            return
        f = self._f
        before = self._row(f.whole("sub", first, 1))
        there_is_one = f.let(f"icmp sgt i64 {first}, 1")
        for operand, k in sorted(self._place_of_each().items()):
            self._last[operand] = f.slot("double")
            f.write(self._last[operand], f.choose(there_is_one, f.read(f.place(before, k)), f.number(0.0)))

    def of(self, k: str) -> list[str]:
        """The sums of order k, from the middle outward, so that rows that were just written come last.

        Where newest ones are added, those of orders 1 and k − 1 are left out: registers cannot be read yet where their
        numbers were just written one by one.
        """
        step = TOGETHER * self._wide.width
        sums = [
            total
            for start in range(0, len(self._places), step)
            for total in self._totals(k, range(start, min(len(self._places), start + step), self._wide.width))
        ][: len(self._places)]
        return self._with_newest(k, sums) if self._adds_newest else sums

    def keep(self, k: str, values: Sequence[str]) -> None:
        f, row = self._f, self._row(k)
        for half in range(2):
            place = f.place(row, half * self._lanes)
            lanes = [values[pair[half]] for pair in self._places]
            if self._adds_newest:
                for m, value in enumerate(lanes):
                    f.write(f.place(place, m), value)
                continue
            lanes += [f.number(0.0)] * (self._lanes - len(lanes))
            for m in range(0, len(lanes), self._wide.width):
                self._wide.write(f.place(place, m), self._wide.together(lanes[m : m + self._wide.width]))
        for operand, slot in self._last.items():
            f.write(slot, values[operand])

    def _row(self, k: str) -> str:
        return self._f.place(self._operands, self._f.whole("mul", k, 2 * self._lanes))

    def _place_of_each(self) -> dict[int, int]:
        """Where in a row each operand is."""
        return {
            pair[half]: half * self._lanes + m for m, pair in enumerate(self._places) for half in range(2)
        }

    def _totals(self, k: str, lanes: range) -> list[str]:
        """Of the registers that begin at these lanes."""
        f, wide, least = self._f, self._wide, 2 if self._adds_newest else 1
        totals = [[wide.slot(wide.numbers) for _ in range(2)] for _ in lanes]

        def add(total: str, lane: int, first: str, second: str) -> None:
            x = wide.read(f.place(first, lane))
            y = wide.read(f.place(second, self._lanes + lane))
            wide.write(total, wide.add(wide.read(total), wide.multiply(x, y)))

        for total in (one for both in totals for one in both):
            wide.write(total, wide.number(0.0))
        with f.only_if(_has_middle(f, k, least)):
            middle = self._row(f.let(f"lshr i64 {k}, 1"))
            for lane, (total, _) in zip(lanes, totals, strict=True):
                add(total, lane, middle, middle)
        with _each(f, _before_middle(f, k), least - 1, step=-1) as j:
            early, late = self._row(j), self._row(f.whole("sub", k, j))
            for lane, both in zip(lanes, totals, strict=True):
                add(both[0], lane, early, late)
                add(both[1], lane, late, early)
        return [lane for both in totals for lane in wide.lanes(wide.add(*map(wide.read, both)))]

    def _with_newest(self, k: str, sums: list[str]) -> list[str]:
        f, early = self._f, self._row("1")
        totals = [f.slot("double") for _ in sums]
        for total, value in zip(totals, sums, strict=True):
            f.write(total, value)
        for half in range(2):  # of order 2 both are the same
            with f.only_if(f.let(f"icmp sgt i64 {k}, {1 + half}")):
                for m, (total, pair) in enumerate(zip(totals, self._places, strict=True)):
                    x, y = f.read(f.place(early, half * self._lanes + m)), f.read(self._last[pair[1 - half]])
                    f.write(total, f.add(f.read(total), f.multiply(x, y)))
        return [f.read(total) for total in totals]


class _Motions:
    """Each motion has a lane; some sums are made together, whose operands are read once."""

    def __init__(self, f: LlvmFunction, series: Series, operands: str, states: int):
        self._f = f
        self._states = states
        self._places = series.places
        self._operands = operands
        self._row_length = len(series.operands) * states
        self._lane: int | str = 0

    def begin(self, first: str, lane: int | str) -> None:
        self._lane = lane

    def of(self, k: str) -> list[str]:
        f, totals = self._f, [self._f.slot(self._f.numbers) for _ in self._places]

        def add(m: int, x: str, y: str) -> None:
            f.write(totals[m], f.add(f.read(totals[m]), f.multiply(x, y)))

        for total in totals:
            f.write(total, f.number(0.0))
        for group in groups_of(self._places):
            with _each(f, _before_middle(f, k), 0, step=-1) as j:
                operands = {operand for m in group for operand in self._places[m]}
                early, late = (self._read(row, operands) for row in (j, f.whole("sub", k, j)))
                pairs = [(m, *self._places[m]) for m in group]
                for m, a, b in pairs:
                    add(m, early[a], late[b])
                for m, a, b in pairs:
                    if a != b:
                        add(m, late[a], early[b])
        for total, (a, b) in zip(totals, self._places, strict=True):
            if a == b:
                half = f.read(total)
                f.write(total, f.add(half, half))
        if totals:
            with f.only_if(_has_middle(f, k, 1)):
                operands = {operand for pair in self._places for operand in pair}
                middle = self._read(f.let(f"lshr i64 {k}, 1"), operands)
                for m, (a, b) in enumerate(self._places):
                    add(m, middle[a], middle[b])
        return [f.read(total) for total in totals]

    def keep(self, k: str, values: Sequence[str]) -> None:
        row = self._row(k)
        for m, value in enumerate(values):
            self._f.write(self._f.place(row, m * self._states), value)

    def _row(self, k: str) -> str:
        f = self._f
        return f.place(f.place(self._operands, f.whole("mul", k, self._row_length)), self._lane)

    def _read(self, k: str, operands: set[int]) -> dict[int, str]:
        f, row = self._f, self._row(k)
        return {operand: f.read(f.place(row, operand * self._states)) for operand in sorted(operands)}


@contextmanager
def _each(f: LlvmFunction, first: int | str, end: int | str, step: int = 1) -> Iterator[str]:
    """A loop over orders whose addresses LLVM leaves as they are: to look for better ones takes it a fourth of the time
    that series take, and was measured to gain nothing."""
    with f.each(first, end, step) as k:
        yield f.let(f"freeze i64 {k}")


def _before_middle(f: LlvmFunction, k: str) -> str:
    return f.let(f"lshr i64 {f.whole('sub', k, 1)}, 1")


def _has_middle(f: LlvmFunction, k: str, least: int) -> str:
    is_even = f.let(f"icmp eq i64 {f.let(f'and i64 {k}, 1')}, 0")
    return f.let(f"and i1 {is_even}, {f.let(f'icmp sge i64 {k}, {2 * least}')}")
