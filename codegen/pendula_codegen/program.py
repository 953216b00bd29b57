"""A function body: expressions in, the shortest straight-line C++ of several candidate forms out."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sympy import Add, Expr, Integer, Symbol, cos, sin

from pendula_codegen.errors import GenerationError
from pendula_codegen.polynomial import Expander, Number, Polynomial, ordered
from pendula_codegen.straight_line import UNIT, ZERO, Graph, Term, factor, share

WIDTH = 112


@dataclass(frozen=True)
class Leaf:
    """A value that a function reads: how it is called and the C++ that fetches it."""

    symbol: Symbol
    code: str
    source: str  # the function's argument it comes from


@dataclass(frozen=True)
class Angle:
    """A coordinate; only its sine and cosine are read, once each. `sine`, `cosine`: C++ that gives them."""

    symbol: Symbol
    sine: str
    cosine: str
    source: str


@dataclass(frozen=True)
class Form:
    """One way to write a program; the generator tries several and keeps the one with the fewest operations.

    pair_angles   sines and cosines of differences of two angles are temporaries (else expanded in the angles)
    expanded      symbols that are replaced by what they are defined as
    """

    pair_angles: bool
    expanded: frozenset[Symbol]


class Vocabulary:
    """All atoms that one program may be written in, in the order that decides ties."""

    def __init__(
        self,
        leaves: Sequence[Leaf],
        angles: Sequence[Angle],
        definitions: dict[Symbol, Expr],
        form: Form,
    ):
        self.names: list[str] = []
        self.code: dict[int, tuple[str, str]] = {}  # atom -> C++ that fetches it, argument it comes from
        self.is_trig: set[int] = set()
        self._numbers: dict[Expr, int] = {}
        self._form = form
        self._angles = {angle.symbol: k for k, angle in enumerate(angles)}
        self._pending: dict[int, Expr] = {}
        self._definitions = definitions
        self._expander = Expander(self._atom)
        for symbol, definition in definitions.items():
            if symbol not in form.expanded:
                self._pending[self._add(symbol, symbol.name)] = definition
        for leaf in leaves:
            self.code[self._add(leaf.symbol, leaf.symbol.name)] = leaf.code, leaf.source
        for angle in angles:
            for function, code in ((sin, angle.sine), (cos, angle.cosine)):
                number = self._add(function(angle.symbol), f"{function.__name__}_{angle.symbol.name}")
                self.code[number] = code, angle.source
                self.is_trig.add(number)
        self._pairs = self._add_pairs([angle.symbol for angle in angles]) if form.pair_angles else {}

    def _add(self, expression: Expr, name: str) -> int:
        self._numbers[expression] = len(self.names)
        self.names.append(name)
        return self._numbers[expression]

    def _add_pairs(self, angles: list[Symbol]) -> dict[tuple, int]:
        """Named atoms for sin and cos of the difference of two angles of the same kind."""
        pairs: dict[tuple, int] = {}
        for k, first in enumerate(angles):
            for second in angles[k + 1 :]:
                kind, i = first.name.rsplit("_", 1) if "_" in first.name else (first.name, "")
                other, j = second.name.rsplit("_", 1) if "_" in second.name else (second.name, "")
                if kind != other:
                    continue
                for function in (sin, cos):
                    number = self._add(
                        Symbol(f"{function.__name__}({first}-{second})"),
                        f"{function.__name__}_{kind}_{i}_{j}",
                    )
                    pairs[(function, first, second)] = number
                    self._pending[number] = self._of_sum(function, [(1, first), (-1, second)])
        return pairs

    def polynomial(self, expression: Expr) -> Polynomial:
        return self._expander.expand(expression)

    def define(self, graph: Graph, polynomials: Sequence[Polynomial]) -> None:
        """Gives `graph` the definitions of the atoms that the polynomials hold, also through others."""
        waiting = [atom for polynomial in polynomials for monomial in polynomial for atom in monomial]
        while waiting:
            atom = waiting.pop()
            if atom in self._pending and atom not in graph.definitions:
                definition = ordered(self.polynomial(self._pending[atom]))
                graph.definitions[atom] = factor(graph, definition)
                waiting += [part for monomial in definition for part in monomial]

    def _atom(self, expression: Expr) -> Polynomial:
        if expression in self._form.expanded:
            return self.polynomial(self._definitions[expression])
        if expression in self._numbers:
            return {(self._numbers[expression],): 1}
        if isinstance(expression, Symbol):
            raise GenerationError(
                f"a kernel function holds the symbol '{expression}', which is not an argument"
            )
        return self._trig(type(expression), expression.args[0])

    def _trig(self, function: type, angle: Expr) -> Polynomial:
        """sin or cos of an integer combination of angles."""
        parts = [term.as_coeff_Mul() for term in Add.make_args(angle)]
        if any(symbol not in self._angles or not isinstance(c, Integer) for c, symbol in parts):
            raise GenerationError(f"a kernel cannot evaluate {function(angle)}")
        parts.sort(key=lambda part: self._angles[part[1]])
        terms = [(int(c), symbol) for c, symbol in parts]
        if [abs(c) for c, _ in terms] == [1, 1] and terms[0][0] == -terms[1][0]:
            number = self._pairs.get((function, terms[0][1], terms[1][1]))
            if number is not None:
                sign = terms[0][0] if function is sin else 1
                return {(number,): sign}
        return self.polynomial(self._of_sum(function, terms))

    @staticmethod
    def _of_sum(function: type, terms: list[tuple[int, Symbol]]) -> Expr:
        """Angle addition, one angle at a time."""
        sine, cosine = Integer(0), Integer(1)
        for count, angle in terms:
            for _ in range(abs(count)):
                s, c = (sin(angle) if count > 0 else -sin(angle)), cos(angle)
                sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        return sine if function is sin else cosine


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


@dataclass(frozen=True)
class Counts:
    """What a function costs; recorded per entry point, may not grow unnoticed."""

    temporaries: int
    operations: int
    trig: int

    def __str__(self) -> str:
        return (
            f"{_count(self.temporaries, 'temporary', 'temporaries')}, {self.arithmetic}, {self.trig} sin/cos."
        )

    @property
    def arithmetic(self) -> str:
        return _count(self.operations, "operation", "operations")


@dataclass(frozen=True)
class Body:
    lines: list[str]
    counts: Counts
    sources: frozenset[str]  # the arguments that are read

    @property
    def uses_trig(self) -> bool:
        return self.counts.trig > 0


Assignment = tuple[str, Expr]  # C++ left-hand side, value


def shortest_body(
    alternatives: Sequence[Sequence[Assignment]], vocabularies: Sequence[Callable[[], Vocabulary]]
) -> Body:
    """The candidate with the fewest operations; the first of several equals."""
    best: tuple[tuple[int, int], Graph, list[Term], Vocabulary, Sequence[Assignment]] | None = None
    for assignments in alternatives:
        for make in vocabularies:
            vocabulary = make()
            graph, outputs = _build(assignments, vocabulary)
            trig = sum(1 for node in graph.order(n for _, n in outputs) if node in vocabulary.is_trig)
            cost = (graph.operations(outputs) + 10 * trig, len(graph.products) + len(graph.sums))
            if best is None or cost[0] < best[0][0]:
                best = cost, graph, outputs, vocabulary, assignments
    assert best is not None
    _, graph, outputs, vocabulary, assignments = best
    return _Printer(graph, vocabulary).body([left for left, _ in assignments], outputs)


def _build(assignments: Sequence[Assignment], vocabulary: Vocabulary) -> tuple[Graph, list[Term]]:
    graph = Graph(atoms=len(vocabulary.names))
    polynomials = [ordered(vocabulary.polynomial(value)) for _, value in assignments]
    vocabulary.define(graph, polynomials)
    outputs = [factor(graph, polynomial) for polynomial in polynomials]
    share(graph, outputs)
    return graph, outputs


class _Printer:
    """Prints a graph as C++ statements."""

    def __init__(self, graph: Graph, vocabulary: Vocabulary):
        self._graph = graph
        self._vocabulary = vocabulary
        self._names = dict(enumerate(vocabulary.names))
        self._taken = set(vocabulary.names)
        self._anonymous = 0

    def body(self, targets: list[str], outputs: list[Term]) -> Body:
        order = self._graph.order(node for _, node in outputs)
        uses = Counter(child for node in order for child in self._graph.children(node))
        uses.update(node for _, node in outputs)
        leaves = sorted(node for node in order if node in self._vocabulary.code)
        lines = [self._fetch(leaf) for leaf in leaves]
        temporaries = 0
        for node in order:
            if node in leaves:
                continue
            if node in self._graph.definitions:
                lines.append(
                    self._statement(f"const Real {self._names[node]}", self._graph.definitions[node])
                )
                temporaries += 1
            elif uses[node] > 1 and not self._is_alias(node):
                text = self._expression(node)
                name = self._names[node] = self._name(node)
                lines.append(f"const Real {name} = {text};")
                temporaries += 1
        lines += [self._statement(target, term) for target, term in zip(targets, outputs, strict=True)]
        trig = sum(1 for leaf in leaves if leaf in self._vocabulary.is_trig)
        return Body(
            lines=[piece for line in lines for piece in wrap(line)],
            counts=Counts(temporaries, self._graph.operations(outputs), trig),
            sources=frozenset(self._vocabulary.code[leaf][1] for leaf in leaves),
        )

    def _is_alias(self, node: int) -> bool:
        return len(self._graph.products.get(node, (0, 0))) == 1

    def _fetch(self, leaf: int) -> str:
        code = self._vocabulary.code[leaf][0]
        kind = "const Real" if leaf in self._vocabulary.is_trig and "(" in code else "const Real&"
        return f"{kind} {self._names[leaf]} = {code};"

    def _statement(self, target: str, term: Term) -> str:
        coefficient, node = term
        if term == ZERO:
            return f"{target} = Real(0.0);"
        if node == UNIT:
            return f"{target} = {_number(coefficient)};"
        text = self._expression(node) if coefficient == 1 else _scale(coefficient, self._factor(node))
        return f"{target} = {text};"

    def _name(self, node: int) -> str:
        """Products of two atoms are called after them; other temporaries are numbered."""
        factors = self._graph.products.get(node, ())
        if len(factors) == 2 and all(f < self._graph.atoms for f in factors):
            first, second = (self._vocabulary.names[f] for f in factors)
            name = f"{first}_squared" if first == second else f"{first}_{second}"
            if name not in self._taken:
                self._taken.add(name)
                return name
        self._anonymous += 1
        return f"t{self._anonymous}"

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
        ordered = sorted(terms, key=lambda term: term[0] < 0)
        text = ""
        for coefficient, node in ordered:
            size = abs(coefficient)
            piece = _number(size) if node == UNIT else _scale(size, self._factor(node))
            if not text:
                text = piece if coefficient > 0 else f"-{piece}"
            else:
                text += f" {'+' if coefficient > 0 else '-'} {piece}"
        return text


def _number(value: Number) -> str:
    if value.denominator & (value.denominator - 1) == 0:
        return f"Real({float(value)!r})"
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
