"""Sparse polynomials with rational coefficients in named atoms: the canonical form between SymPy and C++.

SymPy derives; what it hands over is expanded here, because a polynomial has one form only: terms that cancel are
gone, and the factoring of straight_line.py does not depend on how SymPy happened to write an expression.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from sympy import Add, Expr, Integer, Mul, Pow, Rational, Symbol, cos, sin

from pendula_codegen.errors import GenerationError

Monomial = tuple[int, ...]  # atom numbers, ascending, with multiplicity
Polynomial = dict[Monomial, Fraction]
ONE: Polynomial = {(): Fraction(1)}


def add_into(total: Polynomial, other: Polynomial, factor: Fraction = Fraction(1)) -> None:
    for monomial, coefficient in other.items():
        value = total.get(monomial, Fraction(0)) + factor * coefficient
        if value:
            total[monomial] = value
        else:
            del total[monomial]


def multiply(left: Polynomial, right: Polynomial) -> Polynomial:
    if left == ONE:
        return right
    product: Polynomial = {}
    for a, x in left.items():
        for b, y in right.items():
            add_into(product, {tuple(sorted(a + b)): x * y})
    return product


class Expander:
    """Turns SymPy expressions into polynomials; `atom` says what a symbol, a sine or a cosine becomes."""

    def __init__(self, atom: Callable[[Expr], Polynomial]):
        self._atom = atom
        self._known: dict[Expr, Polynomial] = {}

    def expand(self, expression: Expr) -> Polynomial:
        if expression not in self._known:
            self._known[expression] = self._expand(expression)
        return self._known[expression]

    def _expand(self, expression: Expr) -> Polynomial:
        if isinstance(expression, Rational | Integer):
            value = Fraction(int(expression.p), int(expression.q))
            return {(): value} if value else {}
        if isinstance(expression, Symbol | sin | cos):
            return self._atom(expression)
        if isinstance(expression, Add):
            total: Polynomial = {}
            for term in expression.args:
                add_into(total, self.expand(term))
            return total
        if isinstance(expression, Mul):
            product = ONE
            for factor in expression.args:
                product = multiply(product, self.expand(factor))
            return product
        if isinstance(expression, Pow) and isinstance(expression.exp, Integer) and expression.exp > 0:
            product = ONE
            for _ in range(int(expression.exp)):
                product = multiply(product, self.expand(expression.base))
            return product
        raise GenerationError(f"a kernel has only + − * / sin cos: it cannot evaluate {expression}")
