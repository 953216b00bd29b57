"""Functions of a kernel on tapes: in which row of which array each of their numbers stands."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate

from sympy import Matrix

from pendula_codegen.entry_points import Function, SystemKernel
from pendula_codegen.places import Place
from pendula_codegen.program import Program
from pendula_codegen.tape import Row, Solved, Tape, Value

_BY_ROWS = ("matrix", "constraint_slopes")
Strides = Mapping[str, tuple[int, int]]  # strides of arrays with two indices


class Recorder:
    """Records functions of a kernel.

    functions   all functions of the kernel, by name
    names       the model's names of rows that are read
    """

    def __init__(self, kernel: SystemKernel):
        self.kernel = kernel
        self.functions = {function.name: function for function in kernel.functions()}
        self._programs: dict[str, Program] = {}
        sizes = {parameter.name: len(parameter.symbols) for parameter in kernel.declared.parameters}
        self._parameters = dict(zip(sizes, accumulate(sizes.values(), initial=0), strict=False))
        leaves = (*kernel.leaves(), *kernel.motion())
        self.names = {self.row(leaf.place): leaf.symbol.name for leaf in leaves}

    def record(self, tape: Tape, function: Function) -> dict[Row, Value]:
        """Adds the steps of a function. Returns its results by row."""
        solve = function.solve
        solved = None if solve is None else Solved(solve.solution.name, len(solve.unknowns))
        strides = {
            output.name: (output.value.cols, 1) if output.type in _BY_ROWS else (1, output.value.rows)
            for output in function.written
            if isinstance(output.value, Matrix)
        }
        if function.name not in self._programs:
            self._programs[function.name] = self.kernel.program(function)
        return tape.record(self._programs[function.name], lambda place: self.row(place, strides), solved)

    def row(self, place: Place, strides: Strides | None = None) -> Row:
        """The row of a place."""
        if place.field == "time":
            return "times", 0
        if place.field:
            return "parameters", self._parameters[place.field] + sum(place.index)
        if place.argument == self.kernel.inputs.name:
            return "inputs", _offset(place, (1, self.kernel.input_rows))
        return place.argument, _offset(place, (strides or {}).get(place.argument, (1, 1)))


def _offset(place: Place, strides: tuple[int, int]) -> int:
    return sum(k * size for k, size in zip(place.index, strides, strict=False))
