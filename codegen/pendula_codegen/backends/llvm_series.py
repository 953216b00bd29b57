"""Taylor series of motions as LLVM's text: what templates/series.c.j2 and c_series.py have in C."""

from __future__ import annotations

from collections.abc import Sequence

from pendula_codegen.backends.c_series import AT_A_TIME, NEWEST_ADDED, groups_of, lanes_of, padded_state
from pendula_codegen.backends.llvm_steps import Steps
from pendula_codegen.backends.llvm_text import LlvmFunction, literal
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.table import KernelTable

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
    tape, state_row = table.series.next, _state_row(table, states)
    head = f"internal void @series_next_{states}(ptr readonly %at, ptr readonly %rows, i32 %first, i32 %last)"
    f = LlvmFunction(head, width)
    one = f.of_width(1)
    unit, state, kept, operands = (f.pointer("%rows", k) for k in range(4))
    inputs = f.pointer("%at", 3)
    first, last = (f.let(f"sext i32 %{name} to i64") for name in ("first", "last"))
    places = table.series.series.places
    sums = (
        _OneMotion(f, places, operands, most) if states == 1 else _Motions(f, places, operands, states, most)
    )
    read = {step.row for step in tape.steps if step.operation == "read"}
    moving = [row for row in tape.outputs if row[0] == "next" and ("state", row[1]) in read]

    with f.each_register(states) as lane:
        unit_here = f.read(f.place(unit, lane))
        share = one.slot("double")
        one.write(share, _inverse(one, first))
        # What an order gives to the next one stays in registers.
        begun = Steps(f, states, lane, arrays={"state": f.place(state, f.whole("mul", first, state_row))})
        held = {("state", k): f.slot(f.numbers) for _, k in moving}
        for row, slot in held.items():
            f.write(slot, f.read(begun.place(row)))
        sums.begin(first, lane)
        with f.each(first, f.whole("add", last, 1)) as k:
            following = f.whole("add", k, 1)
            number, share_here = one.let(f"sitofp i64 {k} to double"), one.read(share)
            share_next = _inverse(one, following)
            one.write(share, share_next)
            is_first = f.let(f"icmp eq i64 {k}, 1")
            given = {
                ("order", 0): f.splat(number),
                ("order", 1): f.splat(share_here),
                ("order", 2): f.multiply(unit_here, f.splat(share_next)),
                ("order", 3): f.let(
                    f"select i1 {is_first}, {f.numbers} {unit_here}, {f.numbers} {f.number(0.0)}"
                ),
            }
            given |= {row: f.read(slot) for row, slot in held.items()}
            given |= {("sums", m): found for m, found in enumerate(sums.found(k))}
            arrays = {
                "kept": kept,
                "inputs": f.place(inputs, f.whole("mul", k, table.rows["inputs"] * states)),
                "next": f.place(state, f.whole("mul", following, state_row)),
            }
            steps = Steps(f, states, lane, given, arrays)
            steps.carry_out(tape)
            values = {row: steps.names[value] for row, value in tape.outputs.items()}
            steps.write({row: value for row, value in tape.outputs.items() if row[0] == "next"})
            sums.keep(k, [value for (array, _), value in values.items() if array == "operands"])
            for row in moving:
                f.write(held["state", row[1]], values[row])
    f.line("ret void")
    return f.text()


def _state_row(table: KernelTable, states: int) -> int:
    size = table.series.series.size
    return padded_state(size) if states == 1 else 2 * size * states


def _inverse(one: LlvmFunction, k: str) -> str:
    return one.do("fdiv", literal(1.0), one.let(f"sitofp i64 {k} to double"))


class _OneMotion:
    """Each sum has a lane: rows of operands have the first ones of all sums, then the second ones."""

    def __init__(self, f: LlvmFunction, places: list[tuple[int, int]], operands: str, most: int):
        self._f = f
        self._wide = f.of_width(most)
        self._places = places
        self._operands = operands
        self._lanes = lanes_of(len(places))
        self._adds_newest = len(places) <= NEWEST_ADDED
        self._last: dict[int, str] = {}  # operands of the order before

    def begin(self, first: str, lane: int | str) -> None:
        f = self._f
        if not self._adds_newest:
            return
        before = self._row(f.whole("sub", first, 1))
        there_is_one = f.let(f"icmp sgt i64 {first}, 1")
        for operand, k in sorted(self._place_of_each().items()):
            self._last[operand] = f.slot("double")
            f.write(self._last[operand], f.choose(there_is_one, f.read(f.place(before, k)), f.number(0.0)))

    def found(self, k: str) -> list[str]:
        """From the middle outward, so that rows that were just written come last.

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
        with f.each(_before_middle(f, k), least - 1, step=-1) as j:
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

    def __init__(self, f: LlvmFunction, places: list[tuple[int, int]], operands: str, states: int, most: int):
        self._f = f
        self._states = states
        self._places = places
        self._operands = operands
        self._lane: int | str = 0
        self._row_length = (1 + max((m for pair in places for m in pair), default=-1)) * states
        # Of 32 registers or 16.
        self._groups = groups_of(places, AT_A_TIME if most == 8 else AT_A_TIME // 2)

    def begin(self, first: str, lane: int | str) -> None:
        self._lane = lane

    def found(self, k: str) -> list[str]:
        f, totals = self._f, [self._f.slot(self._f.numbers) for _ in self._places]

        def add(m: int, x: str, y: str) -> None:
            f.write(totals[m], f.add(f.read(totals[m]), f.multiply(x, y)))

        for total in totals:
            f.write(total, f.number(0.0))
        for group in self._groups:
            with f.each(_before_middle(f, k), 0, step=-1) as j:
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


def _before_middle(f: LlvmFunction, k: str) -> str:
    return f.let(f"lshr i64 {f.whole('sub', k, 1)}, 1")


def _has_middle(f: LlvmFunction, k: str, least: int) -> str:
    is_even = f.let(f"icmp eq i64 {f.let(f'and i64 {k}, 1')}, 0")
    return f.let(f"and i1 {is_even}, {f.let(f'icmp sge i64 {k}, {2 * least}')}")
