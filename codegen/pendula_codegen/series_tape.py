"""Series as two tapes: what a step begins with, and what each order takes.

Arrays that they read and give, by row:

    state      coefficients of one order: of q, then of p, or of v in the form of second order
    next       those of the following order
    unit       the unit of time, s, in powers of which the series is
    kept       what the first tape hands to the second one: constants, factors of the mass matrix, values at order 0
    order      k, 1/k, unit/(k + 1), and the coefficient of time: unit for k = 1, then 0
    sums       Σ A_j B_(k−j), 0 < j < k, of all pairs of operands
    operands   their coefficients of order k, by which later sums are made
    inputs     coefficients of the inputs: of order 0, or k
    times      t at order 0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from sympy import Expr

from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.places import Place
from pendula_codegen.polynomial import as_double
from pendula_codegen.program import shortest_program
from pendula_codegen.series import Series, series_of
from pendula_codegen.series_graph import Value as Scaled
from pendula_codegen.tape import Elimination, Row, Tape, Value

EXPLICIT = (
    3  # unknowns up to which the inverse of the mass matrix is kept, not its factors: fewer steps in a row
)


@dataclass(frozen=True)
class SeriesTapes:
    """start: order 0; next: order k from 1 on; kept: how many numbers go from the first to the second."""

    series: Series
    start: Tape
    next: Tape
    kept: int

    @property
    def operations(self) -> int:
        """Of an order, beside its sums."""
        return sum(1 for step in self.next.steps if step.operation not in ("read", "number"))


def series_tapes(
    kernel: SystemKernel, row: Callable[[Place], Row], series: Series | None = None
) -> SeriesTapes:
    """The series of a kernel, in its best form if none is given; `row`: where parameters stand."""
    series = series or series_of(kernel)
    start = _Start(series, _constants(kernel, series, row))
    following = _Next(series, start).give()  # which says what is kept
    return SeriesTapes(series, start.give(), following, len(start.kept))


class _Constants:
    """Constants on the tape of order 0."""

    def __init__(self, tape: Tape, values: dict[Expr, Value]):
        self.tape = tape
        self._values = values

    def __call__(self, constant: Expr) -> Value:
        if constant.is_Rational:
            return self.tape.number(as_double(Fraction(int(constant.p), int(constant.q))))
        return self._values[constant]


def _constants(kernel: SystemKernel, series: Series, row: Callable[[Place], Row]) -> _Constants:
    nodes = [series.graph.nodes[place] for place in series.order]
    held = [c for node in nodes for c in (*node.coefficients, node.offset)]
    held += [c for c, _ in (*series.solved, *series.forces)]
    sizes = dict.fromkeys(_sign_and_size(c)[1] for c in held)
    wanted = [size for size in sizes if not size.is_Rational]
    tape = Tape()
    if not wanted:
        return _Constants(tape, {})
    assignments = [(Place("constants", index=(k,)), constant) for k, constant in enumerate(wanted)]
    program = shortest_program([assignments], kernel.shared_vocabularies)

    def row_of(place: Place) -> Row:
        return ("constants", place.index[0]) if place.argument == "constants" else row(place)

    found = tape.record(program, row_of)
    return _Constants(tape, {c: found["constants", k] for k, c in enumerate(wanted)})


def _sign_and_size(constant: Expr) -> tuple[int, Expr]:
    return (-1, -constant) if constant.could_extract_minus_sign() else (1, constant)


class _Sums:
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
            sign, size = _sign_and_size(constant)
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

    def plus(self, x: Value | None, y: Value | None) -> Value | None:
        if x is None or y is None:
            return y if x is None else x
        return self.tape.add(x, y)


class _Start:
    """Order 0.

    kept      places of values that the other tape reads
    inverse   rows of the inverse of the mass matrix, for few unknowns
    factors   else L and 1/D of L D Lᵀ
    """

    def __init__(self, series: Series, constants: _Constants):
        self._series = series
        self._graph = series.graph
        self._constants = constants
        self.tape = constants.tape
        self._sums = _Sums(self.tape, constants)
        self._values: dict[int, Value] = {}
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
        sign, size = _sign_and_size(constant)
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
        sign, size = _sign_and_size(node.offset)
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
                slope = None if node is None else self._slope(node, j)
                lower.append(zero if slope is None else self._times_constant(constant, slope))
        right = []
        for k, (constant, node) in enumerate(series.solved):
            rest = constant if node is None else self._rest(node)
            value = self._constant_of(rest) if node is None else rest
            if value is not None and node is not None:
                value = self._times_constant(constant, value)
            if series.has_momenta:
                p = tape.read(("state", n + k))
                right.append(p if value is None else tape.subtract(p, value))
            else:
                right.append(zero if value is None else tape.negative(value))
        if n > UNROLLED:
            self.factors = [*tape.factor(lower)]
            return [*tape.solve(self.factors, right)]
        elimination = Elimination(tape)
        self.factors = elimination.factor(lower)
        if n <= EXPLICIT:
            units = [[tape.number(float(i == j)) for i in range(n)] for j in range(n)]
            self.inverse = [elimination.solve(self.factors, column) for column in units]
        return elimination.solve(self.factors, right)

    def _constant_of(self, constant: Expr) -> Value | None:
        return None if constant == 0 else self._times_constant(constant, self.tape.number(1.0))

    def _times_constant(self, constant: Expr, value: Value) -> Value:
        return self._sums.linear([(constant, value)])

    def _slope(self, place: int, unknown: int) -> Value | None:
        """Of what is linear in the unknowns, how it changes with one of them."""
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


class _Next:
    """Order k."""

    def __init__(self, series: Series, start: _Start):
        self._series = series
        self._graph = series.graph
        self._start = start
        self.tape = Tape()
        self._sums = _Sums(self.tape, lambda size: self._kept(start.constant(size)))
        self._values: dict[int, Value] = {}
        self._depths: dict[int, int] = {}
        self._share = self.tape.read(("order", 1))
        for place in series.order:
            if not self._graph.depends(place):
                self._at(place)
        self._solved = self._solve()

    def give(self) -> Tape:
        series, tape, n = self._series, self.tape, self._series.size
        changes = [self._output(value) for value in series.forces] if series.has_momenta else self._solved
        rates = self._solved if series.has_momenta else [tape.read(("state", n + k)) for k in range(n)]
        step = tape.read(("order", 2))
        given = {("next", k): tape.multiply(step, value) for k, value in enumerate([*rates, *changes])}
        order = tape.read(("order", 0))
        for k, operand in enumerate(series.operands):
            value = self._at(operand.node)
            given["operands", k] = tape.multiply(order, value) if operand.is_slope else value
        return tape.give(given)

    def _kept(self, value: Value) -> Value:
        """A value of order 0."""
        number = self._start.number(value)
        if number is not None:
            return self.tape.number(number)
        return self.tape.read(("kept", self._start.keep(value)))

    def _output(self, scaled: Scaled) -> Value:
        constant, node = scaled
        if node is None:
            return self.tape.number(0.0)
        return self._sums.linear([(constant, self._at(node))])

    def _depth(self, place: int) -> int:
        """How many steps a node waits for."""
        if place not in self._depths:
            node = self._graph.nodes[place]
            late = 100 if node.kind == "unknown" else 0
            self._depths[place] = 1 + max((self._depth(part) for part in node.parts), default=late)
        return self._depths[place]

    def _by_depth(self, places: Sequence[int]) -> list[int]:
        return sorted(places, key=self._depth)

    # --- coefficients of order k

    def _at(self, place: int) -> Value:
        if place not in self._values:
            self._values[place] = self._made(place)
        return self._values[place]

    def _made(self, place: int) -> Value:
        node, tape = self._graph.nodes[place], self.tape
        match node.kind:
            case "q":
                return tape.read(("state", node.index))
            case "rate":
                return tape.read(("state", self._series.size + node.index))
            case "unknown":
                return self._solved[node.index]
            case "input":
                return tape.read(("inputs", node.index))
            case "time":
                return tape.read(("order", 3))
            case "sum":
                value = self._sum(place, self._at)
                return tape.number(0.0) if value is None else value
        sums = [tape.read(("sums", k)) for k in self._series.sums_of(place)]
        if node.kind in ("product", "square", "quotient", "inverse", "sqrt"):
            return self._of_products(place, sums[0])
        return self._of_function(place, sums)

    def _sum(self, place: int, at: Callable[[int], Value | None]) -> Value | None:
        """What is known first comes first."""
        node = self._graph.nodes[place]
        scales = dict(zip(node.parts, node.coefficients, strict=True))
        values = [(scales[part], at(part)) for part in self._by_depth(node.parts)]
        return self._sums.linear([(c, value) for c, value in values if value is not None])

    def _of_products(self, place: int, total: Value) -> Value:
        node, tape, at0 = self._graph.nodes[place], self.tape, self._start
        kept, start = self._kept, self._start.tape
        match node.kind:
            case "product":
                x, y = self._by_depth(node.parts)
                early = tape.add(total, tape.multiply(kept(at0.at(y)), self._at(x)))
                return tape.add(early, tape.multiply(kept(at0.at(x)), self._at(y)))
            case "square":
                (x,) = node.parts
                twice = start.add(at0.at(x), at0.at(x))
                return tape.add(total, tape.multiply(kept(twice), self._at(x)))
            case "quotient":
                x, y = node.parts
                divisor = kept(start.inverse(at0.at(y)))
                taken = tape.multiply(kept(at0.at(place)), self._at(y))
                if self._depth(x) < self._depth(y):
                    left = tape.subtract(tape.subtract(self._at(x), total), taken)
                else:
                    left = tape.subtract(self._at(x), tape.add(total, taken))
                return tape.multiply(left, divisor)
            case "inverse":
                (y,) = node.parts
                taken = tape.add(total, tape.multiply(kept(at0.at(place)), self._at(y)))
                return tape.multiply(taken, kept(start.negative(at0.at(place))))
        half = start.multiply(start.number(0.5), start.inverse(at0.at(place)))  # a root
        return tape.multiply(tape.subtract(self._at(node.parts[0]), total), kept(half))

    def _of_function(self, place: int, sums: Sequence[Value]) -> Value:
        """Each is a number of order 0 times the coefficient of the argument, and what was known before that."""
        node, tape, at0 = self._graph.nodes[place], self.tape, self._start
        start = self._start.tape
        argument = self._at(node.parts[0])
        if node.kind in ("pow", "cbrt"):
            exponent = start.number(as_double(Fraction(int(node.exponent.p), int(node.exponent.q))))
            inverse = start.inverse(at0.at(node.parts[0]))
            slope = start.multiply(exponent, start.multiply(at0.at(place), inverse))
            difference = tape.subtract(tape.multiply(self._kept(exponent), sums[0]), sums[1])
            known = tape.multiply(self._kept(inverse), tape.multiply(self._share, difference))
            return tape.add(tape.multiply(self._kept(slope), argument), known)
        known = tape.multiply(self._share, sums[0])
        if node.kind in ("log", "atan", "asin", "acos"):
            inverse = start.inverse(at0.at(node.parts[1]))
            if node.kind == "acos":
                return tape.multiply(tape.add(argument, known), self._kept(start.negative(inverse)))
            return tape.multiply(tape.subtract(argument, known), self._kept(inverse))
        companion = place if node.kind == "exp" else self._graph.companion(place)
        slope = at0.at(companion)
        if node.kind == "cos":
            return tape.subtract(tape.multiply(self._kept(start.negative(slope)), argument), known)
        return tape.add(tape.multiply(self._kept(slope), argument), known)

    # --- the linear system

    def _solve(self) -> list[Value]:
        series, tape, n = self._series, self.tape, self._series.size
        zero = tape.number(0.0)
        right = []
        for k, (constant, node) in enumerate(series.solved):
            rest = None if node is None else self._rest(node)
            value = None if rest is None else self._sums.linear([(constant, rest)])
            if series.has_momenta:
                p = tape.read(("state", n + k))
                right.append(p if value is None else tape.subtract(p, value))
            else:
                right.append(zero if value is None else tape.negative(value))
        if self._start.inverse:
            return [self._row(k, right) for k in range(n)]
        factors = [self._kept(value) for value in self._start.factors]
        return Elimination(tape).solve(factors, right)

    def _row(self, k: int, right: Sequence[Value]) -> Value:
        """M⁻¹ times the right-hand side."""
        tape, zero = self.tape, self.tape.number(0.0)
        found = None
        for j, value in enumerate(right):
            entry = self._kept(self._start.inverse[max(j, k)][min(j, k)])
            if zero not in (entry, value):
                term = tape.multiply(entry, value)
                found = term if found is None else tape.add(found, term)
        return zero if found is None else found

    def _rest(self, place: int) -> Value | None:
        """Of what is linear in the unknowns, what it is without those of this order; None where that is 0."""
        node, tape = self._graph.nodes[place], self.tape
        if not self._graph.depends(place):
            return self._at(place)
        if node.kind == "unknown":
            return None
        if node.kind == "sum":
            return self._sum(place, self._rest)
        x, y = node.parts
        total = tape.read(("sums", self._series.sums_of(place)[0]))
        if node.kind == "quotient":
            taken = tape.add(total, tape.multiply(self._kept(self._start.at(place)), self._at(y)))
            rest = self._rest(x)
            left = tape.negative(taken) if rest is None else tape.subtract(rest, taken)
            return tape.multiply(left, self._kept(self._start.tape.inverse(self._start.at(y))))
        moving, other = (x, y) if self._graph.depends(x) else (y, x)
        known = tape.add(total, tape.multiply(self._kept(self._start.at(moving)), self._at(other)))
        rest = self._rest(moving)
        if rest is None:
            return known
        return tape.add(known, tape.multiply(self._kept(self._start.at(other)), rest))
