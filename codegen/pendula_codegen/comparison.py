"""Points at which `pendula check` compares a kernel with its model, and the model's values there.

Points are drawn about a start. Others are aimed at places where functions change: a random time hardly meets a pulse
of a millisecond.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import mpmath
from mpmath import mp
from sympy import Add, Expr, Function, Poly, PolynomialError, Pow, Symbol, cos, lambdify, sin

from pendula_codegen.model import Model
from pendula_codegen.written import Evaluator, NotInRangeError, Written, written

DRAWN = 8
AIMED = 32

Numbers = dict[Symbol, float]


@dataclass(frozen=True)
class Start:
    """Points are drawn about this state. Parameters are in the order of the kernel; accelerations are random."""

    parameters: Sequence[float]
    time: float
    q: Sequence[float]
    v: Sequence[float]


def comparison(model: Model, start: Start, seed: int) -> str:
    """In one line: how many points; of each the time, q, v, a, parameters, inputs, and values with their errors.

    An error is the rounding error of a value if each operation of the model is rounded once. Both are nan if there is
    no value that a double can hold.
    """
    functions, symbols = written(model), _Symbols(model)
    found = points(model, start, seed)
    words = [str(len(found))]
    for numbers in found:
        evaluate = Evaluator(numbers, [c.symbol for c in model.coordinates if c.is_angle])
        words += [repr(numbers[symbol]) for symbol in symbols.all]
        for of_one in fields(Written):
            for value in getattr(functions, of_one.name):
                words += _pair(evaluate, value)
    return " ".join(words)


def _pair(evaluate: Evaluator, expression: Expr) -> tuple[str, str]:
    try:
        measured = evaluate(expression)
    except NotInRangeError:
        return "nan", "nan"
    return mpmath.nstr(measured.value, 20), mpmath.nstr(mpmath.ldexp(measured.error, -53), 3)


class _Symbols:
    """The symbols of a model in the order of the kernel's arguments."""

    def __init__(self, model: Model):
        self.time = model.time
        self.q, self.v = model.system.coordinates, model.system.velocities
        self.a = model.system.accelerations
        self.parameters = [symbol for parameter in model.ordered_parameters for symbol in parameter.symbols]
        self.inputs = model.system.inputs
        self.all = (self.time, *self.q, *self.v, *self.a, *self.parameters, *self.inputs)


def points(model: Model, start: Start, seed: int) -> list[Numbers]:
    """Points at which the Lagrangian and the forces have values."""
    draw, symbols = random.Random(seed), _Symbols(model)
    said = [
        model.lagrangian,
        *(model.force_along(q) for q in symbols.q),
        *(constraint.value for constraint in model.constraints),
    ]
    found: list[Numbers] = []

    def keep(numbers: Numbers) -> bool:
        evaluate = Evaluator(numbers)
        try:
            for expression in said:
                evaluate(expression)
        except NotInRangeError:
            return False
        found.append(numbers)
        return True

    for k in range(DRAWN):
        # Nearer to the start if there are no values further away.
        any(keep(_drawn(model, symbols, start, draw, k, 0.5**attempt)) for attempt in range(20))
    aims = list(_aims(said, symbols))
    draw.shuffle(aims)
    for k in range(AIMED if aims else 0):
        target, turn = aims[k % len(aims)], k // len(aims)
        numbers = _drawn(model, symbols, start, draw, k + turn, 1.0)
        place = _hit(target, numbers, draw)
        if place is not None:
            keep({**numbers, target.symbol: place})
    return found


def _drawn(
    model: Model, symbols: _Symbols, start: Start, draw: random.Random, number: int, spread: float
) -> Numbers:
    """A random point. Every other one has the parameters of the start; two of four have its time."""

    def some(size: float) -> float:
        return draw.choice((-1, 1)) * size * 10 ** draw.uniform(-1.5, 0.5)

    def near(value: float) -> float:
        return value * 2 ** (spread * draw.uniform(-1, 1)) if value else spread * 10 ** draw.uniform(-2, 0)

    numbers = {symbols.time: start.time + (spread * 10 ** draw.uniform(-2, 4) if number % 4 > 1 else 0.0)}
    for coordinate, value in zip(model.coordinates, start.q, strict=True):
        size = 1.0 if coordinate.is_angle or not value else abs(value)
        numbers[coordinate.symbol] = value + spread * some(size / 2)
    for symbol, value in zip(symbols.v, start.v, strict=True):
        numbers[symbol] = value + spread * some(max(1.0, abs(value)))
    numbers |= {symbol: some(3.0) for symbol in (*symbols.a, *symbols.inputs)}
    for symbol, value in zip(symbols.parameters, start.parameters, strict=True):
        numbers[symbol] = near(value) if number % 2 else value
    return numbers


@dataclass(frozen=True)
class _Aim:
    """A symbol is to be chosen so that an expression that contains it is near zero."""

    expression: Expr
    symbol: Symbol
    exactly: bool


def _aims(said: Iterable[Expr], symbols: _Symbols) -> Iterator[_Aim]:
    """Aims at places where functions change most: where their arguments, denominators and radicands vanish."""
    seen: set[_Aim] = set()
    for part in sorted({part for expression in said for part in expression.atoms(Function, Pow)}, key=str):
        inside = part.args[0]
        if isinstance(part, (sin, cos)) or (part.is_Pow and part.exp.is_Integer and part.exp > 0):
            continue
        for expression, exactly in ((inside, part.is_Pow), *((total, True) for total in inside.atoms(Add))):
            for symbol in (symbols.time, *symbols.q):
                aim = _Aim(expression, symbol, exactly)
                if symbol in expression.free_symbols and aim not in seen:
                    seen.add(aim)
                    yield aim


def _hit(aim: _Aim, numbers: Mapping[Symbol, float], draw: random.Random) -> float | None:
    """The value of the symbol; None if none was found."""
    target = 0 if aim.exactly else draw.uniform(-1.5, 1)
    others = {symbol: value for symbol, value in numbers.items() if symbol != aim.symbol}
    offset = aim.expression.xreplace(others) - target
    try:
        roots = [complex(root) for root in Poly(offset, aim.symbol).nroots()]
    except (PolynomialError, mp.NoConvergence):
        function = lambdify(aim.symbol, offset, "mpmath")
        try:
            roots = [complex(mpmath.findroot(function, numbers[aim.symbol]))]
        except (ValueError, ZeroDivisionError, OverflowError):
            return None
    real = [root.real for root in roots if abs(root.imag) < 1e-9 * abs(root)]
    return draw.choice(real) * (1 + draw.choice((0, 1e-6)) * draw.uniform(-1, 1)) if real else None
