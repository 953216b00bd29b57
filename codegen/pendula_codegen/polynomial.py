"""Sparse polynomials with rational coefficients in named atoms: the canonical form between SymPy and a backend.

SymPy derives; what it hands over is expanded here, because a polynomial has one form only: terms that cancel
are gone, and the factoring of straight_line.py does not depend on how SymPy happened to write an expression.
What is no polynomial (a root, an exponential, a quotient) is an atom whose argument is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction

from sympy import Expr, Function, acos, asin, atan, cos, cosh, exp, log, sin, sinh, tan, tanh

from pendula_codegen.errors import GenerationError

Number = int | Fraction
Monomial = tuple[int, ...]  # atom numbers, ascending, with multiplicity
Polynomial = dict[Monomial, Number]
Call = str | tuple[str, Fraction]  # name of a function of one argument; ("pow", exponent)
_TRIG = (sin, cos)
_FUNCTIONS: tuple[type[Function], ...] = (acos, asin, atan, cosh, exp, log, sinh, tan, tanh)
ONE: Polynomial = {(): 1}
MOST_FACTORS = 64  # of a power, which is a product of as many


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


def constant(polynomial: Polynomial) -> Number | None:
    """The number that a polynomial is; None where it holds an atom."""
    return None if any(polynomial) else polynomial.get((), 0)


class Expander:
    """Turns SymPy expressions into polynomials.

    atom   what a symbol, or a sine or cosine, becomes
    call   what a function of a polynomial becomes
    """

    def __init__(self, atom: Callable[[Expr], Polynomial], call: Callable[[Call, Polynomial], Polynomial]):
        self._atom = atom
        self._call = call
        self._known: dict[Expr, Polynomial] = {}

    def expand(self, expression: Expr) -> Polynomial:
        if expression not in self._known:
            self._known[expression] = self._expand(expression)
        return self._known[expression]

    def _expand(self, expression: Expr) -> Polynomial:
        if expression.is_Symbol:
            return self._atom(expression)
        if expression.is_Rational:
            value = quotient(int(expression.p), int(expression.q))
            return {(): value} if value else {}
        if expression.is_number:
            return _rounded(expression)
        if isinstance(expression, _TRIG):
            return self._atom(expression)
        if expression.is_Mul:
            return self._product(expression.args)
        if expression.is_Add:
            total: Polynomial = {}
            for term in expression.args:
                add_into(total, self.expand(term))
            return total
        if expression.is_Pow:
            return self._power(expression.base, expression.exp)
        if isinstance(expression, _FUNCTIONS):
            return self._call(type(expression).__name__, self.expand(expression.args[0]))
        raise GenerationError(
            f"a kernel cannot evaluate {expression}: it has + − * / powers roots exp log and the functions "
            "sin cos tan asin acos atan sinh cosh tanh"
        )

    def _product(self, factors: Iterable[Expr]) -> Polynomial:
        product = ONE
        for factor in factors:
            product = multiply(product, self.expand(factor))
        return product

    def _power(self, base: Expr, exponent: Expr) -> Polynomial:
        if not exponent.is_Rational:
            return self._call("exp", multiply(self.expand(exponent), self._call("log", self.expand(base))))
        if abs(exponent.p) > MOST_FACTORS:
            raise GenerationError(
                f"a kernel cannot evaluate {base**exponent}: it has powers up to {MOST_FACTORS}"
            )
        root = self.expand(base)
        if exponent.q != 1:
            root = self._call(_root(int(exponent.q)), root)
        if exponent.p < 0:
            root = self._call("inverse", root)
        product = ONE
        for _ in range(abs(int(exponent.p))):
            product = multiply(product, root)
        return product


def _root(degree: int) -> Call:
    return {2: "sqrt", 3: "cbrt"}.get(degree, ("pow", Fraction(1, degree)))


def _rounded(expression: Expr) -> Polynomial:
    """A number that is no fraction, such as π or √2, rounded to double."""
    value = complex(expression)
    if value.imag or value.real != value.real or abs(value.real) == float("inf"):
        raise GenerationError(f"a kernel cannot evaluate {expression}: it is no finite real number")
    exact = Fraction(value.real)
    return {(): quotient(exact.numerator, exact.denominator)} if exact else {}
