"""Kernels as C99 for other people's programs: how the steps of a tape are written there, for one state."""

from __future__ import annotations

from collections.abc import Mapping

from pendula_codegen.backends.c import CALLS
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.tape import Row, Step, Tape, Value

NUMBERS = ("double", "float")
_SIGNS = {"add": "+", "subtract": "-", "multiply": "*"}


class C99Printer:
    """Writes tapes as bodies of functions.

    number   the type of numbers, double or float
    prefix   of functions of the file that solve linear systems
    """

    def __init__(self, number: str, prefix: str, names: Mapping[Row, str]):
        self.number = number
        self.prefix = prefix
        self.names = names

    def literal(self, value: float) -> str:
        return f"{value!r}{'f' if self.number == 'float' else ''}"

    def function(self, name: str) -> str:
        """Of the mathematical library."""
        return f"{name}f" if self.number == "float" else name

    def body(self, tape: Tape) -> list[str]:
        return _Body(self, tape.written_out(UNROLLED)).lines()

    def read_by(self, tape: Tape) -> set[str]:
        """Arrays that its body reads: writing it out may leave nothing of what it took from one."""
        written = tape.written_out(UNROLLED)
        used = {value for step in written.steps for value in step.operands} | {*written.outputs.values()}
        return {step.row[0] for step in written.steps if step.operation == "read" and step.first in used}


class _Body:
    def __init__(self, printer: C99Printer, tape: Tape):
        self._printer = printer
        self._tape = tape
        self._used = {value for step in tape.steps for value in step.operands} | {*tape.outputs.values()}
        self._taken: set[str] = set()
        self._names: dict[Value, str] = {}
        self._numbers: dict[Value, float] = {}

    def lines(self) -> list[str]:
        steps = [line for step in self._tape.steps for line in self._step(step)]
        return [*steps, *(f"{array}[{k}] = {self._of(v)};" for (array, k), v in self._tape.outputs.items())]

    def _step(self, step: Step) -> list[str]:
        number = self._printer.number
        match step.operation:
            case "number":
                self._numbers[step.first] = step.number
                return []
            case "read":
                return self._read(step)
            case "sincos":
                found = [(v, f) for v, f in zip(step.results, ("sin", "cos"), strict=True) if v in self._used]
                argument = self._of(step.operands[0])
                self._names |= {value: f"t{value}" for value, _ in found}
                return [f"const {number} t{v} = {self._printer.function(f)}({argument});" for v, f in found]
            case "factor" | "solve":
                return self._array(step)
        self._names[step.first] = f"t{step.first}"
        return [f"const {number} t{step.first} = {self._expression(step)};"]

    def _read(self, step: Step) -> list[str]:
        array, k = step.row
        if array == "times":
            self._names[step.first] = "t"
            return []
        called = self._printer.names
        self._names[step.first] = self._own(called[step.row]) if step.row in called else f"{array}_{k}"
        return [f"const {self._printer.number} {self._names[step.first]} = {array}[{k}];"]

    def _own(self, name: str) -> str:
        """What is the model's ends in an underscore, and nothing else does."""
        name += "_"
        while name in self._taken:  # a parameter may be called as a momentum is
            name += "_"
        self._taken.add(name)
        return name

    def _array(self, step: Step) -> list[str]:
        """A linear system that is too large to be written out."""
        name = f"t{step.first}"
        self._names |= {value: f"{name}[{k}]" for k, value in enumerate(step.results)}
        given = ", ".join(map(self._of, step.operands[-step.count :]))
        factors = ""
        if step.operation == "solve":
            factors = self._names[step.operands[0]].removesuffix("[0]") + ", "
        return [
            f"{self._printer.number} {name}[] = {{{given}}};",
            f"{self._printer.prefix}{step.operation}_symmetric({factors}{name});",
        ]

    def _expression(self, step: Step) -> str:
        first, *others = map(self._of, step.operands)
        if step.operation in _SIGNS:
            return f"{first} {_SIGNS[step.operation]} {others[0]}"
        if step.operation == "negative":
            return f"-({first})" if first.startswith("-") else f"-{first}"
        if step.operation == "inverse":
            return f"{self._printer.literal(1.0)} / {first}"
        call = self._printer.function(step.operation)
        if step.operation == "pow":
            return f"{call}({first}, {self._printer.literal(step.number)})"
        assert step.operation in {*CALLS, "exp", "log"}, step.operation
        return f"{call}({first})"

    def _of(self, value: Value) -> str:
        name = self._names.get(value)
        return name if name is not None else self._printer.literal(self._numbers[value])
