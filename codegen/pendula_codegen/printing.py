"""Straight-line programs as C++ statements."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from pendula_codegen.polynomial import Number
from pendula_codegen.program import Program
from pendula_codegen.straight_line import UNIT, ZERO, Term

WIDTH = 112  # of a statement inside a member function, so that the project's 120 columns hold it


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


def print_body(program: Program) -> Body:
    return _Printer(program).body()


class _Printer:
    def __init__(self, program: Program):
        self._program = program
        self._graph = program.graph
        self._atoms = program.atoms
        self._names = {node: atom.name for node, atom in enumerate(program.atoms)}
        self._taken = set(self._names.values())
        self._numbered = 0

    def body(self) -> Body:
        nodes = self._program.order
        leaves = [node for node in nodes if node < len(self._atoms) and self._atoms[node].code]
        uses = Counter(child for node in nodes for child in self._graph.children(node))
        uses.update(node for _, node in self._program.outputs)
        temporaries = [self._temporary(node) for node in nodes if self._is_temporary(node, uses[node])]
        outputs = [
            self._statement(target, term)
            for target, term in zip(self._program.targets, self._program.outputs, strict=True)
        ]
        lines = [*self._fetch(leaves), *temporaries, *outputs]
        return Body(
            lines=[piece for line in lines for piece in wrap(line)],
            counts=Counts(len(temporaries), self._program.operations, self._program.trig),
            sources=frozenset(self._atoms[leaf].source for leaf in leaves),
        )

    def _fetch(self, leaves: Sequence[int]) -> list[str]:
        """References to what is read, then sines and cosines, as the arguments have them."""
        atoms = sorted((self._atoms[leaf] for leaf in leaves), key=lambda atom: atom.position)
        return [f"const Real{'' if atom.is_computed else '&'} {atom.name} = {atom.code};" for atom in atoms]

    def _is_temporary(self, node: int, uses: int) -> bool:
        if node in self._graph.definitions:
            return True
        is_alias = len(self._graph.products.get(node, (0, 0))) == 1
        return node >= len(self._atoms) and uses > 1 and not is_alias

    def _temporary(self, node: int) -> str:
        if node in self._graph.definitions:
            return self._statement(f"const Real {self._names[node]}", self._graph.definitions[node])
        text = self._expression(node)
        self._names[node] = self._name(node)
        return f"const Real {self._names[node]} = {text};"

    def _name(self, node: int) -> str:
        """Products of two atoms are called after them; other temporaries are numbered."""
        factors = self._graph.products.get(node, ())
        if len(factors) == 2 and all(f < len(self._atoms) for f in factors):
            first, second = sorted((self._atoms[f] for f in factors), key=lambda atom: atom.position)
            name = f"{first.name}_squared" if first == second else f"{first.name}_{second.name}"
            if name not in self._taken:
                self._taken.add(name)
                return name
        self._numbered += 1
        return f"t{self._numbered}"

    def _statement(self, target: str, term: Term) -> str:
        coefficient, node = term
        if term == ZERO:
            return f"{target} = Real(0.0);"
        if node == UNIT:
            return f"{target} = {_number(coefficient)};"
        return f"{target} = {self._scaled(coefficient, node)};"

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
