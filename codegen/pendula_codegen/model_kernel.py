"""The kernel of a model: what every system has, in the words of the model's file."""

from __future__ import annotations

from collections.abc import Iterator, Set
from functools import cached_property

from sympy import (
    Abs,
    Add,
    Expr,
    Function,
    Integer,
    Matrix,
    Mul,
    Pow,
    Rational,
    acos,
    asin,
    cos,
    log,
    sin,
    tan,
)

from pendula_codegen.entry_points import Declared, Output, Q, SystemKernel, V
from pendula_codegen.entry_points import Function as EntryPoint
from pendula_codegen.mechanics import jacobian, time_slope
from pendula_codegen.model import Model
from pendula_codegen.places import Place
from pendula_codegen.vocabulary import Angle, Leaf

# The order of a zero that no series of the coarsest steps misses: those of 9 terms.
HIGH, MOST_DEGREE = 3, 8
TINY = Rational(1, 10**60)  # a square that counts for nothing


class ModelKernel(SystemKernel):
    """Everything that is emitted for one model file."""

    suffix = "_"  # nothing else has: not a type, a function, or a macro

    def __init__(self, model: Model):
        super().__init__(model.system)
        self.model = model

    @property
    def declared(self) -> Declared:
        model = self.model
        points = [(point.name, len(point.components)) for point in model.points]
        switches = [switch.text for switch in model.switches]
        forces = [(f"force_{each.name}", f"J/({each.unit})") for each in model.constraints]
        return Declared(model.coordinates, model.ordered_parameters, model.inputs, points, switches, forces)

    @cached_property
    def points(self) -> tuple[Matrix | None, Matrix | None]:
        components = [component for point in self.model.points for component in point.components]
        return (Matrix(components), Matrix(self._changes(components))) if components else (None, None)

    def functions(self) -> list[EntryPoint]:
        read = (self.parameters, Q, V, self.inputs)
        functions = super().functions()
        if self.call_arguments:
            values = Matrix([value for value, _ in self.call_arguments])
            found = Output("found", "arguments", values, f"arguments, ({values.rows})")
            title = "What functions are taken of that change within a short time where it changes little"
            functions.append(EntryPoint("call_arguments", title, read, (found,)))
        if self.model.switches:
            values = Matrix([switch.value for switch in self.model.switches])
            found = Output("g", "switches", values, f"switching functions, ({values.rows})")
            title = "Switching functions, in whose zeros above_k and below_k change"
            functions.append(EntryPoint("switches", title, read, (found,)))
        return [*functions, *self.constraints()]

    def constraints(self) -> list[EntryPoint]:
        """Of models that have some."""
        if not self.model.constraints:
            return []
        system, given = self.system, self.model.constraints
        values = [Integer(0) if constraint.of_rates else constraint.value for constraint in given]
        slopes = Matrix([self.model.constraint_slopes(constraint) for constraint in given])
        changes = self._changes(values)
        rates = [
            constraint.value if constraint.of_rates else change
            for constraint, change in zip(given, changes, strict=True)
        ]
        read, count = (self.parameters, Q, V), len(given)

        def numbers(name: str, value: list[Expr], meaning: str) -> Output:
            return Output(name, "constraints", Matrix(value), f"{meaning}, ({count})")

        def matrix(name: str, value: Matrix, meaning: str) -> Output:
            return Output(
                name, "constraint_slopes", value, f"{meaning}, ({count} x {len(system.coordinates)})"
            )

        of_rates = any(constraint.of_rates for constraint in given)
        more = "; of those of rates g is 0, and A v + b = 0 stands for dg/dt" if of_rates else ""
        return [
            EntryPoint(
                "constraints",
                f"Constraints  g(q, t) = 0,  which forces (∂g/∂q)ᵀ λ keep{more}",
                read[:2],
                (
                    numbers("g", values, "constraints"),
                    matrix("g_D_q", slopes, "∂g_row/∂q_column; A" if of_rates else "∂g_row/∂q_column"),
                ),
            ),
            EntryPoint(
                "constraint_rates",
                "Rates of the constraints  dg/dt = (∂g/∂q) v + ∂g/∂t,  and d²g/dt² where nothing accelerates",
                read,
                (
                    numbers("g_dot", rates, "rates of the constraints"),
                    numbers("g_ddot", self._changes(rates), "second rates without accelerations"),
                ),
            ),
            EntryPoint(
                "constraint_rate_slopes",
                "Derivatives of dg/dt by coordinates, where rates are the same",
                read,
                (matrix("g_dot_D_q", self.jacobian(rates, system.coordinates), "∂(dg/dt)_row/∂q_column"),),
            ),
        ]

    def _changes(self, values: list[Expr]) -> list[Expr]:
        """Rates of functions of coordinates and time; of such that hold rates, without accelerations."""
        system = self.system
        return [
            Add(
                *(slope * v for slope, v in zip(row, system.velocities, strict=True)),
                time_slope(system, value),
            )
            for value, row in zip(values, jacobian(values, system.coordinates), strict=True)
        ]

    @cached_property
    def call_arguments(self) -> list[tuple[Expr, bool]]:
        """What functions in it are taken of, while it moves, and whether it is a base.

        Those change where their argument comes by zero or by its largest or smallest value: exp, tanh, … by steps of
        1, powers and logarithms by its own size. Sines of what moves slowly move slowly; so do low whole powers. High
        ones, and products of many factors, are exp of their logarithm.
        """
        system = self.system
        moving = {*system.coordinates, *system.velocities, *system.inputs, self.model.time}
        held = {call for said in self.model.held_expressions() for call in said.atoms(Function, Pow, Mul)}
        found = {pair: None for call in sorted(held, key=str) for pair in _arguments(call, moving)}
        return [(value, is_base) for value, is_base in found if value.free_symbols & moving]

    def angles(self) -> list[Angle]:
        held = [(k, c) for k, c in enumerate(self.model.coordinates) if c.is_angle]
        return [Angle(c.symbol, Place("q", index=(k,))) for k, c in held]

    def leaves(self) -> list[Leaf]:
        parameters = [
            Leaf(symbol, Place("parameters", parameter.name, (i,) if parameter.per_link else ()), "parameter")
            for parameter in (*self.model.parameters, *self.model.indicators)
            for i, symbol in enumerate(parameter.symbols)
        ]
        time = Leaf(self.model.time, Place("parameters", "time"), "parameter")
        inputs = [
            Leaf(given.symbol, Place("inputs", index=(k,)), "input")
            for k, given in enumerate(self.model.inputs)
        ]
        return [*parameters, time, *inputs]


