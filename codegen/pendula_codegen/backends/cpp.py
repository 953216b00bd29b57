"""Kernels as C++: the only file that knows how a place, a number, a statement or a function is written there."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from pendula_codegen.entry_points import Function, SystemKernel
from pendula_codegen.model import Connection, Constraint, Coordinate, Input, Parameter
from pendula_codegen.places import Place
from pendula_codegen.polynomial import Number, as_double
from pendula_codegen.program import Program
from pendula_codegen.straight_line import UNIT, ZERO, Term

COLUMNS = 120  # of the project's style
WIDTH = 112  # of a statement inside a member function


@dataclass(frozen=True)
class Counts:
    """What a function costs; recorded per entry point, may not grow unnoticed."""

    temporaries: int
    operations: int
    trig: int

    def __str__(self) -> str:
        temporaries = _count(self.temporaries, "temporary", "temporaries")
        return f"{temporaries}, {self.arithmetic}, {self.trig} sin/cos."

    @property
    def arithmetic(self) -> str:
        return _count(self.operations, "operation", "operations")


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


@dataclass(frozen=True)
class Body:
    """The statements of a function, its costs, and which of its arguments it reads."""

    lines: list[str]
    counts: Counts
    sources: frozenset[str]


def place(where: Place, entry: Callable[[tuple[int, ...]], str]) -> str:
    """C++ for a place; `entry` writes an index."""
    return where.argument + (f".{where.field}" if where.field else "") + entry(where.index)


def eigen_entry(index: tuple[int, ...]) -> str:
    return f"[{index[0]}]" if len(index) == 1 else f"({', '.join(map(str, index))})" if index else ""


def array_entry(index: tuple[int, ...]) -> str:
    return "".join(f"[{k}]" for k in index)


def print_body(
    program: Program,
    reserved: Iterable[str] = (),
    solve: Sequence[str] = (),
    solved: int = 0,
    entry: Callable[[tuple[int, ...]], str] = eigen_entry,
    suffix: str = "",
) -> Body:
    """The statements of `program`; none of its variables is called as one of `reserved`.

    solve    statements that come after the first `solved` outputs, and make what others read
    entry    how an entry of an array is written
    suffix   of variables that are called after something of the model
    """
    return _Printer(program, reserved, entry, suffix).body(solve, solved)


class _Printer:
    def __init__(
        self, program: Program, reserved: Iterable[str], entry: Callable[[tuple[int, ...]], str], suffix: str
    ):
        self._program = program
        self._suffix = suffix
        self._graph = program.graph
        self._atoms = program.atoms
        self._entry = entry
        self._taken = {*reserved}
        self._names: dict[int, str] = {}
        for node, atom in enumerate(program.atoms):
            self._names[node] = self._free(atom.name + (suffix if atom.kind != "call" else ""))
        self._numbered = 0
        self._printed: set[int] = set()

    def _free(self, name: str) -> str:
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def body(self, solve: Sequence[str], solved: int) -> Body:
        nodes = self._program.order
        uses = Counter(child for node in nodes for child in self._graph.children(node))
        uses.update(node for _, node in self._program.outputs)
        known = self._program.needed_by(solved) if solve else 0
        outputs = [*zip(self._program.targets, self._program.outputs, strict=True)]
        lines, temporaries = self._part(nodes[:known], outputs[:solved] if solve else [], uses)
        more, others = self._part(nodes[known:], outputs[solved:] if solve else outputs, uses)
        return Body(
            lines=[piece for line in [*lines, *solve, *more] for piece in wrap(line)],
            counts=Counts(temporaries + others, self._program.operations, self._program.trig),
            sources=frozenset(self._atoms[node].place.argument for node in nodes if self._is_read(node)),
        )

    def _part(
        self, nodes: Sequence[int], outputs: Sequence[tuple[Place, Term]], uses: Counter
    ) -> tuple[list[str], int]:
        """Statements for some nodes and the outputs that need no others, and how many temporaries they are."""
        lines = self._fetch(nodes)
        computed = [self._temporary(node) for node in nodes if self._is_temporary(node, uses[node])]
        lines += [line for lines_of_one in computed for line in lines_of_one]
        lines += [self._statement(place(target, self._entry), term) for target, term in outputs]
        return lines, len(computed)

    def _is_read(self, node: int) -> bool:
        return node < len(self._atoms) and self._atoms[node].place is not None

    def _fetch(self, nodes: Sequence[int]) -> list[str]:
        """References to what is read, then sines and cosines, as the arguments have them."""
        leaves = sorted(
            (node for node in nodes if self._is_read(node)), key=lambda k: self._atoms[k].position
        )
        lines: list[str] = []
        for node in leaves:
            atom = self._atoms[node]
            where = place(atom.place, self._entry)
            if atom.function:
                lines += self._sine_or_both(node, where)
            else:
                lines.append(f"const Real& {self._names[node]} = {where};")
        return lines

    def _sine_or_both(self, node: int, argument: str) -> list[str]:
        """A sine or a cosine; both of the same argument at once, where both are needed."""
        if node in self._printed:
            return []
        function = self._atoms[node].function
        other = self._partner(node)
        if other is None:
            return [f"const Real {self._names[node]} = {function}({argument});"]
        self._printed |= {node, other}
        sine, cosine = (node, other) if function == "sin" else (other, node)
        names = f"{self._names[sine]}, {self._names[cosine]}"
        return [f"Real {names};", f"sine_and_cosine({argument}, {names});"]

    def _partner(self, node: int) -> int | None:
        """The cosine that goes with a sine, or the sine with a cosine, where the program needs it."""
        atom = self._atoms[node]
        wanted = "cos" if atom.function == "sin" else "sin"
        for other in self._program.order:
            twin = self._atoms[other] if other < len(self._atoms) else None
            if twin and (twin.function, twin.place, twin.argument) == (wanted, atom.place, atom.argument):
                return other
        return None

    def _is_temporary(self, node: int, uses: int) -> bool:
        if node in self._graph.definitions:
            return True
        if node < len(self._atoms):
            return False
        is_alias = len(self._graph.products.get(node, (0, 0))) == 1
        return uses > 1 and not is_alias

    def _temporary(self, node: int) -> list[str]:
        if node in self._graph.definitions and self._atoms[node].function:
            return self._call(node)
        if node in self._graph.definitions:
            return [self._statement(f"const Real {self._names[node]}", self._graph.definitions[node])]
        text = self._expression(node)
        self._names[node] = self._name(node)
        return [f"const Real {self._names[node]} = {text};"]

    def _call(self, node: int) -> list[str]:
        """A function of a polynomial."""
        function = self._atoms[node].function
        argument = self._value(self._graph.definitions[node])
        if function in ("sin", "cos"):
            return self._sine_or_both(node, argument)
        if function == "inverse":
            value = f"Real(1.0) / {argument if argument.isidentifier() else f'({argument})'}"
        elif isinstance(function, tuple):
            value = f"pow({argument}, {_number(function[1])})"
        else:
            value = f"{function}({argument})"
        return [f"const Real {self._names[node]} = {value};"]

    def _name(self, node: int) -> str:
        """Products of two atoms are called after them; other temporaries are numbered."""
        factors = self._graph.products.get(node, ())
        if len(factors) == 2 and all(f < len(self._atoms) for f in factors):
            first, second = sorted((self._atoms[f] for f in factors), key=lambda atom: atom.position)
            name = f"{first.name}_squared" if first == second else f"{first.name}_{second.name}"
            name += self._suffix
            if name not in self._taken:
                return self._free(name)
        self._numbered += 1
        return self._free(f"t{self._numbered}")

    def _statement(self, target: str, term: Term) -> str:
        return f"{target} = {self._value(term)};"

    def _value(self, term: Term) -> str:
        coefficient, node = term
        if term == ZERO:
            return "Real(0.0)"
        if node == UNIT:
            return _number(coefficient)
        return self._scaled(coefficient, node)

    def _scaled(self, coefficient: Number, node: int) -> str:
        if coefficient == 1:
            return self._expression(node)
        terms = self._graph.sums.get(node, ()) if node not in self._names else ()
        if coefficient == -1 and any(scale < 0 for scale, _ in terms):
            return self._sum([(-scale, part) for scale, part in terms])
        return _scale(coefficient, self._factor(node))

    def _expression(self, node: int) -> str:
        if node in self._names:
            return self._names[node]
        if node in self._graph.products:
            return " * ".join(self._factor(f) for f in self._graph.products[node])
        return self._sum(self._graph.sums[node])

    def _factor(self, node: int) -> str:
        text = self._expression(node)
        return f"({text})" if node not in self._names and node in self._graph.sums else text

    def _sum(self, terms: Sequence[Term]) -> str:
        """A positive term first, so that no sum begins with a sign."""
        text = ""
        for coefficient, node in sorted(terms, key=lambda term: term[0] < 0):
            size = abs(coefficient)
            piece = _number(size) if node == UNIT else _scale(size, self._factor(node))
            if not text:
                text = piece if coefficient > 0 else f"-{piece}"
            else:
                text += f" {'+' if coefficient > 0 else '-'} {piece}"
        return text


def _number(value: Number) -> str:
    double = as_double(value)
    if (
        value.denominator & (value.denominator - 1) == 0
        or max(abs(value.numerator), value.denominator) > 2**53
    ):
        return f"Real({double!r})"
    return f"Real({value.numerator}.0 / {value.denominator}.0)"


def _scale(coefficient: Number, text: str) -> str:
    if abs(coefficient) == 1:
        return text if coefficient > 0 else f"-{text}"
    return f"{_number(coefficient)} * {text}"


def wrap(line: str) -> list[str]:
    """A statement broken at spaces to the width of the project's style."""
    return textwrap.wrap(
        line, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )


