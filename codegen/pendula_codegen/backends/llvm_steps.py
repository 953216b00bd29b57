"""The steps of tapes as LLVM's text."""

from __future__ import annotations

from collections.abc import Mapping

from pendula_codegen.backends.llvm_functions import call_of
from pendula_codegen.backends.llvm_text import LlvmFunction
from pendula_codegen.table import CONDITIONS
from pendula_codegen.tape import Row, Step, Tape, Value

_ARITHMETIC = {"add": "fadd", "subtract": "fsub", "multiply": "fmul"}


class Steps:
    """The steps of a tape, of the register that begins at the state `lane`, of so many.

    names    what values are called
    given    rows that need not be read
    arrays   where arrays are that are neither conditions nor arguments
    """

    def __init__(
        self,
        f: LlvmFunction,
        states: int,
        lane: int | str,
        given: Mapping[Row, str] | None = None,
        arrays: Mapping[str, str] | None = None,
    ):
        self.names: dict[Value, str] = {}
        self._f = f
        self._states = states
        self._lane = lane
        self._given = given or {}
        self._arrays = arrays or {}
        self._systems: dict[Value, str] = {}  # arrays of linear systems, by their first results
        self._places: dict[str, str] = {}

    def carry_out(self, tape: Tape) -> None:
        for step in tape.steps:
            self._step(step)

    def place(self, row: Row) -> str:
        f, (array, k) = self._f, row
        if array not in self._places:
            self._places[array] = f.place(self._array(array), self._lane)
        return f.place(self._places[array], k * self._states)

    def write(self, outputs: Mapping[Row, Value]) -> None:
        for row, value in outputs.items():
            self._f.write(self.place(row), self.names[value])

    def _array(self, name: str) -> str:
        if name in self._arrays:
            return self._arrays[name]
        return self._f.pointer("%at", 1 + CONDITIONS.index(name)) if name in CONDITIONS else f"%{name}"

    def _step(self, step: Step) -> None:
        f, names = self._f, self.names
        given = [names[value] for value in step.operands]
        match step.operation:
            case "number":
                names[step.first] = f.number(step.number)
            case "read":
                names[step.first] = self._given.get(step.row) or f.read(self.place(step.row))
            case "add" | "subtract" | "multiply":
                names[step.first] = f.do(_ARITHMETIC[step.operation], *given)
            case "negative":
                names[step.first] = f.let(f"fneg contract {f.numbers} {given[0]}")
            case "inverse":
                names[step.first] = f.do("fdiv", f.number(1.0), given[0])
            case "sincos":
                pair = f.let(f"call fastcc {f.pairs} @sincos.{f.width}({f.numbers} {given[0]})")
                names |= zip(step.results, f.of_pair(pair), strict=True)
            case "factor" | "solve":
                self._system(step, given)
            case _:
                names[step.first] = call_of(f, step.operation, given[0], step.number)

    def _system(self, step: Step, given: list[str]) -> None:
        """Calls the solver of a linear system that is too large to be written out, with an array."""
        f = self._f
        array = self._systems[step.first] = f.slot(f.numbers, step.count)
        places = [f.place(array, k * f.width) for k in range(step.count)]
        for place, name in zip(places, given[-step.count :], strict=True):
            f.write(place, name)
        factors = [] if step.operation == "factor" else [self._systems[step.operands[0]]]
        passed = ", ".join(f"ptr {one}" for one in (*factors, array))
        f.line(f"call fastcc void @{step.operation}.{f.width}({passed})")
        self.names |= {value: f.read(place) for value, place in zip(step.results, places, strict=True)}
