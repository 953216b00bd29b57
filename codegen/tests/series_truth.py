"""Taylor series of motions that know nothing of the generator's: by undetermined coefficients of the Euler–Lagrange
equations, which SymPy derives from L as it is written, in numbers without rounding.

Functions of series are their own Taylor series about the value at order 0, with the rest put in for the variable: no
recurrence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import isqrt

import mpmath
from mpmath import mpf
from sympy import Add, Expr, Rational, Symbol

from pendula_codegen.polynomial import Call
from pendula_codegen.series_tape import SeriesTapes
from pendula_codegen.tape import Tape, triangle

# Sines and cosines of angles that are told apart by nothing else.
CIRCLE = [(3, 4, 5), (5, 12, 13), (8, 15, 17), (7, 24, 25), (20, 21, 29), (12, 35, 37), (9, 40, 41)]


def meant(number: float | int | Fraction) -> Fraction:
    """The simple fraction that a double is next to; else what it is."""
    exact = Fraction(number)
    simple = exact.limit_denominator(10**6)
    return simple if float(simple) == float(exact) else exact


class Rationals:
    """Fractions. An angle is any number, and its sine and cosine are those of a rational point of the circle: of
    whole combinations of angles they follow, and nothing else of what they are is ever used."""

    def __init__(self) -> None:
        self._angles: dict[Fraction, tuple[Fraction, Fraction]] = {}

    def of(self, number: float | int | Fraction) -> Fraction:
        return meant(number)

    def call(self, function: Call, x: Fraction) -> Fraction:
        if function in ("sin", "cos"):
            return self.sine_and_cosine(x)[function == "cos"]
        if function == "sqrt":
            root = Fraction(isqrt(x.numerator), isqrt(x.denominator))
            assert root * root == x, f"expected the square of a fraction, got {x}"
            return root
        raise AssertionError(f"{function} of a fraction is none")

    def sine_and_cosine(self, x: Fraction) -> tuple[Fraction, Fraction]:
        known = [*self._angles]
        for counts in product((0, 1, -1, 2, -2), repeat=len(known)):
            if sum(n * angle for n, angle in zip(counts, known, strict=True)) == x:
                return self._combined(dict(zip(known, counts, strict=True)))
        a, b, c = CIRCLE[len(known)]
        self._angles[x] = (Fraction(a, c), Fraction(b, c))
        return self._angles[x]

    def _combined(self, counts: Mapping[Fraction, int]) -> tuple[Fraction, Fraction]:
        sine, cosine = Fraction(0), Fraction(1)
        for angle, count in counts.items():
            s, c = self._angles[angle]
            s = s if count > 0 else -s
            for _ in range(abs(count)):
                sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        return sine, cosine

    def taylor(self, function: Call, x: Fraction, order: int) -> list[Fraction]:
        """The coefficients of a function about x."""
        if function in ("sin", "cos"):
            s, c = self.sine_and_cosine(x)
            slopes = (s, c, -s, -c) if function == "sin" else (c, -s, -c, s)
            found, factorial = [], 1
            for k in range(order + 1):
                factorial *= max(k, 1)
                found.append(slopes[k % 4] / factorial)
            return found
        assert function == "sqrt"
        return self.powers(x, Fraction(1, 2), self.call("sqrt", x), order)

    @staticmethod
    def powers(x: Fraction, exponent: Fraction, value: Fraction, order: int) -> list[Fraction]:
        """Of the binomial series, whose first coefficient is known."""
        found = [value]
        for k in range(order):
            found.append(found[-1] * (exponent - k) / (k + 1) / x)
        return found

    def power(self, x: Fraction, exponent: Fraction, order: int) -> list[Fraction]:
        if exponent.denominator == 2:
            root = self.call("sqrt", x)
            return self.powers(x, exponent, root**exponent.numerator, order)
        assert exponent.denominator == 1, f"{x} to the power {exponent} is no fraction"
        return self.powers(x, exponent, x**exponent.numerator, order)


class Decimals:
    """Numbers with as many digits as mpmath is told."""

    def of(self, number: float | int | Fraction) -> mpf:
        exact = meant(number)
        return mpf(exact.numerator) / exact.denominator

    def call(self, function: Call, x: mpf) -> mpf:
        return mpmath.cbrt(x) if function == "cbrt" else getattr(mpmath, str(function))(x)

    def sine_and_cosine(self, x: mpf) -> tuple[mpf, mpf]:
        return mpmath.sin(x), mpmath.cos(x)

    def taylor(self, function: Call, x: mpf, order: int) -> list[mpf]:
        with mpmath.workdps(4 * mpmath.mp.dps):  # of differences
            return mpmath.taylor(lambda u: self.call(function, u), x, order)

    def power(self, x: mpf, exponent: Fraction, order: int) -> list[mpf]:
        value = x ** (mpf(exponent.numerator) / exponent.denominator)
        found = [value]
        for k in range(order):
            found.append(found[-1] * (mpf(exponent.numerator) / exponent.denominator - k) / (k + 1) / x)
        return found


Numbers = Rationals | Decimals
Coefficients = list  # of a series, of order 0 first


@dataclass(frozen=True)
class Equations:
    """The residual E(q, v, a, t, u) and the momenta of a system, as expressions."""

    q: Sequence[Symbol]
    v: Sequence[Symbol]
    a: Sequence[Symbol]
    residual: Sequence[Expr]
    momenta: Sequence[Expr]


def equations(
    q: Sequence[Symbol], v: Sequence[Symbol], t: Symbol | None, lagrangian: Expr, forces: Sequence[Expr]
) -> Equations:
    a = [Symbol(f"acceleration_{k}") for k in range(len(q))]
    momenta = [lagrangian.diff(rate) for rate in v]
    changes = [
        Add(
            *(p.diff(x) * rate for x, rate in zip(q, v, strict=True)),
            *(p.diff(rate) * change for rate, change in zip(v, a, strict=True)),
            0 if t is None else p.diff(t),
        )
        for p in momenta
    ]
    residual = [
        change - lagrangian.diff(x) - force for change, x, force in zip(changes, q, forces, strict=True)
    ]
    return Equations(q, v, a, residual, momenta)


class _Evaluator:
    """Values of expressions as series up to an order."""

    def __init__(self, numbers: Numbers, given: Mapping[Symbol, Coefficients], order: int):
        self._numbers = numbers
        self._given = given
        self._order = order
        self._known: dict[Expr, Coefficients] = {}

    def __call__(self, expression: Expr) -> Coefficients:
        if expression not in self._known:
            self._known[expression] = self._value(expression)
        return self._known[expression]

    def _value(self, expression: Expr) -> Coefficients:
        zero = self._numbers.of(0)
        if expression.is_Symbol:
            held = self._given[expression]
            return [held[k] if k < len(held) else zero for k in range(self._order + 1)]
        if expression.is_Rational:
            number = self._numbers.of(Fraction(int(expression.p), int(expression.q)))
            return [number] + [zero] * self._order
        if expression.is_number:
            number = self._numbers.of(Fraction(str(expression.evalf(60))))
            return [number] + [zero] * self._order
        if expression.is_Add:
            return [sum(terms, zero) for terms in zip(*(self(term) for term in expression.args), strict=True)]
        if expression.is_Mul:
            found = self(expression.args[0])
            for factor in expression.args[1:]:
                found = self._product(found, self(factor))
            return found
        if expression.is_Pow:
            return self._power(expression)
        argument = self(expression.args[0])
        name = type(expression).__name__
        return self._composed(self._numbers.taylor(name, argument[0], self._order), argument)

    def _power(self, expression: Expr) -> Coefficients:
        base, exponent = self(expression.base), expression.exp
        if exponent.is_Integer and exponent > 0:
            found = base
            for _ in range(int(exponent) - 1):
                found = self._product(found, base)
            return found
        power = Fraction(*map(int, Rational(exponent).as_numer_denom()))
        return self._composed(self._numbers.power(base[0], meant(power), self._order), base)

    def _product(self, x: Coefficients, y: Coefficients) -> Coefficients:
        zero = self._numbers.of(0)
        return [sum((x[j] * y[k - j] for j in range(k + 1)), zero) for k in range(self._order + 1)]

    def _composed(self, outer: Coefficients, inner: Coefficients) -> Coefficients:
        """Σ outer_j (inner − inner_0)^j, by Horner."""
        zero = self._numbers.of(0)
        moved = [zero, *inner[1:]]
        found = [outer[-1]] + [zero] * self._order
        for coefficient in reversed(outer[:-1]):
            found = self._product(found, moved)
            found[0] += coefficient
        return found


def motion(
    of: Equations, numbers: Numbers, given: Mapping[Symbol, Coefficients], start: Sequence, order: int
) -> tuple[list[Coefficients], list[Coefficients]]:
    """The coefficients of q and of p up to an order; start: q, then v."""
    n = len(of.q)
    q = [[x, rate] for x, rate in zip(start[:n], start[n:], strict=True)]
    zero = numbers.of(0)

    def at(k: int) -> _Evaluator:
        """Everything up to order k, with what is not known yet as 0."""
        series = [[*held, *[zero] * (k + 3 - len(held))] for held in q]
        v = [[(j + 1) * held[j + 1] for j in range(k + 2)] for held in series]
        a = [[(j + 1) * held[j + 1] for j in range(k + 1)] for held in v]
        moving = [*zip(of.q, series, strict=True), *zip(of.v, v, strict=True), *zip(of.a, a, strict=True)]
        return _Evaluator(numbers, {**given, **dict(moving)}, k)

    mass = [[at(0)(entry.diff(a))[0] for a in of.a] for entry in of.residual]
    for k in range(order - 1):
        evaluate = at(k)
        rest = [-evaluate(entry)[k] for entry in of.residual]
        for held, change in zip(q, _solved(mass, rest), strict=True):
            held.append(change / ((k + 1) * (k + 2)))
    evaluate = at(order - 1)
    return q, [evaluate(p) for p in of.momenta]


def _solved(matrix: Sequence[Sequence], right: Sequence) -> list:
    """By Gauss and Jordan."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for k in range(len(rows)):
        pivot = next(i for i in range(k, len(rows)) if rows[i][k] != 0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i, row in enumerate(rows):
            if i != k and row[k] != 0:
                rows[i] = [x - row[k] * y for x, y in zip(row, rows[k], strict=True)]
    return [row[-1] for row in rows]


def carry_out(tape: Tape, given: Mapping[str, Sequence], numbers: Numbers) -> dict[str, dict[int, object]]:
    """What a tape gives, by array and row."""
    value: dict[int, object] = {}
    for step in tape.steps:
        x = [value[k] for k in step.operands]
        match step.operation:
            case "number":
                found = [numbers.of(step.number)]
            case "read":
                found = [given[step.row[0]][step.row[1]]]
            case "add":
                found = [x[0] + x[1]]
            case "subtract":
                found = [x[0] - x[1]]
            case "multiply":
                found = [x[0] * x[1]]
            case "negative":
                found = [-x[0]]
            case "inverse":
                found = [1 / x[0]]
            case "sincos":
                found = [*numbers.sine_and_cosine(x[0])]
            case "pow":
                found = [numbers.power(x[0], meant(step.number), 0)[0]]
            case "factor" | "solve":
                entries = triangle(step.count) if step.operation == "solve" else step.count
                whole = Tape()
                reads = [whole.read(("x", k)) for k in range(len(x))]
                made = (
                    whole.solve(reads[:entries], reads[entries:])
                    if step.operation == "solve"
                    else whole.factor(reads)
                )
                whole.outputs = {("y", k): v for k, v in enumerate(made)}
                inner = carry_out(whole.written_out(len(x)), {"x": x}, numbers)
                found = [inner["y"][k] for k in range(step.count)]
            case _:
                found = [numbers.call(step.operation, x[0])]
        value |= zip(step.results, found, strict=True)
    given_back: dict[str, dict[int, object]] = {}
    for (array, k), v in tape.outputs.items():
        given_back.setdefault(array, {})[k] = value[v]
    return given_back


def by_tapes(
    tapes: SeriesTapes,
    numbers: Numbers,
    given: Mapping[str, Sequence],
    inputs: Sequence[Sequence],
    order: int,
) -> list[list]:
    """The state's coefficients, order by order, as the tapes give them.

    given    parameters, times, unit, and the state at order 0
    inputs   their coefficients, order by order
    """
    size, unit = 2 * tapes.series.size, given["unit"][0]
    begun = carry_out(tapes.start, {**given, "inputs": inputs[0]}, numbers)
    kept = [begun["kept"][k] for k in range(tapes.kept)]
    rows, operands = [[*given["state"]], [begun["next"][k] for k in range(size)]], [[]]
    for k in range(1, order):
        sums = [
            sum((operands[j][a] * operands[k - j][b] for j in range(1, k)), numbers.of(0))
            for a, b in tapes.series.places
        ]
        here = {
            "state": rows[k],
            "inputs": inputs[k],
            "kept": kept,
            "sums": sums,
            "order": [numbers.of(k), numbers.of(1) / k, unit / (k + 1), unit if k == 1 else numbers.of(0)],
        }
        made = carry_out(tapes.next, here, numbers)
        rows.append([made["next"][j] for j in range(size)])
        operands.append([made["operands"][j] for j in range(len(tapes.series.operands))])
    return rows