# --- functions

TYPES = {
    "scalar": "Real",
    "parameters": "Parameters<Real>",
    "inputs": "Inputs<Real>",
    "vector": "Vector<Real>",
    "matrix": "Matrix<Real>",
    "points": "Points<Real>",
    "arguments": "Arguments<Real>",
    "switches": "Switches<Real>",
    "constraints": "Constraints<Real>",
    "constraint_slopes": "ConstraintSlopes<Real>",
    "link_vector": "LinkVector<Real>",
    "link_matrix": "LinkMatrix<Real>",
}


@dataclass(frozen=True)
class RenderedFunction:
    """A member function: its name, doc comment, parameters and statements."""

    name: str
    documentation: list[str]
    arguments: list[str]
    lines: list[str]
    counts: Counts


def render_function(kernel: SystemKernel, function: Function) -> RenderedFunction:
    program = kernel.program(function)
    names = [argument.name for argument in function.inputs] + [output.name for output in function.written]
    solve = function.solve
    if solve is None:
        body = print_body(program, names, suffix=kernel.suffix)
    else:
        local, solution = solve.matrix, solve.solution
        steps = [f"solve_symmetric({local.name}, {solution.name});"]
        taken = [*names, local.name]
        body = print_body(program, taken, steps, len(solve.assignments), suffix=kernel.suffix)
    declared = [] if solve is None else [f"{TYPES[solve.matrix.type]} {solve.matrix.name};"]
    # An input that the mathematics does not need stays, unnamed.
    read = [
        f"const {TYPES[argument.type]}& {argument.name if argument.name in body.sources else f'/*{argument.name}*/'}"
        for argument in function.inputs
    ]
    return RenderedFunction(
        function.name,
        documentation(function, body.counts),
        [*read, *(f"{TYPES[output.type]}& {output.name}" for output in function.written)],
        [*declared, *body.lines],
        body.counts,
    )