def _arguments(call: Expr, moving: Set[Expr]) -> Iterator[tuple[Expr, bool]]:
    inside = call.args[0]
    if call.is_Mul or (call.is_Pow and call.exp.is_Integer and call.exp > 0):
        if _degree(call, moving) > MOST_DEGREE:
            yield Add(*map(_log_of_size, Mul.make_args(call))), False
    elif call.is_Pow:
        yield inside, True
        if call.exp.free_symbols:
            yield call.exp * log(inside), False
    elif isinstance(call, (asin, acos)):
        yield 1 - inside**2, True
    elif isinstance(call, tan):
        yield cos(inside), True
    elif not isinstance(call, (sin, cos)):
        yield inside, isinstance(call, log)


def _degree(product: Expr, moving: Set[Expr]) -> int:
    """How many of its derivatives vanish at most where high powers in it are zero; sums may touch zero."""
    found = 0
    for factor in Mul.make_args(product):
        base, power = factor.as_base_exp()
        if base.free_symbols & moving and power.is_Integer and power >= HIGH:
            found += power * (2 if base.is_Add else 1)
    return found


def _log_of_size(factor: Expr) -> Expr:
    """The logarithm of its size, and of one that is zero hardly less than of what is smallest."""
    base, power = factor.as_base_exp()
    if factor.is_number:
        return Rational(round(1000 * log(Abs(factor)).evalf()), 1000)
    return power / 2 * log(base**2 + TINY)
