"""The functions of a kernel that the runtime calls, in the order of pendula/system/system_table.hpp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pendula_codegen.forward import slopes
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.recording import Recorder
from pendula_codegen.series_tape import SeriesTapes, series_tapes
from pendula_codegen.tape import Row, Tape

CONDITIONS = ("parameters", "times", "inputs")  # arguments of all functions

# OF_MANY: the functions of SystemFunctions that are written from a tape. PLAIN: those of PlainFunctions.
OF_MANY = (
    "hamiltonian_form",
    "momentum_form",
    "momentum_form_with_jacobians",
    "residual_with_jacobians",
    "momentum_from_velocity",
    "velocity_from_momentum",
    "acceleration",
    "mass_matrix",
    "energies",
    "power",
    "acceleration_along",
    "momentum_form_along",
    "call_arguments",
    "constraints",
    "constraint_rates",
    "constraint_rate_slopes",
    "constraints_along",
    "constraint_rates_along",
    "series_start_along",
    "series_next_along",
)
PLAIN = ("residual", "positions", "velocities", "switches")


@dataclass(frozen=True)
class TableFunction:
    """A function of a table: arrays that it takes besides the conditions, those that it gives, and its steps."""

    name: str
    takes: tuple[str, ...]
    gives: tuple[str, ...]
    tape: Tape


@dataclass(frozen=True)
class KernelTable:
    """The functions of a model; None for those that it lacks, such as those of points.

    of_many   in the order of OF_MANY
    plain     in the order of PLAIN
    series    Taylor series of motions
    names     the model's names of rows that are read
    rows      number of rows of each array that functions take
    """

    of_many: list[TableFunction | None]
    plain: list[TableFunction | None]
    series: SeriesTapes
    names: Mapping[Row, str]
    rows: Mapping[str, int]

    def operations(self) -> set[str]:
        """All operations that the functions use."""
        functions = filter(None, (*self.of_many, *self.plain))
        tapes = [self.series.start, self.series.next, *(function.tape for function in functions)]
        return {step.operation for tape in tapes for step in tape.steps}


def kernel_table(kernel: ModelKernel) -> KernelTable:
    return _Tables(kernel).table()


class _Tables:
    def __init__(self, kernel: ModelKernel):
        self._kernel = kernel
        self._recorder = Recorder(kernel)
        self._functions = self._recorder.functions

    def table(self) -> KernelTable:
        series = series_tapes(self._kernel, self._recorder.row)
        start, following = series_functions(series)
        composed = {
            "energies": self._energies,
            "acceleration_along": lambda: _along(self._one("acceleration"), ("q", "v")),
            "momentum_form_along": lambda: self._slopes(
                "momentum_form", ("parameters", "inputs"), ("dp", "df")
            ),
        }
        if self._kernel.model.constraints:
            composed["constraints_along"] = lambda: self._slopes(
                "constraints", ("parameters",), ("dg", "d_g_D_q")
            )
            composed["constraint_rates_along"] = lambda: self._slopes(
                "constraint_rates", ("parameters", "q", "v"), ("d_g_dot", "d_g_ddot")
            )
        # The factors of larger matrices, which series keep, have no derivative here.
        if len(self._kernel.system.coordinates) <= UNROLLED:
            composed["series_start_along"] = lambda: _along(start, ("parameters", "inputs", "state"))
            composed["series_next_along"] = lambda: _along(following, ("state", "kept", "sums"))

        def of(name: str) -> TableFunction | None:
            if name in composed:
                return composed[name]()
            return self._one(name) if name in self._functions else None

        names = self._recorder.names
        return KernelTable([*map(of, OF_MANY)], [*map(of, PLAIN)], series, names, self._rows(series))

    def _rows(self, series: SeriesTapes) -> dict[str, int]:
        system = self._kernel.system
        n = len(system.coordinates)
        sizes = {"parameters": len(system.parameters), "times": 1, "inputs": len(system.inputs)}
        sizes |= dict.fromkeys(("q", "v", "a", "p"), n)
        sizes |= {"unit": 1, "order": 4, "state": 2 * n, "kept": series.kept, "sums": len(series.series.sums)}
        return sizes | {_slope_of(array): size for array, size in sizes.items()}

    # --- functions

    def _one(self, name: str) -> TableFunction:
        function, tape = self._functions[name], Tape()
        found = self._recorder.record(tape, function)
        gives = tuple(output.name for output in function.written)
        takes = tuple(argument.name for argument in function.inputs if argument.type == "vector")
        return TableFunction(name, takes, gives, tape.give(found))

    def _energies(self) -> TableFunction:
        tape, found = Tape(), {}
        for name, given in (("kinetic_energy", "kinetic"), ("energy", "total")):
            (value,) = self._recorder.record(tape, self._functions[name]).values()
            found[given, 0] = value
        return TableFunction("energies", ("q", "v"), ("kinetic", "total"), tape.give(found))

    def _slopes(self, name: str, moved: tuple[str, ...], gives: tuple[str, ...]) -> TableFunction:
        """Slopes of a function along what is moved, without its values."""
        function = self._one(name)
        whole = _along(function, moved)
        outputs = {row: value for row, value in whole.tape.outputs.items() if row[0] in gives}
        takes = (*map(_slope_of, moved), *function.takes)
        return replace(whole, takes=takes, gives=gives, tape=whole.tape.give(outputs))


def series_functions(tapes: SeriesTapes) -> tuple[TableFunction, TableFunction]:
    """The tapes of a kernel's series as functions; series_tape.py describes their arrays."""
    return (
        TableFunction("series_start", ("unit", "state"), ("next", "kept"), tapes.start),
        TableFunction("series_next", ("order", "state", "kept", "sums"), ("next", "operands"), tapes.next),
    )


def _slope_of(array: str) -> str:
    """The name of the derivative of an array: dq, d_state."""
    return f"d{array}" if len(array) == 1 else f"d_{array}"


def _along(function: TableFunction, moved: tuple[str, ...]) -> TableFunction:
    """A function and its derivative along a direction of the arrays `moved`."""
    tape = Tape()
    place = tape.repeat(function.tape)
    slope = slopes(tape, lambda row: tape.read((_slope_of(row[0]), row[1])) if row[0] in moved else None)
    values = {row: place[value] for row, value in function.tape.outputs.items()}
    changes = {
        (_slope_of(array), k): slope[value] if value in slope else tape.number(0.0)
        for (array, k), value in values.items()
    }
    return TableFunction(
        f"{function.name}_along",
        (*function.takes, *map(_slope_of, moved)),
        (*function.gives, *map(_slope_of, function.gives)),
        tape.give(values | changes),
    )
