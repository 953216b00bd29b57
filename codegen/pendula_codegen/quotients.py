"""Quotients of what grows without bound, such as exp and cosh: finite where they are, though both parts are not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

from sympy import Add, Dummy, Expr, Mul, cosh, exp, sinh, tanh


def without_overflow(factors: Sequence[Expr]) -> list[Expr]:
    """Factors of the same product that are finite where it is.

    Derivatives of 1/(1 + exp u) hold exp(u)/(1 + exp u)²: at u = 1000 that is ∞/∞, and 1/((1 + exp u) (exp(−u) + 1)) is
    0. Those of 1/cosh u hold sinh(u)/cosh(u)² = tanh(u)/cosh(u).
    """
    factors = list(factors)
    growing = [k for k, factor in enumerate(factors) if factor.has(exp, sinh)]
    for k, m in product(growing, range(len(factors))):
        base, power = factors[m].as_base_exp()
        if not (power.is_Integer and power < 0):
            continue
        if base == cosh(*_argument(factors[k], sinh)):
            count = min(factors[k].as_base_exp()[1], -power)
            u = base.args[0]
            factors[k] *= (tanh(u) / sinh(u)) ** count
            factors[m] = base ** (power + count)
        elif isinstance(factors[k], exp) and base.is_Add:
            for u, count in _exponents(factors[k], base, -power):
                factors[k] = Add(*(_divided(term, u) for term in base.args)) ** -count
                factors[m] = base ** (power + count)
                break
    return factors


def _argument(factor: Expr, function: type) -> tuple[Expr, ...]:
    """Of a power of the function with a whole exponent > 0, its argument."""
    base, power = factor.as_base_exp()
    return base.args if isinstance(base, function) and power.is_Integer and power > 0 else (Dummy(),)


def _exponents(power: Expr, total: Expr, most: int) -> Iterable[tuple[Expr, int]]:
    """All u and n ≤ most where `power` is exp(n u) and a term of `total` holds exp(u)."""
    for term in total.args:
        for factor in Mul.make_args(term):
            if isinstance(factor, exp):
                u = factor.args[0]
                yield from ((u, n) for n in range(1, int(most) + 1) if power.args[0] == n * u)


def _divided(term: Expr, u: Expr) -> Expr:
    """term / exp u."""
    factors = Mul.make_args(term)
    exponent = Add(*(factor.args[0] for factor in factors if isinstance(factor, exp)))
    return Mul(*(factor for factor in factors if not isinstance(factor, exp)), exp(exponent - u))
