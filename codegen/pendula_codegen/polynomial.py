"""Sparse polynomials with rational coefficients in named atoms: the canonical form between SymPy and C++.

SymPy derives; what it hands over is expanded here, because a polynomial has one form only: terms that cancel
are gone, and the factoring of straight_line.py does not depend on how SymPy happened to write an expression.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction

from sympy import Expr, cos, sin

from pendula_codegen.errors import GenerationError

Number = int | Fraction
Monomial = tuple[int, ...]  # atom numbers, ascending, with multiplicity
Polynomial = dict[Monomial, Number]
_TRIG = (sin, cos)
ONE: Polynomial = {(): 1}


def quotient(numerator: Number, denominator: Number) -> Number:
    """The exact quotient, an int where it is whole: almost all are, and ints are ten times faster."""
    value = Fraction(numerator) / denominator
    return value.numerator if value.denominator == 1 else value


def add_into(total: Polynomial, other: Polynomial) -> None:
    for monomial, coefficient in other.items():
        value = total.get(monomial, 0) + coefficient
        if value:
            total[monomial] = value
        else:
            del total[monomial]


def ordered(polynomial: Polynomial) -> Polynomial:
    """The same polynomial with its terms in one fixed order, whatever order SymPy keeps its own in."""
    return dict(sorted(polynomial.items()))


def multiply(left: Polynomial, right: Polynomial) -> Polynomial:
    if len(left) == 1 and len(right) == 1:
        ((a, x),) = left.items()
        ((b, y),) = right.items()
        return {tuple(sorted(a + b)): x * y}
    product: Polynomial = {}
    for a, x in left.items():
        add_into(product, {tuple(sorted(a + b)): x * y for b, y in right.items()})
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
        if expression.is_Symbol or isinstance(expression, _TRIG):
            return self._atom(expression)
        if expression.is_Mul:
            return self._product(expression.args)
        if expression.is_Add:
            total: Polynomial = {}
            for term in expression.args:
                add_into(total, self.expand(term))
            return total
        if expression.is_Rational:
            value = quotient(int(expression.p), int(expression.q))
            return {(): value} if value else {}
        if expression.is_Pow and expression.exp.is_Integer and expression.exp > 0:
            return self._product([expression.base] * int(expression.exp))
        raise GenerationError(f"a kernel has only + − * / sin cos: it cannot evaluate {expression}")

    def _product(self, factors: Iterable[Expr]) -> Polynomial:
        product = ONE
        for factor in factors:
            product = multiply(product, self.expand(factor))
        return product
