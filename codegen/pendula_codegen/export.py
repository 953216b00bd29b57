"""A system for other people's programs: its functions, their derivatives and a Gauss step, in plain C99.

This file lists the functions; backends/c99.py writes their bodies, templates/export.c.j2 the step.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, isfinite
from pathlib import Path

from pendula_codegen.backends.c99 import NUMBERS, C99Printer
from pendula_codegen.casadi_face import Side, quoted, shapes, slopes_of
from pendula_codegen.entry_points import Declared, SystemKernel
from pendula_codegen.errors import GenerationError
from pendula_codegen.feedback import SampledLaw
from pendula_codegen.forward import slopes
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.model import CPP_KEYWORDS, Constraint
from pendula_codegen.places import Place
from pendula_codegen.program import shortest_program
from pendula_codegen.recording import Recorder
from pendula_codegen.render import ENVIRONMENT, banner
from pendula_codegen.tableau import MAX_STAGES, gauss
from pendula_codegen.tape import Row, Tape, Value

# Templates of a language, and the ending of their files after the name.
_C = {"export.h.j2": ".h", "export.c.j2": ".c"}
LANGUAGES = {
    "c": _C,
    "casadi": {**_C, "export_casadi.c.j2": "_casadi.c"},
    "fmu": _C,  # its equations: fmu.py
}
EPSILON, FLOAT_EPSILON = 2.0**-52, 2.0**-23
MOST_COORDINATES = 16  # everything is written out, and matrices are dense

# The parts of a function: entry points of the kernel, and the names and meanings of their results.
Parts = dict[str, tuple[tuple[str, str], ...]]


@dataclass(frozen=True)
class _Said:
    """A function of the state: its title, the arrays that it takes, its parts, and whether it depends on inputs."""

    title: str
    takes: tuple[str, ...]
    parts: Parts
    has_inputs: bool = False


_SINGULAR = "not finite where the mass matrix is singular"
_SAID = {
    "mass_matrix": _Said(
        "Mass matrix  M = dp/dv, symmetric", ("q",), {"mass_matrix": (("M", "mass matrix"),)}
    ),
    "momentum": _Said("Momenta  p = dL/dv", ("q", "v"), {"momentum_from_velocity": (("p", "momenta"),)}),
    "rates": _Said(
        "Rates of given momenta", ("q", "p"), {"velocity_from_momentum": (("v", f"rates; {_SINGULAR}"),)}
    ),
    "momentum_form": _Said(
        "Momentum form  p = dL/dv,  f = dL/dq + Q,  so that dq/dt = v, dp/dt = f",
        ("q", "v"),
        {"momentum_form": (("p", "momenta"), ("f", "their rates"))},
        has_inputs=True,
    ),
    "acceleration": _Said(
        "Accelerations",
        ("q", "v"),
        {"acceleration": (("a", f"accelerations; {_SINGULAR}"),)},
        has_inputs=True,
    ),
    "residual": _Said(
        "Residual of the equations of motion  E = d/dt dL/dv - dL/dq - Q",
        ("q", "v", "a"),
        {"residual": (("E", "residual"),)},
        has_inputs=True,
    ),
    "energy": _Said(
        "Energies",
        ("q", "v"),
        {
            "kinetic_energy": (("kinetic", "kinetic energy [J]"),),
            "energy": (("energy", "v dL/dv - L [J]"),),
        },
    ),
    "points": _Said("Points, one after the other", ("q",), {"positions": (("r", "positions [m]"),)}),
    "point_rates": _Said(
        "Velocities of the points", ("q", "v"), {"velocities": (("r_dot", "velocities [m/s]"),)}
    ),
    "switches": _Said(
        "Switching functions", ("q", "v"), {"switches": (("g", "switching functions"),)}, has_inputs=True
    ),
}
_TIME = ("times", 0)
_DIFFERENTIATED = ("momentum_form", "residual")  # by the kernel itself, in fewer operations than by the tape


@dataclass(frozen=True)
class Array:
    """A result of a function: `rows` times `columns` numbers, row by row."""

    name: str
    meaning: str
    rows: int
    columns: int = 1

    @property
    def count(self) -> int:
        return self.rows * self.columns

    @property
    def shape(self) -> str:
        return f"({self.rows} x {self.columns})" if self.columns > 1 else f"({self.rows})"


@dataclass(frozen=True)
class ExportedFunction:
    """A function as a tape. Parameters, time and inputs come before its own arguments."""

    name: str
    title: str
    takes: tuple[str, ...]
    gives: tuple[Array, ...]
    tape: Tape


class ExportedFunctions:
    """The functions of a kernel, each alone, with its Jacobians w.r.t. the state, and w.r.t. inputs and parameters."""

    def __init__(self, kernel: SystemKernel):
        declared = kernel.declared
        n = len(declared.coordinates)
        self._recorder = Recorder(kernel)
        self.sizes = dict.fromkeys(("q", "v", "a", "p"), n) | {
            "inputs": len(declared.inputs),
            "parameters": sum(len(parameter.symbols) for parameter in declared.parameters),
            "points": sum(count for _, count in declared.points),
            "t": 1,
        }
        self.names = self._recorder.names

    def all(self) -> list[ExportedFunction]:
        known = self._recorder.functions
        return [
            function
            for name, said in _SAID.items()
            if all(entry in known for entry in said.parts)
            for function in self._of(name, said)
        ]

    def laws(self, laws: Sequence[SampledLaw]) -> ExportedFunction:
        """Values of control laws, without their limits."""
        tape = Tape()
        assignments = [(Place("law", index=(k,)), law.value) for k, law in enumerate(laws)]
        program = shortest_program([assignments], self._recorder.kernel.plain_vocabularies())
        found = tape.record(program, self._recorder.row)
        gives = (Array("law", "one for each law, in the unit of its input", len(laws)),)
        return ExportedFunction(
            "laws", "Control laws, without their limits", ("q", "v"), gives, tape.give(found)
        )

    def _of(self, name: str, said: _Said) -> list[ExportedFunction]:
        found = [self._value(name, said), self._with_jacobians(name, said)]
        if self.sizes["inputs"] and said.has_inputs:
            found.append(self._by(name, said, "inputs"))
        if self.sizes["parameters"]:
            found.append(self._by(name, said, "parameters"))
        if self.depends_on_time:
            found.append(self._by(name, said, "t"))
        return found

    @cached_property
    def depends_on_time(self) -> bool:
        moved_by = [name for name in ("momentum_form", "switches") if name in self._recorder.functions]
        tapes = [self._recorded(name, _SAID[name].parts)[0] for name in moved_by]
        return any(step.row == _TIME for tape in tapes for step in tape.steps)

    def _recorded(self, name: str, parts: Parts) -> tuple[Tape, dict[Row, Value], list[Array]]:
        """A tape, its values by row, and the arrays that these rows belong to."""
        tape, found, arrays = Tape(), {}, []
        for entry, called in parts.items():
            function = self._recorder.functions[entry]
            values = self._recorder.record(tape, function)
            for output, (array, meaning) in zip(function.written, called, strict=True):
                own = {(array, k): value for (given, k), value in values.items() if given == output.name}
                found |= own
                size = self.sizes["q"]
                is_square = output.type == "matrix" and len(own) == size * size
                arrays.append(Array(array, meaning, *((size, size) if is_square else (len(own),))))
        return tape, found, arrays

    def _value(self, name: str, said: _Said) -> ExportedFunction:
        tape, found, arrays = self._recorded(name, said.parts)
        return ExportedFunction(name, said.title, said.takes, tuple(arrays), tape.give(found))

    def _with_jacobians(self, name: str, said: _Said) -> ExportedFunction:
        whole = f"{name}_with_jacobians"
        if name in _DIFFERENTIATED:
            called = {array: meaning for parts in said.parts.values() for array, meaning in parts}
            outputs = [output.name for output in self._recorder.functions[whole].written]
            parts = tuple((array, called.get(array) or _slope(*array.split("_D_"))) for array in outputs)
            tape, found, arrays = self._recorded(name, {whole: parts})
        else:
            tape, found, arrays = self._recorded(name, said.parts)
            arrays += [
                slope
                for by in said.takes
                for slope in self._jacobians(tape, found, arrays[: len(arrays)], by)
            ]
        return ExportedFunction(
            whole, f"{said.title}; and Jacobians by the state", said.takes, tuple(arrays), tape.give(found)
        )

    def _by(self, name: str, said: _Said, by: str) -> ExportedFunction:
        tape, found, arrays = self._recorded(name, said.parts)
        values = {*found}
        if by == "inputs":
            arrays = [array for array in arrays if array.name != "p"]  # inputs stand in forces only
        arrays = self._jacobians(tape, found, arrays, by)
        slopes_alone = {row: value for row, value in found.items() if row not in values}
        return ExportedFunction(
            f"{name}_D_{by}",
            f"{said.title}: Jacobians by {by}",
            said.takes,
            tuple(arrays),
            tape.give(slopes_alone),
        )

    def _jacobians(
        self, tape: Tape, found: dict[Row, Value], arrays: Sequence[Array], by: str
    ) -> list[Array]:
        """Adds the derivatives of arrays to `found`."""
        size, steps = self.sizes[by], [*tape.steps]
        one, zero = tape.number(1.0), tape.number(0.0)
        for column in range(size):
            moved = _TIME if by == "t" else (by, column)
            slope = slopes(tape, lambda row, moved=moved: one if row == moved else None, steps)
            for array in arrays:
                for k in range(array.count):
                    place = (f"{array.name}_D_{by}", k * size + column)
                    found[place] = slope.get(found[array.name, k], zero)
        return [Array(f"{a.name}_D_{by}", _slope(a.name, by), a.count, size) for a in arrays]


def _slope(of: str, by: str) -> str:
    return f"d{of}_row/d{by}_column"


@dataclass(frozen=True)
class Values:
    """Numbers for the start of a program: all parameters, inputs, the state (q, v), the time; and the duration."""

    parameters: Sequence[float] | None = None
    inputs: Sequence[float] | None = None
    q: Sequence[float] | None = None
    v: Sequence[float] | None = None
    time: float = 0.0
    step: float | None = None
    duration: float = 10.0


@dataclass(frozen=True)
class Request:
    """The request of a user.

    name     the prefix of all names in C
    language one of LANGUAGES
    number   double or float
    stages   of the Gauss step
    laws     of a controller that samples
    """

    name: str
    language: str = "c"
    number: str = "double"
    stages: int = 2
    values: Values = field(default_factory=Values)
    laws: Sequence[SampledLaw] = ()

    def check(self) -> None:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name) or self.name in CPP_KEYWORDS:
            raise GenerationError(
                f"export: name: expected a name of letters, digits and underscores, got {self.name!r}"
            )
        if self.number not in NUMBERS:
            raise GenerationError(f"export: number: expected double or float, got {self.number!r}")
        if self.language != "c" and self.number != "double":
            raise GenerationError(f"export: number: expected double as {self.language} has it, got float")
        if self.language == "fmu" and self.laws:
            raise GenerationError(
                "export: an FMU has no feedback that is sampled: take it out (--set system.feedback=, or "
                "chain.feedback=) and let the importer close the loop"
            )
        if not 1 <= self.stages <= MAX_STAGES:
            raise GenerationError(f"export: stages: expected 1 to {MAX_STAGES}, got {self.stages}")


def require_size(coordinates: int) -> None:
    """Raises GenerationError if there are too many coordinates."""
    if coordinates > MOST_COORDINATES:
        raise GenerationError(
            f"export: expected at most {MOST_COORDINATES} coordinates, got {coordinates}: everything is written out"
        )


def _require_smooth(switches: Sequence[str]) -> None:
    if switches:
        raise GenerationError(
            "export: casadi: expected a smooth model, got one with functions of several pieces (Piecewise, Abs, "
            "sign, ...): steps would have to end where the pieces meet. C and FMUs have functions for that"
        )


def require_free_rates(constraints: Sequence[Constraint]) -> None:
    """Raises GenerationError for constraints of rates."""
    names = ", ".join(each.name for each in constraints if each.of_rates)
    if names:
        raise GenerationError(
            f"export: expected a model without constraints of rates, got one with {names}: what is exported cannot "
            "keep them yet"
        )


def require_free(constraints: Sequence[Constraint]) -> None:
    """Raises GenerationError where there are some."""
    if constraints:
        names = ", ".join(each.name for each in constraints)
        raise GenerationError(
            f"export: expected a model without constraints, got one with {names}: C and CasADi cannot keep them yet; "
            "an FMU can (--as fmu)"
        )


def render_export(
    kernel: SystemKernel, request: Request, command: str, space: str | None = None, file: Path | None = None
) -> dict[str, str]:
    """Names of files and their text; `command`, in their banner, makes them again.

    Raises GenerationError.
    """
    request.check()
    require_size(len(kernel.declared.coordinates))
    functions = ExportedFunctions(kernel)
    sizes = functions.sizes
    printer = C99Printer(request.number, f"{request.name}_", functions.names)
    exported = functions.all() + ([functions.laws(request.laws)] if request.laws else [])
    declared = kernel.declared
    if request.language == "casadi":
        _require_smooth(declared.switches)
    tableau = gauss(request.stages)
    context = {
        "banner": banner(f"The system {kernel.system.name} in C99.", "export", space, command, file),
        "name": request.name,
        "number": request.number,
        "literal": printer.literal,
        "infinity": inf,
        "call": printer.function,
        "n": sizes["q"],
        "inputs": sizes["inputs"],
        "parameters": sizes["parameters"],
        "points": sizes["points"],
        "switches": declared.switches,
        "moment": (FLOAT_EPSILON if request.number == "float" else EPSILON) ** (2 / 3),
        "stages": request.stages,
        "depends_on_time": functions.depends_on_time,
        "a": [[printer.literal(float(x)) for x in row] for row in tableau.a],
        "b": [printer.literal(float(x)) for x in tableau.b],
        "c": [printer.literal(float(x)) for x in tableau.c],
        "functions": [_printed(printer, function) for function in exported],
        "solves": any(
            step.operation == "solve" and step.count > UNROLLED for f in exported for step in f.tape.steps
        ),
        "head": lambda function: _head(request, function),
        "side": Side,
        "quoted": quoted,
        "shapes": shapes,
        "slopes_of": slopes_of,
        "limits": "FLT" if request.number == "float" else "DBL",
        "rows": {
            "parameters": _listed((name, p.unit) for p in declared.parameters for name in p.names),
            "inputs": _listed((each.symbol.name, each.unit) for each in declared.inputs),
            "coordinates": _listed((each.symbol.name, each.unit) for each in declared.coordinates),
        },
        "laws": [
            ([each.symbol.name for each in declared.inputs].index(law.input), law.limit)
            for law in request.laws
        ],
        "values": numbers_of(declared, request.values),
        "step": request.values.step,
        "time": request.values.time,
    }
    return {
        f"{request.name}{ending}": ENVIRONMENT.get_template(template).render(context)
        for template, ending in LANGUAGES[request.language].items()
    }


def _listed(rows: Iterable[tuple[str, str]]) -> list[str]:
    return [f"{place:<3} {name}  [{unit}]" for place, (name, unit) in enumerate(rows)]


def _head(request: Request, function: ExportedFunction) -> str:
    number = request.number
    given = [f"const {number} *parameters", f"{number} t", f"const {number} *inputs"]
    given += [f"const {number} *{array}" for array in function.takes]
    given += [f"{number} *{array.name}" for array in function.gives]
    return f"void {request.name}_{function.name}({', '.join(given)})"


@dataclass(frozen=True)
class _Printed:
    function: ExportedFunction
    unused: list[str]
    body: list[str]

    @property
    def operations(self) -> int:
        return sum(1 for step in self.function.tape.steps if step.operation not in ("read", "number"))


def _printed(printer: C99Printer, function: ExportedFunction) -> _Printed:
    read = printer.read_by(function.tape)
    given = {"parameters": "parameters", "t": "times", "inputs": "inputs"} | {a: a for a in function.takes}
    unused = [name for name, array in given.items() if array not in read]
    return _Printed(function, unused, printer.body(function.tape))


def numbers_of(declared: Declared, values: Values) -> dict[str, list[float | None]]:
    """The numbers of the request; else defaults, or 1 for a parameter without a default that must be positive."""
    defaults = [
        parameter.default if parameter.default is not None else 1.0 if parameter.positive else None
        for parameter in declared.parameters
        for _ in parameter.symbols
    ]
    n = len(declared.coordinates)
    found = {
        "parameters": defaults if values.parameters is None else [*values.parameters],
        "inputs": [0.0] * len(declared.inputs) if values.inputs is None else [*values.inputs],
        "state": [*(values.q or [0.0] * n), *(values.v or [0.0] * n)],
    }
    expected = {"parameters": len(defaults), "inputs": len(declared.inputs), "state": 2 * n}
    for name, count in expected.items():
        if len(found[name]) != count:
            raise GenerationError(f"export: {name}: expected {count} numbers, got {len(found[name])}")
        if any(x is not None and not isfinite(x) for x in found[name]):
            raise GenerationError(f"export: {name}: expected finite numbers, got {found[name]}")
    return found
