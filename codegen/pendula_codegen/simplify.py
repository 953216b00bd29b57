"""Shorter forms of what people write: sin² + cos² = 1, and sines and cosines of differences of angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from sympy import Add, Dummy, Expr, Integer, Mul, Symbol, cos, expand, sin

Powers = frozenset[tuple[Expr, Expr]]  # of a product without its number: base, exponent


def shortest(expression: Expr, angles: Sequence[Symbol]) -> Expr:
    """The expanded form, with every pair of terms that these identities make one made one."""
    terms: dict[Powers, Expr] = {}
    for term in Add.make_args(_expanded(expression)):
        number, rest = term.as_coeff_Mul()
        powers = frozenset(rest.as_powers_dict().items()) - {(Integer(1), Integer(1))}
        terms[powers] = terms.get(powers, Integer(0)) + number
    held = [angle for angle in angles if expression.has(angle)]
    found = True
    while found:
        found = False
        for identity in _identities(held):
            found = _join(terms, *identity) or found
    return Add(*(number * Mul(*(base**power for base, power in powers)) for powers, number in terms.items()))


def _identities(angles: Sequence[Symbol]) -> Iterable[tuple[list[Expr], list[Expr], int, list[Expr]]]:
    """(first, second, sign, whole): first + sign · second = whole, each as factors."""
    for a in angles:
        yield [sin(a), sin(a)], [cos(a), cos(a)], 1, []
    for a, b in combinations(angles, 2):
        yield [cos(a), cos(b)], [sin(a), sin(b)], 1, [cos(a - b)]
        yield [sin(a), cos(b)], [cos(a), sin(b)], -1, [sin(a - b)]


def _join(
    terms: dict[Powers, Expr], first: list[Expr], second: list[Expr], sign: int, whole: list[Expr]
) -> bool:
    """Makes one term of each two that are `first` and `second` times the same; whether there were any."""
    found = False
    for powers in [*terms]:
        cofactor = _without(powers, first)
        other = None if cofactor is None else _times(cofactor, second)
        if other is None or powers not in terms or terms.get(other) != sign * terms[powers]:
            continue
        number = terms.pop(powers)
        del terms[other]
        joined = _times(cofactor, whole)
        terms[joined] = terms.get(joined, Integer(0)) + number
        found = True
    return found


def _without(powers: Powers, factors: Sequence[Expr]) -> Powers | None:
    """A product divided by factors; None where it does not hold them."""
    left = dict(powers)
    for factor in factors:
        power = left.get(factor, Integer(0))
        if not (power.is_Integer and power >= 1):
            return None
        left[factor] = power - 1
        if power == 1:
            del left[factor]
    return frozenset(left.items())


def _times(powers: Powers, factors: Sequence[Expr]) -> Powers:
    product = dict(powers)
    for factor in factors:
        product[factor] = product.get(factor, Integer(0)) + 1
    return frozenset(product.items())


def shortest_by_pythagoras(expression: Expr, angles: Sequence[Symbol]) -> Expr:
    """The same by sin² + cos² = 1 of each angle alone."""
    best = expand(expression)
    while True:
        found = min((expand(form) for form in _by_pythagoras(best, angles)), key=_terms, default=best)
        if _terms(found) >= _terms(best):
            return best
        best = found


def _terms(expression: Expr) -> int:
    return len(Add.make_args(expression))


def _expanded(expression: Expr) -> Expr:
    """Multiplied out, but for roots and denominators, which stay as they are."""
    held: dict[Symbol, Expr] = {}

    def hold(power: Expr) -> Symbol:
        held[symbol := Dummy()] = power
        return symbol

    whole = expression.replace(lambda e: e.is_Pow and not e.exp.is_positive, hold)
    return (
        expand(whole.replace(lambda e: e.is_Pow and not e.exp.is_Integer, hold)).xreplace(held).xreplace(held)
    )


def _by_pythagoras(expression: Expr, angles: Sequence[Symbol]) -> Iterable[Expr]:
    for angle in angles:
        for kept, replaced in ((sin(angle), cos(angle)), (cos(angle), sin(angle))):
            yield expression.subs(replaced**2, 1 - kept**2)
