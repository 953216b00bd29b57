"""Values of a model's own expressions in 50 digits, and their rounding errors in doubles.

Nothing here is shortened or multiplied out: SymPy differentiates the Lagrangian of the file, and every operation of the
result is carried out as written. Kernels are compared with these values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import mpmath
from mpmath import mp, mpf
from sympy import Add, Expr, Integer, Rational, Symbol, acos, asin, cos, log, sin

from pendula_codegen.model import Model

DIGITS = 50
LARGEST = mpf(10) ** 300  # larger numbers are not trusted to doubles
KNOWN = 2**48  # largest relative error of an argument, in units of 2⁻⁵³, for which a function has digits
SMALLEST = mpf(2) ** -1021  # absolute error of numbers too small for a double, in units of 2⁻⁵³


@dataclass(frozen=True)
class Written:
    """The functions of a model, derived from its file by SymPy only; matrices row by row."""

    kinetic_energy: list[Expr]
    energy: list[Expr]
    mass: list[Expr]
    momenta: list[Expr]
    forces: list[Expr]
    momenta_q: list[Expr]
    forces_q: list[Expr]
    forces_v: list[Expr]
    residual: list[Expr]
    residual_q: list[Expr]
    residual_v: list[Expr]
    power: list[Expr]
    positions: list[Expr]
    velocities: list[Expr]
    momenta_at_rest: list[Expr]
    residual_at_rest: list[Expr]
    constraints: list[Expr]
    constraints_q: list[Expr]
    constraint_rates: list[Expr]
    constraint_second_rates: list[Expr]
    constraint_rates_q: list[Expr]


def written(model: Model) -> Written:
    system = model.system
    q, v, t = system.coordinates, system.velocities, model.time
    L, Q = model.lagrangian, [model.force_along(x) for x in q]
    p = [L.diff(rate) for rate in v]
    f = [L.diff(x) + force for x, force in zip(q, Q, strict=True)]

    def changes(values: list[Expr]) -> list[Expr]:
        """Rates, without accelerations."""
        return [
            Add(value.diff(t), *(value.diff(x) * rate for x, rate in zip(q, v, strict=True)))
            for value in values
        ]

    slope = changes(p)
    E = [
        Add(
            change,
            *(momentum.diff(rate) * a for rate, a in zip(v, system.accelerations, strict=True)),
            -force,
        )
        for momentum, change, force in zip(p, slope, f, strict=True)
    ]
    points = [component for point in model.points for component in point.components]
    given = model.constraints
    constraints = [Integer(0) if each.of_rates else each.value for each in given]
    rates = [
        each.value if each.of_rates else change
        for each, change in zip(given, changes(constraints), strict=True)
    ]

    still = {rate: Integer(0) for rate in v}
    return Written(
        kinetic_energy=[
            Rational(1, 2)
            * Add(*(x * y * momentum.diff(y) for x, momentum in zip(v, p, strict=True) for y in v))
        ],
        energy=[Add(*(rate * momentum for rate, momentum in zip(v, p, strict=True)), -L)],
        mass=_jacobian(p, v),
        momenta=p,
        forces=f,
        momenta_q=_jacobian(p, q),
        forces_q=_jacobian(f, q),
        forces_v=_jacobian(f, v),
        residual=E,
        residual_q=_jacobian(E, q),
        residual_v=_jacobian(E, v),
        power=[Add(*(force * rate for force, rate in zip(Q, v, strict=True)), -L.diff(t))],
        positions=points,
        velocities=changes(points),
        momenta_at_rest=[momentum.xreplace(still) for momentum in p],
        residual_at_rest=[Add(change, -force) for change, force in zip(slope, f, strict=True)],
        constraints=constraints,
        constraints_q=_jacobian(rates, v),
        constraint_rates=rates,
        constraint_second_rates=changes(rates),
        constraint_rates_q=_jacobian(rates, q),
    )


def _jacobian(values: Sequence[Expr], symbols: Sequence[Symbol]) -> list[Expr]:
    return [value.diff(symbol) for value in values for symbol in symbols]


class NotInRangeError(Exception):
    """A part of an expression is not a finite real number, or does not fit into a double."""


@dataclass(frozen=True)
class Measured:
    """A value, and the rounding error of its evaluation in doubles.

    size    largest value of the terms if those with sines and cosines of angles are multiplied out
    error   rounding error, in units of 2⁻⁵³
    """

    value: mpf
    size: mpf
    error: mpf


class Evaluator:
    """Evaluates expressions at given values of symbols, each part once."""

    def __init__(self, numbers: Mapping[Symbol, float], angles: Sequence[Symbol] = ()):
        self._numbers = {symbol: mpf(number) for symbol, number in numbers.items()}
        self._angles = set(angles)
        self._known: dict[Expr, Measured] = {}

    def __call__(self, expression: Expr) -> Measured:
        """Raises NotInRangeError."""
        if expression not in self._known:
            with mp.workdps(DIGITS):
                value, size, error = self._measure(expression)
                if not (mpmath.isfinite(size) and abs(size) < LARGEST):
                    raise NotInRangeError
                self._known[expression] = Measured(value, size, error + SMALLEST)
        return self._known[expression]

    def _measure(self, expression: Expr) -> tuple[mpf, mpf, mpf]:
        if expression.is_Symbol:
            value = self._numbers[expression]
            return value, abs(value), mpf(0)
        if expression.is_number:
            return _constant(expression)
        if expression.is_Add:
            return self._sum(expression)
        if expression.is_Mul:
            return self._product([self(factor) for factor in expression.args])
        if expression.is_Pow:
            return self._power(expression)
        return self._function(expression)

    def _sum(self, expression: Expr) -> tuple[mpf, mpf, mpf]:
        terms = [self(term) for term in expression.args]
        value = mpmath.fsum(term.value for term in terms)
        error = mpmath.fsum(term.error for term in terms)
        total = mpmath.fsum(term.size for term in terms)
        # Terms that turn with an angle are multiplied out; the order in which more than two are added is free.
        turning = any(self._turns(term) for term in expression.args)
        return (
            value,
            total if turning else abs(value),
            error + (total if turning or len(terms) > 2 else abs(value)),
        )

    def _turns(self, term: Expr) -> bool:
        return bool(term.atoms(sin, cos)) and bool(term.free_symbols & self._angles)

    @staticmethod
    def _product(factors: Sequence[Measured]) -> tuple[mpf, mpf, mpf]:
        def times(left: Measured, right: Measured) -> Measured:
            size = left.size * right.size
            error = left.error * right.size + left.size * right.error
            return Measured(left.value * right.value, size, error + size)

        whole = reduce(times, factors)
        return whole.value, whole.size, whole.error

    def _power(self, expression: Expr) -> tuple[mpf, mpf, mpf]:
        base, power = self(expression.base), expression.exp
        if power.is_Integer and power > 0:
            return self._product([base] * int(power))
        if base.error >= KNOWN * abs(base.value) or (base.value < 0 and not power.is_Integer):
            raise NotInRangeError
        logarithm = mp.log(abs(base.value))
        exponent = self(power)
        value = base.value ** (int(power) if power.is_Integer else exponent.value)
        # A few roundings of a root or inverse and its power; else those of exp(y log x).
        few = abs(power.p) + 4 if power.is_Rational else abs(exponent.value * logarithm) * 3 + 2
        relative = abs(exponent.value) * base.error / abs(base.value) + abs(logarithm) * exponent.error + few
        if relative >= KNOWN:
            raise NotInRangeError
        return value, abs(value), abs(value) * relative

    def _function(self, expression: Expr) -> tuple[mpf, mpf, mpf]:
        argument = self(expression.args[0])
        x = argument.value
        scale = (
            abs(x)
            if isinstance(expression, log)
            else 1 - abs(x)
            if isinstance(expression, (asin, acos))
            else 1
        )
        if argument.error >= KNOWN * scale:
            raise NotInRangeError
        function = getattr(mp, type(expression).__name__)
        value = function(x)
        if not isinstance(value, mpf):
            raise NotInRangeError
        slope = abs(self._slope(expression, x, value))
        error = slope * argument.error + 2 * abs(value)
        if isinstance(expression, (sin, cos)):
            error += self._of_angles(expression.args[0], isinstance(expression, sin))
        return value, abs(value), error

    def _of_angles(self, argument: Expr, is_sine: bool) -> mpf:
        """The error of sines of sums of angles that are computed from those of the angles."""
        counts = argument.as_coefficients_dict()
        total = sum(abs(count) for count in counts.values())
        if not set(counts) <= self._angles or not total.is_Integer or total < 2:
            return mpf(0)
        arc = mpmath.fsum(abs(int(count) * self._numbers[angle]) for angle, count in counts.items())
        return int(total) * (min(arc, mpf(1)) if is_sine else mpf(1))

    @staticmethod
    def _slope(expression: Expr, x: mpf, value: mpf) -> mpf:
        slopes = {
            "sin": lambda: mp.cos(x),
            "cos": lambda: mp.sin(x),
            "tan": lambda: 1 + value**2,
            "asin": lambda: 1 / mp.sqrt(1 - x**2),
            "acos": lambda: 1 / mp.sqrt(1 - x**2),
            "atan": lambda: 1 / (1 + x**2),
            "sinh": lambda: mp.cosh(x),
            "cosh": lambda: mp.sinh(x),
            "tanh": lambda: 1 - value**2,
            "exp": lambda: value,
            "log": lambda: 1 / x,
        }
        return slopes[type(expression).__name__]()


def _constant(expression: Expr) -> tuple[mpf, mpf, mpf]:
    value = expression.evalf(DIGITS + 10)
    if not value.is_Float and not value.is_Rational:
        raise NotInRangeError
    number = mpf(value.p) / value.q if value.is_Rational else mpf(value._mpf_)
    return number, abs(number), mpf(0) if mpf(float(number)) == number else abs(number)