def documentation(function: Function, counts: Counts) -> list[str]:
    """Doc comment of a function: equation, outputs with shapes and units, counts."""
    rows = [(output.name, f"out, {output.meaning}", output.unit) for output in function.written]
    width = max(len(row[0]) for row in rows) + 2
    column = max(len(row[1]) for row in rows) + 2
    lines = [f"{name:<{width}}{meaning:<{column}}{unit}".rstrip() for name, meaning, unit in rows]
    return [function.title, "", *lines, str(counts)]


def signature(name: str, arguments: list[str]) -> str:
    """First lines of a static member function, broken at arguments to the width of the project's style."""
    head = f"  static void {name}("
    lines = [head]
    for k, argument in enumerate(arguments):
        piece = argument + (") {" if k == len(arguments) - 1 else ",")
        if len(lines[-1]) + 1 + len(piece) > COLUMNS:
            lines.append(" " * len(head) + piece)
        else:
            lines[-1] += piece if lines[-1].endswith("(") else f" {piece}"
    return "\n".join(lines)


def literal(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    return "std::numeric_limits<double>::quiet_NaN()" if value is None else repr(value)


def struct_name(name: str) -> str:
    """What programs call the kernel planar_2: Planar2."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def matrix(rows: int | str, columns: int | str) -> str:
    return f"::Eigen::Matrix<Real, {rows}, {columns}>"


def parameter_field(parameter: Parameter) -> str:
    """The field of a parameter in the structure Parameters, whose number type has a name that no parameter has."""
    kind = "::Eigen::Matrix<_real, links, 1>" if parameter.per_link else "_real"
    return f"{kind} {parameter.name};  ///< {parameter.unit}"


def constants(
    coordinates: Sequence[Coordinate],
    parameters: Sequence[Parameter],
    inputs: Sequence[Input],
    points: Sequence[tuple[str, int]],
    constant_masses: bool,
    periodic: Sequence[bool],
    bases: Sequence[bool] = (),
    switches: Sequence[str] = (),
    point_kinds: Sequence[str] = (),
    connections: Sequence[Connection] = (),
    constraints: Sequence[Constraint] = (),
) -> list[str]:
    """Static members by which a kernel says what it is; the last five where there are any."""
    members = [
        ("std::string_view", "coordinate_names", [c.symbol.name for c in coordinates]),
        ("std::string_view", "coordinate_units", [c.unit for c in coordinates]),
        ("bool", "coordinate_is_angle", [c.is_angle for c in coordinates]),
        ("bool", "coordinate_is_periodic", list(periodic)),
        ("std::string_view", "parameter_names", [p.name for p in parameters]),
        ("std::string_view", "parameter_units", [p.unit for p in parameters]),
        ("int", "parameter_sizes", [len(p.symbols) for p in parameters]),
        ("double", "parameter_defaults", [p.default for p in parameters]),
        ("bool", "parameter_is_positive", [p.positive for p in parameters]),
        ("bool", "parameter_is_per_link", [p.per_link for p in parameters]),
        ("std::string_view", "input_names", [i.symbol.name for i in inputs]),
        ("std::string_view", "input_units", [i.unit for i in inputs]),
        ("std::string_view", "point_names", [name for name, _ in points]),
        ("int", "point_sizes", [size for _, size in points]),
        *([("bool", "argument_is_base", list(bases))] if bases else []),
        *([("std::string_view", "switch_names", list(switches))] if switches else []),
        *([("std::string_view", "point_kinds", list(point_kinds))] if point_kinds else []),
    ]
    if connections:
        members += [
            ("std::string_view", "connection_kinds", [each.kind for each in connections]),
            ("int", "connection_ends", [end for each in connections for end in each.ends]),
        ]
    if constraints:
        members += [
            ("std::string_view", "constraint_names", [each.name for each in constraints]),
            ("std::string_view", "constraint_units", [each.unit for each in constraints]),
            ("bool", "constraint_is_of_rates", [each.of_rates for each in constraints]),
        ]
    lines = []
    for element, name, values in members:
        head = f"static constexpr std::array<{element}, {len(values)}> {name} = {{"
        pieces = [f"{literal(value)}," for value in values[:-1]] + [literal(value) for value in values[-1:]]
        lines += fill(head, [*pieces[:-1], f"{pieces[-1]}}};"] if pieces else ["};"])
    return [f"static constexpr bool constant_masses = {literal(constant_masses)};", *lines]


def statements_of_numbers(parameters: Sequence[Parameter], statement: Callable[[str, str], str]) -> list[str]:
    """statement(place of a number, name of what it belongs to) for all numbers, one after the other."""
    lines, at = [], 0
    for parameter in parameters:
        name, size = parameter.name, len(parameter.symbols)
        if parameter.per_link:
            lines.append(f"for (unsigned i = 0; i < {size}; ++i) {statement(f'{at} + i', f'{name}[i]')}")
        else:
            lines.append(statement(str(at), name))
        at += size
    return lines


def read_statements(parameters: Sequence[Parameter]) -> list[str]:
    """Statements that read parameters out of numbers."""
    return statements_of_numbers(parameters, lambda place, name: f"to.{name} = Real(from[{place}]);")


def place_statements(parameters: Sequence[Parameter]) -> list[str]:
    """Statements that tell where each of those numbers is kept."""
    return statements_of_numbers(parameters, lambda place, name: f"places[{place}] = &of.{name};")


def cast_statements(parameters: Sequence[Parameter], holds_time: bool) -> list[str]:
    """Statements that convert parameters from one number type to another."""
    lines = [
        f"for (int i = 0; i < {len(p.symbols)}; ++i) to.{p.name}[i] = To(from.{p.name}[i]);"
        if p.per_link
        else f"to.{p.name} = To(from.{p.name});"
        for p in parameters
    ]
    return [*lines, "to.time = To(from.time);"] if holds_time else lines


_MATH = re.compile(r"\b(sin|cos|tan|asin|acos|atan|sinh|cosh|tanh|exp|log|sqrt|cbrt|pow)\(")


def using_declarations(function: RenderedFunction) -> list[str]:
    """By which the functions of the standard library are found beside those of Real's namespace."""
    used = sorted({name for line in function.lines for name in _MATH.findall(line)})
    return [f"using {', '.join(f'std::{name}' for name in used)};"] if used else []


def fill(head: str, pieces: Sequence[str]) -> list[str]:
    """`head` and pieces one after the other, broken between pieces to the width of a statement."""
    lines = [head]
    for piece in pieces:
        if len(lines[-1]) + 1 + len(piece) > WIDTH:
            lines.append(f"    {piece}")
        else:
            lines[-1] += piece if lines[-1].endswith("{") else f" {piece}"
    return lines
