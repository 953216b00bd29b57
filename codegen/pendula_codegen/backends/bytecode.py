"""Kernels as bytecode: steps on numbered registers, a line each, for the interpreter of the runtime.

The lines of a function have, in this order: its name and its number of registers; the rows to read and the constants
to load before it begins; its operations, with their results first; and the rows that it gives. Tabs separate words.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from heapq import heappop, heappush

from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.table import TableFunction
from pendula_codegen.tape import Step, Tape, Value, unknowns

_BEFORE = ("read", "number")


def function_lines(function: TableFunction) -> list[str]:
    tape = function.tape
    if _has_zeros(tape):
        tape = tape.written_out(UNROLLED)
    tape = _fused(tape)
    before = [step for step in tape.steps if step.operation in _BEFORE]
    steps = [*before, *_grouped([step for step in tape.steps if step.operation not in _BEFORE])]
    registers = _Registers(steps, {*tape.outputs.values()})
    rows = [
        ("function", function.name, registers.count),
        *(_words(step, registers.of) for step in steps),
        *(("write", registers.of[value], *row) for row, value in tape.outputs.items()),
    ]
    return ["\t".join(map(str, row)) for row in rows]


def _words(step: Step, register: dict[Value, int]) -> tuple[object, ...]:
    first = register[step.first]
    operands = [register[value] for value in step.operands]
    match step.operation:
        case "read":
            return ("read", first, *step.row)
        case "number":
            return ("number", first, repr(step.number))
        case "factor":
            return ("factor", unknowns(step.count), first, *operands)
        case "solve":
            return ("solve", step.count, first, operands[0], *operands[-step.count :])
    return (step.operation, *(register[value] for value in step.results), *operands)


def _has_zeros(tape: Tape) -> bool:
    """Whether linear systems have entries known to be 0: written as products and sums they are shorter then."""
    zeros = {step.first for step in tape.steps if step.operation == "number" and step.number == 0}
    return any(step.operation == "factor" and not zeros.isdisjoint(step.operands) for step in tape.steps)


def _fused(tape: Tape) -> Tape:
    """The same tape with products fused into sums that are their only use, and exponents as values."""
    uses = Counter(value for step in tape.steps for value in step.operands)
    uses.update(tape.outputs.values())
    products = {
        step.first: step.operands
        for step in tape.steps
        if step.operation == "multiply" and uses[step.first] == 1
    }
    fused = Tape()
    place: dict[Value, Value] = {}

    def product_of(step: Step) -> Value | None:
        """The product that is fused into a sum; of two, the later one."""
        if step.operation not in ("add", "subtract"):
            return None
        return max((value for value in step.operands if value in products), default=None)

    taken = {product_of(step) for step in tape.steps}
    for step in tape.steps:
        if step.first in taken:
            continue
        product = product_of(step)
        if product is not None:
            x, y = step.operands
            subtracted = "subtract_product" if product == y else "multiply_subtract"
            operation = "multiply_add" if step.operation == "add" else subtracted
            step = replace(step, operation=operation, operands=(*products[product], x if product == y else y))
        operands = [place[value] for value in step.operands]
        if step.operation == "pow":
            operands.append(fused.number(step.number))
        first = fused.append(replace(step, operands=(*operands,), first=fused.values))
        place |= {value: first + k for k, value in enumerate(step.results)}
    fused.outputs = {row: place[value] for row, value in tape.outputs.items()}
    return fused


def _grouped(steps: list[Step]) -> list[Step]:
    """The same steps, with those of one kind in runs where possible: the interpreter decodes one kind for each run."""
    maker = {value: k for k, step in enumerate(steps) for value in step.results}
    needs = [{maker[value] for value in step.operands if value in maker} for step in steps]
    users: list[list[int]] = [[] for _ in steps]
    for k, makers in enumerate(needs):
        for made_by in makers:
            users[made_by].append(k)
    waiting = [len(makers) for makers in needs]
    ready: dict[str, list[int]] = defaultdict(list)
    for k, count in enumerate(waiting):
        if count == 0:
            ready[steps[k].operation].append(k)
    order: list[Step] = []
    while len(order) < len(steps):
        kind = max(ready, key=lambda operation: len(ready[operation]))
        while ready[kind]:
            done = ready[kind].pop(0)
            order.append(steps[done])
            for user in users[done]:
                waiting[user] -= 1
                if waiting[user] == 0:
                    ready[steps[user].operation].append(user)
    return order


class _Registers:
    """Assigns registers to values. A register whose value no later step needs is used again.

    of      the register of each value
    count   number of registers
    """

    def __init__(self, steps: list[Step], kept: set[Value]):
        self.of: dict[Value, int] = {}
        self.count = 0
        self._free: set[int] = set()
        self._lowest: list[int] = []  # a heap that has all free ones, and some that are not free any more
        last = {value: step for step in steps for value in step.operands}
        for step in steps:
            over = {value for value in step.operands if last[value] is step} - kept
            # Linear systems are read while they are solved: their results have consecutive registers of their own.
            if step.operation in ("factor", "solve"):
                self._take(step.results)
                self._release(over)
            else:
                self._release(over)
                for value in step.results:
                    self._take([value])
            self._release({*step.results} - last.keys() - kept)

    def _release(self, values: set[Value]) -> None:
        for register in (self.of[value] for value in values):
            self._free.add(register)
            heappush(self._lowest, register)

    def _take(self, values: Sequence[Value]) -> None:
        """Assigns consecutive registers."""
        first = self._first_of(len(values))
        self.of |= {value: first + k for k, value in enumerate(values)}
        self._free -= {self.of[value] for value in values}
        self.count = max(self.count, first + len(values))

    def _first_of(self, count: int) -> int:
        """The first of `count` consecutive free registers."""
        if count == 1:
            while self._lowest and self._lowest[0] not in self._free:
                heappop(self._lowest)
            return self._lowest[0] if self._lowest else self.count
        free = {*self._free, *range(self.count, self.count + count)}
        return next(k for k in sorted(free) if all(k + j in free for j in range(count)))
