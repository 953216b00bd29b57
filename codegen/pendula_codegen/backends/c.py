"""Kernels as C: how the steps of a tape are written there, for as many states as a processor takes at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import accumulate

from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.table import CONDITIONS, KernelTable, TableFunction
from pendula_codegen.tape import Row, Step, Tape, Value

INTERFACE = 19  # system_interface of pendula/system/system_table.hpp
# Functions of one argument that are called for one number at a time.
CALLS = {"acos", "asin", "atan", "cbrt", "cosh", "sinh", "sqrt", "tan", "tanh"}
# Functions that steps do not call for these numbers of states: they are compiled for eight only, and others use those.
SELDOM = {
    **dict.fromkeys(
        (
            "acceleration_along",
            "momentum_form_along",
            "constraints_along",
            "constraint_rates_along",
            "series_start_along",
            "series_next_along",
        ),
        (1, 2, 4),
    ),
    **dict.fromkeys(("momentum_from_velocity", "mass_matrix", "energies"), (2, 4)),
}
_SIGNS = {"add": "+", "subtract": "-", "multiply": "*"}


@dataclass(frozen=True)
class CFunction:
    name: str
    text: str


def print_functions(table: KernelTable) -> list[CFunction | None]:
    """The text of the functions of many states."""
    return [
        function and CFunction(function.name, "\n".join(_of_any_width(table, function, place)))
        for place, function in enumerate(table.of_many)
    ]


def print_plain(table: KernelTable) -> list[CFunction | None]:
    return [
        function and CFunction(function.name, "\n".join(_function(function, table.names)))
        for function in table.plain
    ]


def _of_any_width(table: KernelTable, function: TableFunction, place: int) -> list[str]:
    text = _function(function, table.names)
    seldom = SELDOM.get(function.name)
    if seldom is None:
        return text
    condition = " || ".join(f"WIDTH == {width}" for width in seldom)
    return [f"#if {condition}", *_by_eight(table, function, place), "#else", *text, "#endif"]


def _function(function: TableFunction, names: Mapping[Row, str]) -> list[str]:
    tape = function.tape.written_out(UNROLLED)
    read = {step.row[0] for step in tape.steps if step.operation == "read"}
    lines = Printer(names).lines(tape)
    return [_head(function, read), "  EACH_REGISTER {", *(f"    {line}" for line in lines), "  }", "}"]


def _head(function: TableFunction, read: Set[str]) -> str:
    arguments = [("const Conditions", "at", bool(read & {*CONDITIONS}))]
    arguments += [("const double", name, name in read) for name in function.takes]
    given = {array for array, _ in function.tape.outputs}
    arguments += [("double", name, name in given) for name in function.gives]
    listed = ", ".join(f"{'' if used else 'UNUSED '}{kind} *{name}" for kind, name, used in arguments)
    return f"static void NAME({function.name})({listed}) {{"


def _by_eight(table: KernelTable, function: TableFunction, place: int) -> list[str]:
    """A function of few states that calls that of eight, with some states repeated."""
    taken = {f"at->{array}": table.rows[array] for array in CONDITIONS}
    taken |= {array: table.rows[array] for array in function.takes}
    given = {array: [name for name, _ in function.tape.outputs].count(array) for array in function.gives}
    *starts, rows = accumulate((*taken.values(), *given.values()), initial=0)
    first = dict(zip((*taken, *given), starts, strict=True))
    pointers = ", ".join(
        ["const Conditions *", *["const double *"] * len(function.takes), *["double *"] * len(given)]
    )
    places = [f"wide + {8 * first[array]}" for array in (*taken, *given)]
    conditions = ", ".join(places[: len(CONDITIONS)])
    arguments = ", ".join(["&there", *places[len(CONDITIONS) :]])
    return [
        _head(function, {*CONDITIONS, *function.takes}),
        f"  ALIGNED double wide[{8 * rows}];",
        f"  const Conditions there = {{at->context, {conditions}}};",
        *(f"  NAME(widen)({array}, {count}, wide + {8 * first[array]});" for array, count in taken.items()),
        f"  ((void (*)({pointers}))functions_8[{place}])({arguments});",
        *(f"  NAME(narrow)(wide + {8 * first[array]}, {count}, {array});" for array, count in given.items()),
        "}",
    ]


def quoted(text: str) -> str:
    """A line as a C string literal, with a newline."""
    for special, written in (("\\", "\\\\"), ('"', '\\"'), ("\t", "\\t"), ("?", "\\?")):
        text = text.replace(special, written)
    return f'"{text}\\n"'


class Statements(ABC):
    """The steps of a tape as statements, one for each number.

    number   the type of numbers
    names    the model's names of rows that are read
    """

    def __init__(self, number: str, names: Mapping[Row, str]):
        self.number = number
        self._called = names
        self._taken: set[str] = set()
        self._names: dict[Value, str] = {}
        self._numbers: dict[Value, float] = {}

    def steps(self, tape: Tape) -> list[str]:
        return [line for step in tape.steps for line in self._step(step)]

    def value(self, value: Value) -> str:
        """The text of a step's result."""
        return self._operand(value)

    # --- what subclasses write differently

    def literal(self, value: float) -> str:
        return repr(value)

    def function(self, name: str) -> str:
        """The name of a function of the mathematical library."""
        return name

    def _solver(self, operation: str) -> str:
        """The name of a function for a linear system that is too large to be written out."""
        return self.function(operation)

    def _read(self, step: Step) -> list[str]:
        array, k = step.row
        return [f"const {self.number} {self._names[step.first]} = {array}[{k}];"]

    @abstractmethod
    def _sine_and_cosine(self, step: Step) -> list[str]: ...

    # --- what they have in common

    def _step(self, step: Step) -> list[str]:
        match step.operation:
            case "number":
                self._numbers[step.first] = step.number
                return []
            case "read":
                self._names[step.first] = self._name_of(step.row)
                return self._read(step)
            case "factor" | "solve":
                return self._array(step)
        self._names |= {value: f"t{value}" for value in step.results}
        if step.operation == "sincos":
            return self._sine_and_cosine(step)
        return [f"const {self.number} t{step.first} = {self._expression(step)};"]

    def _array(self, step: Step) -> list[str]:
        name = f"t{step.first}"
        self._names |= {value: f"{name}[{k}]" for k, value in enumerate(step.results)}
        given = ", ".join(map(self.value, step.operands[-step.count :]))
        factors = ""
        if step.operation == "solve":
            factors = self._names[step.operands[0]].removesuffix("[0]") + ", "
        return [
            f"{self.number} {name}[] = {{{given}}};",
            f"{self._solver(step.operation)}({factors}{name});",
        ]

    def _expression(self, step: Step) -> str:
        if step.operation in _SIGNS:
            x, y = map(self._operand, step.operands)
            return f"{x} {_SIGNS[step.operation]} {y}"
        first = self.value(step.operands[0])
        if step.operation == "negative":
            return f"-({first})" if first.startswith("-") else f"-{first}"
        if step.operation == "inverse":
            return f"{self.literal(1.0)} / {first}"
        more = f", {self.literal(step.number)}" if step.operation == "pow" else ""
        return f"{self.function(step.operation)}({first}{more})"

    def _operand(self, value: Value) -> str:
        """An operand of an operation that also takes a plain number where others are packs."""
        return self._names.get(value) or self.literal(self._numbers[value])

    def _name_of(self, row: Row) -> str:
        """The name of a row. Names of the model get an underscore at the end, and no others do."""
        if row not in self._called:
            return "_".join(map(str, row))
        name = f"{self._called[row]}_"
        while name in self._taken:  # a parameter may be called as a momentum is
            name += "_"
        self._taken.add(name)
        return name


