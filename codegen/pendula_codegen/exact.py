"""The numbers of a model as they were written: exact, and of no size that a double has not."""

from __future__ import annotations

import mpmath
from mpmath import mp, mpf
from sympy import Expr, Float, Mul, Rational, exp

MOST_DENOMINATOR = 64  # of an exponent that is a root
# For a number in front of an exponential, with logarithm x. |x| < SMALL: it stays. |x| >= LARGE: nobody wrote it so,
# and it goes back into the exponent. Between: it goes back only if x is a double to within ROUNDING, for then SymPy
# took it out of the exponent.
SMALL, LARGE, ROUNDING = 8, 230, 2.3e-16


def exact(expression: Expr) -> Expr:
    """`expression` with fractions in place of floating-point numbers, which SymPy rounds whenever it multiplies them.

    SymPy writes exp(1000.0 (t − 2)) as 1e-869 exp(1000.0 t), which no double can hold: such a number goes back into the
    exponent.
    """
    known: dict[Expr, Expr] = {}

    def of(part: Expr) -> Expr:
        if part not in known:
            known[part] = made(part)
        return known[part]

    def made(part: Expr) -> Expr:
        if part.is_Float:
            return Rational(part)
        if not part.args or not part.has(Float):
            return part
        if part.is_Pow and part.exp.is_Float:
            power = Rational(part.exp)
            return of(part.base) ** (power if power.q <= MOST_DENOMINATOR else part.exp)
        if part.is_Mul:
            part = _into_exponent(part)
        return part.func(*map(of, part.args))

    return of(expression)


def _into_exponent(product: Expr) -> Expr:
    """Puts a number that SymPy took out of an exponential back into it: of exp(50.0 − x) it makes 5.2e21 exp(−x).

    A number that is e to the power of a double has been taken out; of others that are huge or tiny, the whole part of
    the logarithm goes back, and a factor near 1 stays.
    """
    number, rest = product.as_coeff_Mul()
    factors = Mul.make_args(rest)
    at = next((k for k, factor in enumerate(factors) if isinstance(factor, exp)), None)
    if at is None or not number.is_Float:
        return product
    with mp.workdps(50):
        size = mp.log(abs(mpf(number)))
        power, left = mpf(float(size)), mpf(mp.sign(number))
        if abs(size) < SMALL:
            return product
        if abs(size - power) > ROUNDING:
            if abs(size) < LARGE:
                return product
            power = mp.nint(size)
            left = mpf(float(mpf(number) * mp.exp(-power)))
        others = (*factors[:at], *factors[at + 1 :])
        # The exponent is made of fractions: SymPy would take a floating-point number out of it again.
        exponent = exact(factors[at].args[0]) + _fraction(power)
        return Mul(_fraction(left), exp(exponent), *others)


def _fraction(number: mpf) -> Rational:
    return Rational(*mpmath.libmp.to_rational(number._mpf_))
