"""What a step of a series begins with: order 0, constants, and the factors of the mass matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction

from sympy import Expr

from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.polynomial import as_double
from pendula_codegen.series import Series
from pendula_codegen.series_graph import Value as Scaled
from pendula_codegen.tape import Elimination, Tape, Value

# Unknowns up to which the inverse of the mass matrix is kept, not its factors: fewer steps in a row.
EXPLICIT = 3


class Constants:
    """Constants on the tape of order 0."""

    def __init__(self, tape: Tape, values: dict[Expr, Value]):
        self.tape = tape
        self._values = values

    def __call__(self, constant: Expr) -> Value:
        if constant.is_Rational:
            return self.tape.number(as_double(Fraction(int(constant.p), int(constant.q))))
        return self._values[constant]


def sign_and_size(constant: Expr) -> tuple[int, Expr]:
    return (-1, -constant) if constant.could_extract_minus_sign() else (1, constant)


class Sums:
    """Linear sums on a tape. `constant`: the value of one that has no sign."""

    def __init__(self, tape: Tape, constant: Callable[[Expr], Value]):
        self.tape = tape
        self.constant = constant

    def scaled(self, size: Expr, value: Value) -> Value:
        return value if size == 1 else self.product(self.constant(size), value)

    def linear(self, terms: Iterable[tuple[Expr, Value]], start: Value | None = None) -> Value | None:
        """Σ c x, one term after the other; None where there are none."""
        found = start
        for constant, value in terms:
            sign, size = sign_and_size(constant)
            term = self.scaled(size, value)
            if found is None:
                found = term if sign > 0 else self.tape.negative(term)
            else:
                found = self.tape.add(found, term) if sign > 0 else self.tape.subtract(found, term)
        return found

    def product(self, x: Value | None, y: Value) -> Value | None:
        if x is None or self.tape.number_of(y) == 1:
            return x
        return y if self.tape.number_of(x) == 1 else self.tape.multiply(x, y)

    def right_sides(self, series: Series, rest: Callable[[int], Value | None]) -> list[Value]:
        """Of the linear system: p or 0, less what stands on the left without the unknowns, `rest` of a node."""
        tape, right = self.tape, []
        for k, (constant, node) in enumerate(series.solved):
            left = rest(node)
            value = None if left is None else self.linear([(constant, left)])
            if series.has_momenta:
                p = tape.read(("state", series.size + k))
                right.append(p if value is None else tape.subtract(p, value))
            else:
                right.append(tape.number(0.0) if value is None else tape.negative(value))
        return right


class Start:
    """Order 0.

    kept      places of values that the other tape reads
    inverse   rows of the inverse of the mass matrix, for few unknowns
    factors   else L and 1/D of L D Lᵀ
    """

    def __init__(self, series: Series, constants: Constants):
        self._series = series
        self._graph = series.graph
        self._constants = constants
        self.tape = constants.tape
        self._sums = Sums(self.tape, constants)
        self._values: dict[int, Value] = {}
        self._slopes: dict[tuple[int, int], Value | None] = {}
        self._rests: dict[int, Value | None] = {}
        self.kept: dict[Value, int] = {}
        self.inverse: list[list[Value]] = []
        self.factors: list[Value] = []
        self._sines = {
            self._graph.nodes[place].parts[0]: place
            for place in series.order
            if self._graph.nodes[place].kind == "sin"
        }
        for place in series.order:
            if not self._graph.depends(place):
                self.at(place)
        self._solved = self._solve()
        for place in series.order:
            self.at(place)

    def keep(self, value: Value) -> int:
        return self.kept.setdefault(value, len(self.kept))

    def number(self, value: Value) -> float | None:
        """Of a value that is one."""
        return self.tape.number_of(value)

    def constant(self, size: Expr) -> Value:
        return self._constants(size)

    def give(self) -> Tape:
        series, tape = self._series, self.tape
        n = series.size
        rates = self._solved if series.has_momenta else [tape.read(("state", n + k)) for k in range(n)]
        changes = [self._output(value) for value in series.forces] if series.has_momenta else self._solved
        unit = tape.read(("unit", 0))
        given = {("next", k): tape.multiply(unit, value) for k, value in enumerate([*rates, *changes])}
        given |= {("kept", place): value for value, place in self.kept.items()}
        return tape.give(given)

    def _output(self, scaled: Scaled) -> Value:
        constant, node = scaled
        sign, size = sign_and_size(constant)
        value = self._constants(size) if node is None else self._sums.scaled(size, self.at(node))
        return value if sign > 0 else self.tape.negative(value)

    # --- values

    def at(self, place: int) -> Value:
        if place not in self._values:
            self._values[place] = self._made(place)
        return self._values[place]

    def _made(self, place: int) -> Value:
        node, tape, n = self._graph.nodes[place], self.tape, self._series.size
        match node.kind:
            case "q":
                return tape.read(("state", node.index))
            case "rate":
                return tape.read(("state", n + node.index))
            case "unknown":
                return self._solved[node.index]
            case "input":
                return tape.read(("inputs", node.index))
            case "time":
                return tape.read(("times", 0))
            case "sum":
                return self._sum(place, self.at)
            case "sin" | "cos":
                return self._sine_or_cosine(node.kind, node.parts[0])
        parts = [self.at(part) for part in node.parts]
        match node.kind:
            case "product":
                return tape.multiply(*parts)
            case "square":
                return tape.multiply(*parts, *parts)
            case "quotient":
                return tape.multiply(parts[0], tape.inverse(parts[1]))
            case "inverse":
                return tape.inverse(*parts)
            case "pow":
                exponent = node.exponent
                return tape.power(parts[0], as_double(Fraction(int(exponent.p), int(exponent.q))))
        return tape.call(node.kind, parts[0])

    def _sum(self, place: int, at: Callable[[int], Value | None]) -> Value | None:
        node = self._graph.nodes[place]
        sign, size = sign_and_size(node.offset)
        start = None
        if node.offset != 0:
            start = self._constants(size) if sign > 0 else self.tape.negative(self._constants(size))
        values = [(c, at(part)) for c, part in zip(node.coefficients, node.parts, strict=True)]
        return self._sums.linear([(c, value) for c, value in values if value is not None], start)

    def _sine_or_cosine(self, kind: str, argument: int) -> Value:
        """Of a difference of two angles by theirs, where they are needed as well."""
        tape, node = self.tape, self._graph.nodes[argument]
        if node.kind == "sum" and node.offset == 0 and len(node.parts) == 2:
            first, second = node.parts
            signs = [1 if c == 1 else -1 if c == -1 else 0 for c in node.coefficients]
            if all(signs) and first in self._sines and second in self._sines:
                s1, c1 = tape.sine_and_cosine(self.at(first))
                s2, c2 = tape.sine_and_cosine(self.at(second))
                s1 = s1 if signs[0] > 0 else tape.negative(s1)
                s2 = s2 if signs[1] > 0 else tape.negative(s2)
                if kind == "sin":
                    return tape.add(tape.multiply(s1, c2), tape.multiply(c1, s2))
                return tape.subtract(tape.multiply(c1, c2), tape.multiply(s1, s2))
        return tape.sine_and_cosine(self.at(argument))[kind == "cos"]

    # --- the linear system

    def _solve(self) -> list[Value]:
        tape, series = self.tape, self._series
        n = series.size
        zero = tape.number(0.0)
        lower = []
        for i, (constant, node) in enumerate(series.solved):
            for j in range(i + 1):
                slope = self._slope(node, j)
                lower.append(zero if slope is None else self._sums.linear([(constant, slope)]))
        right = self._sums.right_sides(series, self._rest)
        if n > UNROLLED:
            self.factors = [*tape.factor(lower)]
            return [*tape.solve(self.factors, right)]
        elimination = Elimination(tape)
        self.factors = elimination.factor(lower)
        if n <= EXPLICIT:
            units = [[tape.number(float(i == j)) for i in range(n)] for j in range(n)]
            self.inverse = [elimination.solve(self.factors, column) for column in units]
        return elimination.solve(self.factors, right)

    def _slope(self, place: int, unknown: int) -> Value | None:
        """Of what is linear in the unknowns, how it changes with one of them."""
        if (place, unknown) not in self._slopes:
            self._slopes[place, unknown] = self._slope_of(place, unknown)
        return self._slopes[place, unknown]

    def _slope_of(self, place: int, unknown: int) -> Value | None:
        node = self._graph.nodes[place]
        if not self._graph.depends(place):
            return None
        if node.kind == "unknown":
            return self.tape.number(1.0) if node.index == unknown else None
        if node.kind == "sum":
            slopes = [
                (c, self._slope(x, unknown)) for c, x in zip(node.coefficients, node.parts, strict=True)
            ]
            return self._sums.linear([(c, slope) for c, slope in slopes if slope is not None])
        x, y = node.parts
        if node.kind == "quotient":
            return self._sums.product(self._slope(x, unknown), self.tape.inverse(self.at(y)))
        moving, other = (x, y) if self._graph.depends(x) else (y, x)
        return self._sums.product(self._slope(moving, unknown), self.at(other))

    def _rest(self, place: int) -> Value | None:
        """Of the same, what it is without the unknowns; None where that is 0."""
        if place not in self._rests:
            self._rests[place] = self._rest_of(place)
        return self._rests[place]

    def _rest_of(self, place: int) -> Value | None:
        node = self._graph.nodes[place]
        if not self._graph.depends(place):
            return self.at(place)
        if node.kind == "unknown":
            return None
        if node.kind == "sum":
            return self._sum(place, self._rest)
        x, y = node.parts
        if node.kind == "quotient":
            return self._sums.product(self._rest(x), self.tape.inverse(self.at(y)))
        moving, other = (x, y) if self._graph.depends(x) else (y, x)
        return self._sums.product(self._rest(moving), self.at(other))
