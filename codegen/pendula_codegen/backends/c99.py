"""Kernels as C99 for other people's programs: how the steps of a tape are written there, for one state."""

from __future__ import annotations

from collections.abc import Mapping

from pendula_codegen.backends.c import Statements
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.tape import Row, Step, Tape, Value

NUMBERS = ("double", "float")


class C99Printer(Statements):
    """Writes tapes as bodies of functions.

    number   the type of numbers, double or float
    prefix   of functions of the file that solve linear systems
    """

    def __init__(self, number: str, prefix: str, names: Mapping[Row, str]):
        super().__init__(number, names)
        self.prefix = prefix
        self._used: set[Value] = set()

    def body(self, tape: Tape) -> list[str]:
        function = C99Printer(self.number, self.prefix, self._called)  # which has names of its own
        return function._lines(tape.written_out(UNROLLED))

    def read_by(self, tape: Tape) -> set[str]:
        """The arrays that the body of a tape reads; once linear systems are written out, that may be fewer."""
        written = tape.written_out(UNROLLED)
        used = _used_by(written)
        return {step.row[0] for step in written.steps if step.operation == "read" and step.first in used}

    def literal(self, value: float) -> str:
        return f"{value!r}{'f' if self.number == 'float' else ''}"

    def function(self, name: str) -> str:
        return f"{name}f" if self.number == "float" else name

    def _lines(self, tape: Tape) -> list[str]:
        self._used = _used_by(tape)
        steps = self.steps(tape)
        return [*steps, *(f"{array}[{k}] = {self.value(v)};" for (array, k), v in tape.outputs.items())]

    def _solver(self, operation: str) -> str:
        return f"{self.prefix}{operation}_symmetric"

    def _read(self, step: Step) -> list[str]:
        if step.row[0] == "times":
            self._names[step.first] = "t"
            return []
        return super()._read(step)

    def _sine_and_cosine(self, step: Step) -> list[str]:
        argument = self.value(step.operands[0])
        return [
            f"const {self.number} {self._names[value]} = {self.function(function)}({argument});"
            for value, function in zip(step.results, ("sin", "cos"), strict=True)
            if value in self._used
        ]


def _used_by(tape: Tape) -> set[Value]:
    return {value for step in tape.steps for value in step.operands} | {*tape.outputs.values()}
