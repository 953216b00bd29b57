"""A function as a tape: a list of operations, each on results of earlier ones.

A Program names only what is shared; a tape has a step for every operation, so that it can be differentiated, printed
in a language without expressions, or interpreted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isqrt

from pendula_codegen.places import Place
from pendula_codegen.polynomial import Call, Number, as_double
from pendula_codegen.program import Program
from pendula_codegen.straight_line import UNIT, Term

Value = int  # results are numbered through; a step with several has as many in a row
Row = tuple[str, int]  # an array that a function is given or gives, and which of its numbers


@dataclass(frozen=True)
class Step:
    """One operation.

    operation   number, read; add, subtract, multiply, negative, inverse; sincos, a function of one argument, pow;
                factor, solve: see Tape
    operands    the values that it takes
    first       its first result
    count       how many it has
    number      of a number itself; the exponent of pow
    row         what is read
    """

    operation: str
    operands: tuple[Value, ...]
    first: Value
    count: int = 1
    number: float = 0.0
    row: Row = ("", 0)

    @property
    def results(self) -> range:
        return range(self.first, self.first + self.count)


class Tape:
    """Steps as they are added, one of several equal ones.

    outputs   what they are for
    values    how many there are
    """

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.outputs: dict[Row, Value] = {}
        self._known: dict[tuple, Value] = {}
        self._numbers: dict[Value, float] = {}
        self.values = 0

    def _add(self, operation: str, *operands: Value, count: int = 1, **more: object) -> Value:
        key = (operation, operands, *more.items())
        if key not in self._known:
            self._known[key] = self.append(Step(operation, operands, self.values, count, **more))
        return self._known[key]

    def append(self, step: Step) -> Value:
        self.steps.append(step)
        self.values += step.count
        return step.first

    def number(self, value: float) -> Value:
        found = self._add("number", number=value)
        self._numbers[found] = value
        return found

    def number_of(self, value: Value) -> float | None:
        """Of a value that is a number."""
        return self._numbers.get(value)

    def read(self, row: Row) -> Value:
        return self._add("read", row=row)

    # What only numbers go into is computed here. In C it would be one double, where packs are expected.

    def add(self, x: Value, y: Value) -> Value:
        if x in self._numbers and y in self._numbers:
            return self.number(self._numbers[x] + self._numbers[y])
        return self._add("add", *sorted((x, y)))

    def subtract(self, x: Value, y: Value) -> Value:
        if x in self._numbers and y in self._numbers:
            return self.number(self._numbers[x] - self._numbers[y])
        return self._add("subtract", x, y)

    def multiply(self, x: Value, y: Value) -> Value:
        if x in self._numbers and y in self._numbers:
            return self.number(self._numbers[x] * self._numbers[y])
        return self._add("multiply", *sorted((x, y)))

    def negative(self, x: Value) -> Value:
        return self.number(-self._numbers[x]) if x in self._numbers else self._add("negative", x)

    def inverse(self, x: Value) -> Value:
        return self._add("inverse", x)

    def sine_and_cosine(self, x: Value) -> tuple[Value, Value]:
        first = self._add("sincos", x, count=2)
        return first, first + 1

    def call(self, function: Call, x: Value) -> Value:
        """A function of one argument, as the vocabulary has it."""
        if function in ("sin", "cos"):
            return self.sine_and_cosine(x)[function == "cos"]
        if isinstance(function, tuple):
            return self.power(x, as_double(function[1]))
        return self._add(function, x) if function else x

    def power(self, x: Value, exponent: float) -> Value:
        return self._add("pow", x, number=exponent)

    def factor(self, lower: Sequence[Value]) -> range:
        """L and 1/D of a symmetric matrix L D Lᵀ, both given as lower triangles row by row.

        L stands below the diagonal, where it is 1, and 1/D on it.
        """
        first = self._add("factor", *lower, count=len(lower))
        return range(first, first + len(lower))

    def solve(self, factors: Sequence[Value], b: Sequence[Value]) -> range:
        """x of L D Lᵀ x = b."""
        first = self._add("solve", *factors, *b, count=len(b))
        return range(first, first + len(b))

    def record(
        self, program: Program, row: Callable[[Place], Row], solved: Solved | None = None
    ) -> dict[Row, Value]:
        """Adds the steps of a program; its results by where they belong."""
        return _Recording(self, program, row).run(solved)

    def repeat(self, other: Tape) -> dict[Value, Value]:
        """Adds the steps of another tape; where each of its values stands here."""
        place: dict[Value, Value] = {}
        for step in other.steps:
            operands = (place[value] for value in step.operands)
            if step.operation == "number":
                first = self.number(step.number)
            elif step.operation in ("read", "pow"):
                more = {"row": step.row} if step.operation == "read" else {"number": step.number}
                first = self._add(step.operation, *operands, **more)
            else:
                first = self._add(step.operation, *operands, count=step.count)
            place |= {value: first + k for k, value in enumerate(step.results)}
        return place

    def give(self, outputs: Mapping[Row, Value]) -> Tape:
        """The same tape with these outputs, and without steps that none of them needs."""
        needed, steps = {*outputs.values()}, []
        for step in reversed(self.steps):
            if not needed.isdisjoint(step.results):
                needed.update(step.operands)
                steps.append(step)
        short, place = Tape(), {}
        for step in reversed(steps):
            operands = tuple(place[value] for value in step.operands)
            first = short.append(replace(step, operands=operands, first=short.values))
            place |= {value: first + k for k, value in enumerate(step.results)}
        short.outputs = {row: place[value] for row, value in outputs.items()}
        return short

    def written_out(self, size: int) -> Tape:
        """The same tape with linear systems of up to so many unknowns in products and sums."""
        whole, place = Tape(), {}
        elimination = Elimination(whole)
        for step in self.steps:
            operands = [place[value] for value in step.operands]
            if step.operation == "factor" and step.count <= triangle(size):
                results = elimination.factor(operands)
            elif step.operation == "solve" and step.count <= size:
                entries = triangle(step.count)
                results = elimination.solve(operands[:entries], operands[entries:])
            elif step.operation == "number":
                results = [whole.number(step.number)]
            else:
                first = whole.append(replace(step, operands=(*operands,), first=whole.values))
                results = range(first, first + step.count)
            place |= zip(step.results, results, strict=True)
        return whole.give({row: place[value] for row, value in self.outputs.items()})


class Elimination:
    """Linear systems in products and sums, but for those with what is known to be 0 or 1."""

    def __init__(self, tape: Tape):
        self._tape = tape
        self._zero, self._one = tape.number(0.0), tape.number(1.0)

    def factor(self, lower: Sequence[Value]) -> list[Value]:
        """L and 1/D."""
        size = unknowns(len(lower))
        a = {(i, j): lower[triangle(i) + j] for i in range(size) for j in range(i + 1)}
        for k in range(size):
            a[k, k] = self._tape.inverse(a[k, k])
            column = {i: a[i, k] for i in range(k + 1, size)}
            for i, entry in column.items():
                a[i, k] = self._product(entry, a[k, k])
                for j in range(k + 1, i + 1):
                    a[i, j] = self._less(a[i, j], a[i, k], column[j])
        return [*a.values()]

    def solve(self, factors: Sequence[Value], b: Sequence[Value]) -> list[Value]:
        x = [*b]
        for k in range(len(x)):
            for i in range(k + 1, len(x)):
                x[i] = self._less(x[i], factors[triangle(i) + k], x[k])
        for k in reversed(range(len(x))):
            x[k] = self._product(x[k], factors[triangle(k) + k])
            for i in range(k + 1, len(x)):
                x[k] = self._less(x[k], factors[triangle(i) + k], x[i])
        return x

    def _product(self, x: Value, y: Value) -> Value:
        if self._zero in (x, y):
            return self._zero
        if self._one in (x, y):
            return y if x == self._one else x
        return self._tape.multiply(x, y)

    def _less(self, x: Value, factor: Value, y: Value) -> Value:
        """x − factor y."""
        product = self._product(factor, y)
        if product == self._zero:
            return x
        return self._tape.negative(product) if x == self._zero else self._tape.subtract(x, product)


@dataclass(frozen=True)
class Solved:
    """That a program begins with a linear system: the lower triangle of a matrix, row by row, and a right-hand side.

    solution   the array that has the solution, from where other outputs read it
    size       unknowns
    """

    solution: str
    size: int


def triangle(size: int) -> int:
    """Numbers in the lower triangle of a matrix."""
    return size * (size + 1) // 2


def unknowns(entries: int) -> int:
    """The size of a matrix that has so many numbers in its lower triangle."""
    return (isqrt(8 * entries + 1) - 1) // 2


class _Recording:
    """Puts a program on a tape."""

    def __init__(self, tape: Tape, program: Program, row: Callable[[Place], Row]):
        self._tape = tape
        self._program = program
        self._row = row
        self._value: dict[int, Value] = {}  # of a node
        self._solution: dict[Row, Value] = {}

    def run(self, solved: Solved | None) -> dict[Row, Value]:
        program = self._program
        known = 0
        if solved is not None:
            entries = triangle(solved.size)
            system = program.outputs[: entries + solved.size]
            known = program.needed_by(len(system))
            self._make(program.order[:known])
            lower, b = self._terms(system[:entries]), self._terms(system[entries:])
            x = self._tape.solve(self._tape.factor(lower), b)
            self._solution = {(solved.solution, k): value for k, value in enumerate(x)}
        self._make(program.order[known:])
        first = 0 if solved is None else len(system)
        values = self._terms(program.outputs[first:])
        return self._solution | dict(zip(map(self._row, program.targets[first:]), values, strict=True))

    def _make(self, nodes: Iterable[int]) -> None:
        for node in nodes:
            self._value[node] = self._made(node)

    def _made(self, node: int) -> Value:
        graph, tape = self._program.graph, self._tape
        if node in graph.products:
            product, *others = (self._value[factor] for factor in graph.products[node])
            for factor in others:
                product = tape.multiply(product, factor)
            return product
        if node in graph.sums:
            return self._sum(graph.sums[node])
        atom = self._program.atoms[node]
        if node in graph.definitions:
            return tape.call(atom.function, self._term(graph.definitions[node]))
        row = self._row(atom.place)
        return tape.call(atom.function, self._solution[row] if row in self._solution else tape.read(row))

    def _terms(self, terms: Iterable[Term]) -> list[Value]:
        return [self._term(term) for term in terms]

    def _term(self, term: Term) -> Value:
        coefficient, node = term
        sums = self._program.graph.sums
        if coefficient == -1 and any(scale < 0 for scale, _ in sums.get(node, ())):
            return self._sum([(-scale, part) for scale, part in sums[node]])
        if coefficient == -1 and node != UNIT:
            return self._tape.negative(self._value[node])
        return self._scaled(coefficient, node)

    def _scaled(self, coefficient: Number, node: int) -> Value:
        if coefficient == 1 and node != UNIT:
            return self._value[node]
        number = self._tape.number(as_double(coefficient))
        return number if node == UNIT or not coefficient else self._tape.multiply(number, self._value[node])

    def _sum(self, terms: Sequence[Term]) -> Value:
        """Positive terms first, so that no sum begins with a sign."""
        found = None
        for coefficient, node in sorted(terms, key=lambda term: term[0] < 0):
            if found is None:
                found = self._term((coefficient, node))
            elif coefficient > 0:
                found = self._tape.add(found, self._scaled(coefficient, node))
            else:
                found = self._tape.subtract(found, self._scaled(-coefficient, node))
        return found
