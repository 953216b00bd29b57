"""Shorter forms of what people write: sin² + cos² = 1, and sines and cosines of differences of angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from sympy import Add, Expr, Integer, Mul, Symbol, cos, expand, sin

Powers = frozenset[tuple[Expr, Expr]]  # of a product without its number: base, exponent


def shortest(expression: Expr, angles: Sequence[Symbol], rates: Sequence[Symbol]) -> Expr:
    """The same expression, with every pair of terms that these identities make one made one.

    For that, products of sums that hold sines and cosines of angles are multiplied out where there are rates: that is
    how the velocity of a point is squared. What loses digits there, the mass matrix loses, too, and it is needed.
    Nothing else is multiplied out: (x − 1000)² has digits near x = 1000 that x² − 2000 x + 10⁶ has not.
    """
    held = {angle for angle in angles if expression.has(angle)}
    terms: dict[Powers, Expr] = {}
    for term in _multiplied_out(expression, held, set(rates)):
        number, rest = term.as_coeff_Mul()
        powers = frozenset(rest.as_powers_dict().items()) - {(Integer(1), Integer(1))}
        terms[powers] = terms.get(powers, Integer(0)) + number
    found = True
    while found:
        found = False
        for identity in _identities([angle for angle in angles if angle in held]):
            found = _join(terms, *identity) or found
    return Add(*(number * Mul(*(base**power for base, power in powers)) for powers, number in terms.items()))


def _multiplied_out(expression: Expr, angles: set[Symbol], rates: set[Symbol]) -> list[Expr]:
    """Terms whose sum `expression` is."""
    parts: list[Expr] = []
    for term in Add.make_args(expression):
        parts += _parts_of_product(term, angles, rates) if term.free_symbols & rates else [term]
    return parts


def _parts_of_product(product: Expr, angles: set[Symbol], rates: set[Symbol]) -> list[Expr]:
    parts: list[Expr] = [Integer(1)]
    for factor in Mul.make_args(product):
        base, power = factor.as_base_exp()
        twice = base.is_Add and power == 2
        for _ in range(2 if twice else 1):
            others = _parts_of_sum(base if twice else factor, angles, rates)
            parts = [part * other for part in parts for other in others]
    return parts


def _parts_of_sum(factor: Expr, angles: set[Symbol], rates: set[Symbol]) -> list[Expr]:
    """The terms that turn with an angle, one by one, and the rest as one; a factor that does not turn as it is."""
    if not factor.is_Add or not _turns(factor, angles, rates):
        return [factor]
    turning = [term for term in factor.args if _turns(term, angles, rates)]
    resting = [term for term in factor.args if not _turns(term, angles, rates)]
    return [
        *(part for term in turning for part in _parts_of_product(term, angles, rates)),
        *([Add(*resting)] if resting else []),
    ]


def _turns(term: Expr, angles: set[Symbol], rates: set[Symbol]) -> bool:
    """Whether a term has a sine or cosine of an angle as a factor; of sums all terms, one where there are rates."""
    for factor in Mul.make_args(term):
        base, power = factor.as_base_exp()
        if isinstance(base, (sin, cos)) and base.free_symbols & angles:
            return True
        if base.is_Add and power in (1, 2):
            enough = any if base.free_symbols & rates else all
            if enough(_turns(part, angles, rates) for part in base.args):
                return True
    return False


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


def _by_pythagoras(expression: Expr, angles: Sequence[Symbol]) -> Iterable[Expr]:
    for angle in angles:
        for kept, replaced in ((sin(angle), cos(angle)), (cos(angle), sin(angle))):
            yield expression.subs(replaced**2, 1 - kept**2)