class Printer(Statements):
    """Statements of as many numbers as a register has.

    variables   rows that have a variable already
    conditions  arrays that are members of Conditions
    """

    def __init__(
        self,
        names: Mapping[Row, str],
        variables: Mapping[Row, str] | None = None,
        conditions: Sequence[str] = CONDITIONS,
    ):
        super().__init__("V", names)
        self._variables = variables or {}
        self._conditions = conditions

    def lines(self, tape: Tape) -> list[str]:
        steps = self.steps(tape)
        return [*steps, *(f"WRITE({name}, {k}) = {self.value(v)};" for (name, k), v in tape.outputs.items())]

    def value(self, value: Value) -> str:
        return self._names.get(value) or f"SPLAT({self._numbers[value]!r})"

    def function(self, name: str) -> str:
        return f"NAME({name})"

    def _read(self, step: Step) -> list[str]:
        if step.row in self._variables:
            self._names[step.first] = self._variables[step.row]
            return []
        array, k = step.row
        array = f"at->{array}" if array in self._conditions else array
        return [f"const V {self._names[step.first]} = READ({array}, {k});"]

    def _sine_and_cosine(self, step: Step) -> list[str]:
        sine, cosine = (self._names[value] for value in step.results)
        argument = self.value(step.operands[0])
        return [f"V {sine}, {cosine};", f"NAME(sincos)({argument}, &{sine}, &{cosine});"]
