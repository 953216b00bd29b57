"""What Taylor series are computed from: constants, linear sums of series, and nodes that each have sums of products.

A value is a constant, or a constant times a node. Constants are SymPy expressions of parameters, so that equal ones are
one and numbers are exact. A node is a series: something that moves, a linear sum of nodes, which costs no more at one
order than at another, or a product or function of nodes, whose coefficient of order k holds sums Σ A_j B_(k−j),
0 < j < k, of coefficients that came before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from sympy import Expr, Function, Pow, Rational, S, cbrt, sqrt
from sympy import functions as sympy_functions

from pendula_codegen.polynomial import Call, Number

Constant = Expr
Value = tuple[Constant, int | None]  # a constant times a node; a constant alone
ONE, ZERO = S.One, S.Zero

MOVING = ("q", "rate", "unknown", "input", "time")
# Each of these is computed along with the other.
TWINS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}


@dataclass(frozen=True)
class Node:
    """A series.

    kind           one of MOVING; sum, product, square, quotient, inverse; or a function
    parts          the nodes that it is computed from; of log, atan, asin and acos the second one is what the derivative
                   of the first one is divided by
    coefficients   of a sum, those of its parts
    offset         of a sum, what stands beside them
    exponent       of pow
    index          of what moves: which coordinate or input
    """

    kind: str
    parts: tuple[int, ...] = ()
    coefficients: tuple[Constant, ...] = ()
    offset: Constant = ZERO
    exponent: Constant = ZERO
    index: int = 0


@dataclass(frozen=True)
class Operand:
    """What stands in a sum of products: a node, or k times its coefficient of order k, its slope."""

    node: int
    is_slope: bool = False


class SeriesGraph:
    """Nodes as they are added, one of several equal ones. `unknown_first`: in products of many, what is solved for."""

    def __init__(self, unknown_first: bool = False):
        self.nodes: list[Node] = []
        self._known: dict[Node, int] = {}
        self._depends: list[bool] = []
        self._linear: dict[int, bool] = {}
        self._unknown_first = unknown_first

    def node(self, kind: str, *parts: int, **more: object) -> int:
        node = Node(kind, parts, **more)
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
            self._depends.append(kind == "unknown" or any(self._depends[part] for part in parts))
        return self._known[node]

    def depends(self, node: int) -> bool:
        """On what is solved for."""
        return self._depends[node]

    def is_linear(self, place: int) -> bool:
        """In what is solved for, as it stands: no terms cancel."""
        if place not in self._linear:
            self._linear[place] = self._is_linear(place)
        return self._linear[place]

    def _is_linear(self, place: int) -> bool:
        node = self.nodes[place]
        if not self._depends[place] or node.kind == "unknown":
            return True
        if not all(map(self.is_linear, node.parts)):
            return False
        moving = [self._depends[part] for part in node.parts]
        return (
            node.kind == "sum"
            or (node.kind == "product" and sum(moving) == 1)
            or (node.kind == "quotient" and not moving[1])
        )

    # --- algebra

    def sum(self, values: Iterable[Value]) -> Value:
        """A constant that all parts have goes out of the sum."""
        offset, parts = ZERO, {}
        for constant, node in values:
            if node is None:
                offset += constant
            else:
                parts[node] = parts.get(node, ZERO) + constant
        held = {node: constant for node, constant in sorted(parts.items()) if constant != 0}
        if not held:
            return offset, None
        first = next(iter(held.values()))
        if offset == 0 and all(constant == first for constant in held.values()):
            if len(held) == 1:
                return first, next(iter(held))
            return first, self.node("sum", *held, coefficients=(ONE,) * len(held))
        return ONE, self.node("sum", *held, coefficients=(*held.values(),), offset=offset)

    def multiplied_out(self, value: Value) -> Value:
        """A constant times a sum as a sum."""
        constant, node = value
        if node is None or constant == 1 or self.nodes[node].kind != "sum":
            return value
        held = self.nodes[node]
        scaled = tuple(constant * c for c in held.coefficients)
        return ONE, self.node("sum", *held.parts, coefficients=scaled, offset=constant * held.offset)

    def product(self, factors: Sequence[Value]) -> Value:
        """Equal factors first, by squares; then one after the other, what is solved for last or first."""
        constant = ONE
        counts: Counter[int] = Counter()
        for scale, node in factors:
            constant *= scale
            if node is not None:
                counts[node] += 1
        if not counts or constant == 0:
            return constant, None
        powers = [self._power(node, count) for node, count in counts.items()]
        powers.sort(key=lambda value: (self._depends[value[1]] != self._unknown_first, value[1]))
        found = powers[0]
        for power in powers[1:]:
            found = self._times(found, power)
        return constant * found[0], found[1]

    def _power(self, node: int, count: int) -> Value:
        if count == 1:
            return ONE, node
        half = self._power(node, count // 2)
        square = self._times(half, half)
        return square if count % 2 == 0 else self._times(square, (ONE, node))

    def _times(self, x: Value, y: Value) -> Value:
        constant = x[0] * y[0]
        if x[1] is None or y[1] is None:
            return constant, y[1] if x[1] is None else x[1]
        if x[1] == y[1]:
            node = self.nodes[x[1]]
            return constant, node.parts[0] if node.kind == "sqrt" else self.node("square", x[1])
        for this, other in ((x[1], y[1]), (y[1], x[1])):
            divided = self._divided(this, other)
            if divided is not None:
                return self.sum([(constant * scale, node) for scale, node in divided])
            inverse = self._inverse_in(this)
            if inverse is not None and self.nodes[other].kind != "sum":
                # x (c/y + d) = c x/y + d x: a quotient
                scale, place, offset = inverse
                quotient = self.node("product", *sorted((other, place)))
                return self.sum([(constant * scale, quotient), (constant * offset, other)])
        return constant, self.node("product", *sorted((x[1], y[1])))

    def _divided(self, place: int, inverse: int) -> list[Value] | None:
        """(c y + d)/y as c + d/y."""
        held, node = self.nodes[place], self.nodes[inverse]
        if held.kind == "sum" and node.kind == "inverse" and held.parts == node.parts:
            return [(held.coefficients[0], None), (held.offset, inverse)]
        return None

    def _inverse_in(self, node: int) -> tuple[Constant, int, Constant] | None:
        """c, 1/y and d of a sum c/y + d."""
        held = self.nodes[node]
        if held.kind == "sum" and len(held.parts) == 1 and self.nodes[held.parts[0]].kind == "inverse":
            return held.coefficients[0], held.parts[0], held.offset
        return None

    def call(self, function: Call, value: Value) -> Value:
        """A function of one argument, as the vocabulary has it."""
        constant, node = value
        if not function:
            return value
        if node is None:
            return _of_constant(function, constant), None
        if function == "inverse":
            return 1 / constant, self.node("inverse", node)
        if constant != 1:
            node = self.node("sum", node, coefficients=(constant,))
        if isinstance(function, tuple):
            return ONE, self.node("pow", node, exponent=rational(function[1]))
        if function == "cbrt":
            return ONE, self.node("cbrt", node, exponent=Rational(1, 3))
        if function in ("log", "atan", "asin", "acos"):
            return ONE, self.node(function, node, self._divisor(function, node))
        return ONE, self.node(function, node)

    def _divisor(self, function: str, node: int) -> int:
        """Of what the derivative of the argument is divided by: u, 1 + u², √(1 − u²)."""
        if function == "log":
            return node
        square = self.node("square", node)
        sign = ONE if function == "atan" else -ONE
        divisor = self.node("sum", square, coefficients=(sign,), offset=ONE)
        return divisor if function == "atan" else self.node("sqrt", divisor)

    def companion(self, place: int) -> int | None:
        """What a node needs of orders before: a sine its cosine, tan and tanh 1 ± their square."""
        node = self.nodes[place]
        if node.kind in TWINS:
            return self.node(TWINS[node.kind], *node.parts)
        if node.kind in ("tan", "tanh"):
            sign = ONE if node.kind == "tan" else -ONE
            return self.node("sum", self.node("square", place), coefficients=(sign,), offset=ONE)
        return None

    # --- the whole

    def order(self, roots: Iterable[int]) -> list[int]:
        """All nodes that the roots need, each after its parts."""
        done: dict[int, None] = {}
        waiting = [*roots]
        for root in waiting:
            stack = [(root, False)]
            while stack:
                place, ready = stack.pop()
                if place in done:
                    continue
                if ready:
                    done[place] = None
                    companion = self.companion(place)
                    if companion is not None:
                        waiting.append(companion)
                else:
                    stack.append((place, True))
                    stack += [(part, False) for part in reversed(self.nodes[place].parts)]
        return [*done]

    def fuse(self, roots: Sequence[int]) -> None:
        """Makes products with an inverse quotients where nothing else needs the inverse; and one sum of sums in it."""
        users: dict[int, list[int]] = {}
        order = self.order(roots)
        for place in order:
            for part in self.nodes[place].parts:
                users.setdefault(part, []).append(place)
        for place in order:
            if self.nodes[place].kind == "inverse" and place not in roots:
                self._fuse_inverse(place, users.get(place, []))
        for place in order:
            if self.nodes[place].kind == "sum":
                self._join(place, lambda part: part not in roots and len(users[part]) == 1)

    def _fuse_inverse(self, inverse: int, users: Sequence[int]) -> None:
        if not all(self.nodes[user].kind == "product" for user in users):
            return
        (divisor,) = self.nodes[inverse].parts
        for user in users:
            x, y = self.nodes[user].parts
            self.nodes[user] = Node("quotient", (y if x == inverse else x, divisor))

    def _join(self, place: int, alone: Callable[[int], bool]) -> None:
        """Puts what sums hold, that stand in this sum alone, into it."""
        node, parts, offset = self.nodes[place], {}, self.nodes[place].offset
        for part, constant in zip(node.parts, node.coefficients, strict=True):
            inner = self.nodes[part]
            if inner.kind == "sum" and alone(part):
                offset += constant * inner.offset
                held = {x: constant * c for x, c in zip(inner.parts, inner.coefficients, strict=True)}
            else:
                held = {part: constant}
            for x, c in held.items():
                parts[x] = parts.get(x, ZERO) + c
        held = {x: c for x, c in parts.items() if c != 0}
        self.nodes[place] = replace(node, parts=(*held,), coefficients=(*held.values(),), offset=offset)

    def sums_of(self, place: int) -> tuple[tuple[Operand, Operand], ...]:
        """The sums Σ A_j B_(k−j) that the coefficient of a node holds, by A and B."""
        node, itself = self.nodes[place], Operand(place)
        match node.kind:
            case "product":
                return ((Operand(node.parts[0]), Operand(node.parts[1])),)
            case "square":
                return ((Operand(node.parts[0]), Operand(node.parts[0])),)
            case "quotient":
                return ((itself, Operand(node.parts[1])),)
            case "inverse":
                return ((itself, Operand(node.parts[0])),)
            case "sqrt":
                return ((itself, itself),)
            case "exp":
                return ((Operand(node.parts[0], is_slope=True), itself),)
            case "sin" | "cos" | "sinh" | "cosh" | "tan" | "tanh":
                return ((Operand(node.parts[0], is_slope=True), Operand(self.companion(place))),)
            case "log" | "atan" | "asin" | "acos":
                return ((Operand(place, is_slope=True), Operand(node.parts[1])),)
            case "pow" | "cbrt":
                base = node.parts[0]
                return (
                    (Operand(base, is_slope=True), itself),
                    (Operand(place, is_slope=True), Operand(base)),
                )
        return ()


def rational(number: Number) -> Constant:
    return Rational(number.numerator, number.denominator)


def _of_constant(function: Call, constant: Constant) -> Constant:
    if isinstance(function, tuple):
        return Pow(constant, rational(Fraction(function[1])))
    if function == "inverse":
        return 1 / constant
    known: dict[str, type[Function] | Callable[[Expr], Expr]] = {"sqrt": sqrt, "cbrt": cbrt}
    return (known.get(function) or getattr(sympy_functions, function))(constant)
