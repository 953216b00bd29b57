"""What each order of a series takes, from order 1 on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from pendula_codegen.polynomial import as_double
from pendula_codegen.series import Series
from pendula_codegen.series_graph import Value as Scaled
from pendula_codegen.series_start import Start, Sums
from pendula_codegen.tape import Elimination, Tape, Value


class Next:
    """Order k."""

    def __init__(self, series: Series, start: Start):
        self._series = series
        self._graph = series.graph
        self._start = start
        self.tape = Tape()
        self._sums = Sums(self.tape, lambda size: self._kept(start.constant(size)))
        self._values: dict[int, Value] = {}
        self._rests: dict[int, Value | None] = {}
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
        right = self._sums.right_sides(self._series, self._rest)
        if self._start.inverse:
            return [self._row(k, right) for k in range(self._series.size)]
        factors = [self._kept(value) for value in self._start.factors]
        return Elimination(self.tape).solve(factors, right)

    def _row(self, k: int, right: Sequence[Value]) -> Value:
        """Row k of M⁻¹ times the right-hand side."""
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
        if place not in self._rests:
            self._rests[place] = self._rest_of(place)
        return self._rests[place]

    def _rest_of(self, place: int) -> Value | None:
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
