"""Sparse polynomials with rational coefficients in named atoms: the canonical form between SymPy and a backend.

SymPy derives; what it hands over is expanded here, because a polynomial has one form only: terms that cancel
are gone, and the factoring of straight_line.py does not depend on how SymPy happened to write an expression.
What is no polynomial (a root, an exponential, a quotient) is an atom whose argument is one.

Multiplied out, (x − 1000)² loses every digit near x = 1000. So a product of two sums is not multiplied out, but
written in atoms that are these sums; of a chain alone it is, whose terms are known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from math import gcd, lcm

import mpmath
from sympy import Expr, Rational

from pendula_codegen.errors import GenerationError
from pendula_codegen.language import FUNCTIONS, LANGUAGE, MOST_FACTORS, TRIGONOMETRIC
from pendula_codegen.quotients import without_overflow

Number = int | Fraction
Monomial = tuple[int, ...]  # atom numbers, ascending, with multiplicity
Polynomial = dict[Monomial, Number]
# Name of a function of one argument; ("pow", exponent); "" for the argument itself, as a sum with a name.
Call = str | tuple[str, Fraction]
ONE: Polynomial = {(): 1}
MOST_CONTENT = 2**20


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


def content(values: Iterable[Number]) -> Number:
    """A positive factor worth pulling out of a sum: 1 where a coefficient is ±1, which is free already.

    What is left are small whole numbers; where they would be large, it is 1, too.
    """
    values = list(values)
    if 1 in values or -1 in values:
        return 1
    numerator, denominator = 0, 1
    for value in values:
        numerator = gcd(numerator, value.numerator)
        denominator = lcm(denominator, value.denominator)
    found = quotient(numerator, denominator)
    return found if all(abs(value) <= MOST_CONTENT * found for value in values) else 1


def is_exact(value: Number) -> bool:
    """Whether a double equals it."""
    numerator = abs(value.numerator)
    odd = numerator // (numerator & -numerator) if numerator else 0
    return value.denominator & (value.denominator - 1) == 0 and odd <= 2**53


def size_of(value: Number) -> int:
    """The logarithm to base 2 of a number that is not 0, to within 1."""
    return value.numerator.bit_length() - value.denominator.bit_length()


def in_range(value: Number) -> bool:
    """Whether doubles reach this size, with some margin."""
    return abs(size_of(value)) < 1000


def as_double(value: Number) -> float:
    """The double next to a number. Raises GenerationError where it is out of their range."""
    if not in_range(value):
        raise GenerationError(
            f"a kernel holds a number of the size 2**{size_of(value)}, which no double can hold: expected other units"
        )
    return float(value)


def unit(polynomial: Polynomial) -> Number:
    """What a sum is divided by that gets a name: multiples have the same name, and no coefficient is rounded."""
    values = [*polynomial.values()]
    whole = content(values)
    if whole != 1 or 1 in values or -1 in values:
        return whole
    leading = abs(next(value for monomial, value in ordered(polynomial).items() if monomial))
    if all(map(is_exact, values)):
        leading = Fraction(2) ** size_of(leading)  # multiples by two are the most frequent ones
    return leading if all(in_range(quotient(value, leading)) for value in values) else 1


def is_linear(polynomial: Polynomial) -> bool:
    """Whether it is a sum of atoms and numbers, which are exact, so that its value is."""
    return all(len(monomial) < 2 for monomial in polynomial)


def has_one_sign(expression: Expr) -> bool:
    """Whether it is a sum whose terms cannot cancel, for all that SymPy knows."""
    return expression.is_Add and (
        all(term.is_nonnegative for term in expression.args)
        or all(term.is_nonpositive for term in expression.args)
    )


class Expander:
    """Turns SymPy expressions into polynomials.

    atom        what a symbol, or a sine or cosine, becomes
    call        what a function of a polynomial becomes
    keep_sums   whether products of sums are written in these sums, not multiplied out
    """

    def __init__(
        self,
        atom: Callable[[Expr], Polynomial],
        call: Callable[[Call, Polynomial], Polynomial],
        keep_sums: bool = False,
    ):
        self._atom = atom
        self._call = call
        self._keep_sums = keep_sums
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
        if isinstance(expression, TRIGONOMETRIC):
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
        if isinstance(expression, FUNCTIONS):
            return self._call(type(expression).__name__, self.expand(expression.args[0]))
        raise GenerationError(f"a kernel cannot evaluate {expression}: it has {LANGUAGE}")

    def _product(self, factors: Sequence[Expr]) -> Polynomial:
        factors = without_overflow(factors)
        parts = [self.expand(factor) for factor in factors]
        if self._keep_sums:
            sums = [
                k
                for k, (factor, part) in enumerate(zip(factors, parts, strict=True))
                if len(part) > 1 and not has_one_sign(factor)
            ]
            for k in sums:
                if len(sums) > 1 or is_linear(parts[k]):
                    parts[k] = self._sum(parts[k])
        product = ONE
        for part in parts:
            product = multiply(product, part)
        return product

    def _sum(self, polynomial: Polynomial) -> Polynomial:
        """An atom that is a sum, times a number: of x − y and 2 y − 2 x the same atom."""
        scale = unit(polynomial)
        if next(iter(ordered(polynomial).values())) < 0:
            scale = -scale
        scaled = {monomial: quotient(value, scale) for monomial, value in polynomial.items()}
        ((monomial, one),) = self._call("", scaled).items()
        return {monomial: one * scale}

    def _power(self, base: Expr, exponent: Expr) -> Polynomial:
        if exponent.is_Float or (exponent.is_Rational and exponent.q > MOST_FACTORS):
            return self._call(("pow", Fraction(*Rational(exponent).as_numer_denom())), self.expand(base))
        if not exponent.is_Rational:
            return self._call("exp", multiply(self.expand(exponent), self._call("log", self.expand(base))))
        root = self.expand(base)
        if exponent.q == 3 and not base.is_nonnegative:
            # The cube root of a negative number is complex to SymPy: no number here, and no real one either.
            root = self._call("cbrt", self._call("sqrt", root))
            root = multiply(root, root)
        elif exponent.q != 1:
            root = self._call(_root(int(exponent.q)), root)
        if exponent.p < 0:
            root = self._call("inverse", root)
        if self._keep_sums and len(root) > 1 and exponent.p > 1:
            root = self._sum(root)
        product = ONE
        for _ in range(abs(int(exponent.p))):
            product = multiply(product, root)
        return product


def _root(degree: int) -> Call:
    return {2: "sqrt", 3: "cbrt"}.get(degree, ("pow", Fraction(1, degree)))


def _rounded(expression: Expr) -> Polynomial:
    """A number that is no fraction, such as π or √2, to 40 digits."""
    value = expression.evalf(40)
    if not value.is_Float:
        raise GenerationError(f"a kernel cannot evaluate {expression}: it is no finite real number")
    exact = Fraction(*mpmath.libmp.to_rational(value._mpf_))
    return {(): quotient(exact.numerator, exact.denominator)} if exact else {}
