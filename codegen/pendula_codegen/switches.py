"""Functions of several pieces in a model: Piecewise, Abs, sign, Heaviside, Min and Max.

Of each switching function g that decides between pieces, two indicators are parameters of the kernel: one is 1 where
g > 0, the other where g < 0, and else they are 0. sign(g) is their difference, Abs(g) is above·g − below·g, and so on:
while a step lasts they are constant, and everything is smooth. Who moves the system ends a step where g is zero, and
changes them.

A piece that is not taken is multiplied by 0, which is exact where it is finite. So that it is, powers and functions in
it that have not a value everywhere are taken of 1 (or 0) while it is not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

import mpmath
from sympy import (
    Abs,
    Add,
    And,
    Expr,
    Float,
    Heaviside,
    Integer,
    Max,
    Min,
    Mul,
    Not,
    Or,
    Piecewise,
    Rational,
    Symbol,
    acos,
    asin,
    cosh,
    exp,
    expand,
    lambdify,
    log,
    sign,
    sinh,
    tan,
)
from sympy.core.relational import GreaterThan, LessThan, StrictGreaterThan, StrictLessThan
from sympy.logic.boolalg import Boolean, BooleanFalse, BooleanTrue
from sympy.printing.str import StrPrinter

PIECES = (Abs, sign, Heaviside, Min, Max, Piecewise)
MOST_SWITCHES = 16
MOST_WHOLE = 10**6

_LESS = (StrictLessThan, LessThan)
_GREATER = (StrictGreaterThan, GreaterThan)
# Taken of 0 where a piece is not taken; of 1.
_AT_ZERO = (acos, asin, cosh, exp, sinh, tan)


@dataclass(frozen=True)
class Switch:
    """A switching function, and its indicators."""

    value: Expr
    above: Symbol
    below: Symbol

    @property
    def text(self) -> str:
        """The function as somebody would write it: 0.2 is a fraction of large numbers."""
        fractions = (number for number in self.value.atoms(Rational) if number.q > MOST_WHOLE)
        return _Text().doprint(self.value.xreplace({number: Float(float(number)) for number in fractions}))


class _Text(StrPrinter):
    def _print_Float(self, number: Float) -> str:
        return repr(float(number))


@dataclass(frozen=True)
class Truth:
    """A condition as numbers: `yes` is 1 and `no` 0 where it holds, and the other way round where it does not."""

    yes: Expr
    no: Expr

    def __invert__(self) -> Truth:
        return Truth(self.no, self.yes)

    def __and__(self, other: Truth) -> Truth:
        return Truth(self.yes * other.yes, self.no + self.yes * other.no)

    def __or__(self, other: Truth) -> Truth:
        return ~(~self & ~other)


TRUE = Truth(Integer(1), Integer(0))


class UnknownPieceError(Exception):
    """Says what cannot be told apart."""


class Switches:
    """Those of a model, one of several equal ones. `new` makes the indicators of the one of a number."""

    def __init__(self, new: Callable[[int], tuple[Symbol, Symbol]]):
        self.all: list[Switch] = []
        self._new = new

    def without_pieces(self, expression: Expr, fixed: Collection[Symbol]) -> Expr:
        """The same in indicators. `fixed`: symbols that do not move. Raises UnknownPieceError."""
        if not expression.has(*PIECES):
            return expression
        return self._replaced(expression, {}, fixed)

    def behind(self, expression: Expr) -> set[Symbol]:
        """Symbols that an expression depends on, through switching functions too; no indicators."""
        found, waiting = set(), [expression]
        indicators = {symbol: switch for switch in self.all for symbol in (switch.above, switch.below)}
        seen: set[Switch] = set()
        while waiting:
            for symbol in waiting.pop().free_symbols:
                switch = indicators.get(symbol)
                if switch is None:
                    found.add(symbol)
                elif switch not in seen:
                    seen.add(switch)
                    waiting.append(switch.value)
        return found

    def held_by(self, expression: Expr) -> list[Switch]:
        """Those whose indicators it holds itself."""
        return [s for s in self.all if expression.has(s.above) or expression.has(s.below)]

    def substitute(self, changes: dict[Symbol, Expr]) -> None:
        self.all[:] = [Switch(s.value.xreplace(changes), s.above, s.below) for s in self.all]

    def _replaced(self, part: Expr, known: dict, fixed: Collection[Symbol]) -> Expr:
        if part not in known:
            known[part] = self._made(part, known, fixed)
        return known[part]

    def _made(self, part: Expr, known: dict, fixed: Collection[Symbol]) -> Expr:
        if not part.args or not part.has(*PIECES):
            return part

        def of(expression: Expr) -> Expr:
            return self._replaced(expression, known, fixed)

        if _has_gaps(part):
            part = _of_each_piece(part)
        if isinstance(part, Piecewise):
            return self._chosen(part, of, fixed)
        args = [of(argument) for argument in part.args]
        if isinstance(part, (Min, Max)):
            best, *others = args
            for other in others:
                first = self.truth(best - other)
                if isinstance(part, Min):
                    first = ~first
                zeros = [switch.value for switch in self.all]
                best = Add(
                    _times(first.yes, _guarded(best, first, fixed, zeros)),
                    _times(first.no, _guarded(other, ~first, fixed, zeros)),
                )
            return best
        if isinstance(part, PIECES):
            above = self.truth(args[0])
            if isinstance(part, Heaviside):
                return above.yes
            if isinstance(part, sign):
                return above.yes - above.no
            return _times(above.yes, args[0]) - _times(above.no, args[0])
        return part.func(*args)

    def _chosen(self, pieces: Piecewise, of: Callable, fixed: Collection[Symbol]) -> Expr:
        left, terms = TRUE, []
        for value, condition in pieces.args:
            here = left & self._condition(condition, of)
            piece = of(value)
            if here != TRUE:
                piece = _guarded(piece, here, fixed, [switch.value for switch in self.all])
            terms.append(_times(here.yes, piece))
            left = left & ~self._condition(condition, of)
            if condition == True:  # noqa: E712  SymPy's
                return Add(*terms)
        raise UnknownPieceError(
            f"{pieces} has no value where none of its conditions holds: expected a last piece (…, True)"
        )

    def _condition(self, condition: Boolean, of: Callable) -> Truth:
        if isinstance(condition, BooleanTrue):
            return TRUE
        if isinstance(condition, BooleanFalse):
            return ~TRUE
        if isinstance(condition, Not):
            return ~self._condition(condition.args[0], of)
        if isinstance(condition, (And, Or)):
            first, *others = (self._condition(part, of) for part in sorted(condition.args, key=str))
            for other in others:
                first = first & other if isinstance(condition, And) else first | other
            return first
        if isinstance(condition, (*_LESS, *_GREATER)):
            above = self.truth(of(condition.lhs) - of(condition.rhs))
            return above if isinstance(condition, _GREATER) else ~above
        raise UnknownPieceError(
            f"a kernel cannot tell pieces apart by {condition}: it has <, <=, >, >=, And, Or and Not"
        )

    def truth(self, value: Expr) -> Truth:
        """Of value > 0."""
        if value.is_number:
            return TRUE if value > 0 else ~TRUE
        value = _without_factor(value)
        is_negative = value.could_extract_minus_sign()
        if is_negative:
            value = -value
        switch = next((known for known in self.all if known.value == value), None)
        if switch is None:
            if len(self.all) == MOST_SWITCHES:
                raise UnknownPieceError(f"expected up to {MOST_SWITCHES} switching functions, got more")
            switch = Switch(value, *self._new(len(self.all) + 1))
            self.all.append(switch)
        above = Truth(switch.above, switch.below)
        return ~above if is_negative else above


def _without_factor(value: Expr) -> Expr:
    """One of all multiples of a function: with small whole numbers, or with a term that has no number."""
    _, value = value.as_content_primitive()
    largest = max(abs(term.as_coeff_Mul()[0]) for term in Add.make_args(expand(value)))
    return value if largest < MOST_WHOLE else expand(value / largest)


def _has_gaps(part: Expr) -> bool:
    """Whether it is taken of one of several pieces, and has no values, or no derivatives, of some numbers."""
    of_pieces = isinstance(part.args[0], (Abs, Min, Max, Piecewise))
    return of_pieces and (_is_root(part) or isinstance(part, (log, asin, acos)))


def _is_root(part: Expr) -> bool:
    return part.is_Pow and not (part.exp.is_Integer and part.exp > 0)


def _of_each_piece(part: Expr) -> Piecewise:
    """A function of pieces as pieces."""
    inner, more = part.args[0], part.args[1:]
    if isinstance(inner, Abs):
        pieces = [(inner.args[0], inner.args[0] > 0), (-inner.args[0], True)]
    elif isinstance(inner, (Min, Max)):
        first, *others = inner.args
        other = inner.func(*others)
        pieces = [(first, first > other if isinstance(inner, Max) else first < other), (other, True)]
    else:
        pieces = inner.args
    return Piecewise(*((part.func(value, *more), condition) for value, condition in pieces))


def _times(indicator: Expr, value: Expr) -> Expr:
    """Not multiplied out: SymPy would do that to a number times a sum."""
    return Mul(indicator, value)


def _guarded(piece: Expr, here: Truth, fixed: Collection[Symbol], zeros: Sequence[Expr]) -> Expr:
    """The piece, made finite where it is not taken.

    A root of a switching function g becomes that of |g|: a step that looks for g = 0 goes past it.
    """
    if not piece.args or not piece.free_symbols - set(fixed):
        return piece
    args = [_guarded(argument, here, fixed, zeros) for argument in piece.args]
    if _is_root(piece):
        base, power = args
        size = _without_factor(base)
        if piece.exp.is_number and not piece.exp.is_Integer and (size in zeros or -size in zeros):
            return (here.yes * base**2 + here.no) ** (power / 2)
        base = base if piece.base.is_positive else here.yes * base + here.no
        return base ** (power if piece.exp.is_number else here.yes * power)
    if isinstance(piece, log):
        return log(here.yes * args[0] + here.no)
    if isinstance(piece, _AT_ZERO):
        return piece.func(here.yes * args[0])
    return piece.func(*args)


def jump(
    value: Expr,
    switch: Switch,
    switches: Sequence[Switch],
    slopes_by: Iterable[Symbol],
    itself: bool = True,
) -> bool:
    """Whether a derivative of `value`, or `value` itself, jumps where a switching function is zero, as far as numbers
    tell."""
    above, below = {switch.above: 1, switch.below: 0}, {switch.above: 0, switch.below: 1}
    indicators = {symbol for s in switches for symbol in (s.above, s.below)}
    difference = value.xreplace(_integers(above)) - value.xreplace(_integers(below))
    wanted = [*[difference] * itself, *(difference.diff(symbol) for symbol in slopes_by), value]
    symbols = sorted(
        {s for e in (*wanted, *(s.value for s in switches)) for s in e.free_symbols} - indicators, key=str
    )
    flags = [symbol for s in switches for symbol in (s.above, s.below)]
    evaluate = lambdify([*symbols, *flags], wanted, "mpmath")
    zeros = [lambdify([*symbols, *flags], s.value, "mpmath") for s in switches]
    this = switches.index(switch)
    draw = random.Random(3)
    for _ in range(6):
        place = {
            s: mpmath.mpf(draw.uniform(0.5, 2)) * (1 if s.is_positive else draw.choice((-1, 1)))
            for s in symbols
        }
        for moved in [s for s in symbols if s in switch.value.free_symbols]:
            try:
                found = _difference_at(place, moved, symbols, zeros, this, evaluate)
            except (ValueError, ZeroDivisionError, ArithmeticError, TypeError):
                continue
            if found is not None:
                *differences, size = found
                if any(abs(d) > 1e-9 * (1 + abs(size)) for d in differences):
                    return True
                break
    return False


def _integers(values: dict[Symbol, int]) -> dict[Symbol, Expr]:
    return {symbol: Integer(value) for symbol, value in values.items()}


def _difference_at(place, moved, symbols, zeros, this, evaluate):
    def flags_at(numbers: list) -> list:
        flags = [1, 0] * len(zeros)
        for _ in zeros:  # one may depend on another
            for k, zero in enumerate(zeros):
                flags[2 * k : 2 * k + 2] = (1, 0) if zero(*numbers, *flags) > 0 else (0, 1)
        return flags

    def numbers_at(z: mpmath.mpf) -> list:
        return [z if s == moved else place[s] for s in symbols]

    def value_at(z: mpmath.mpf) -> mpmath.mpf:
        numbers = numbers_at(z)
        return zeros[this](*numbers, *flags_at(numbers))

    root = mpmath.findroot(value_at, (place[moved], place[moved] * 1.1), solver="secant", tol=1e-24)
    if not isinstance(root, mpmath.mpf) or (moved.is_positive and root <= 0):
        return None
    numbers = numbers_at(root)
    found = [
        mpmath.mpf(x) if not isinstance(x, mpmath.mpc) else x for x in evaluate(*numbers, *flags_at(numbers))
    ]
    return found if all(isinstance(x, mpmath.mpf) and mpmath.isfinite(x) for x in found) else None
