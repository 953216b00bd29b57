"""Analytical mechanics of any Lagrangian L(q, v, t): momenta, gradient, Hessian, Euler–Lagrange equations.

Nothing here knows about chains; chain.py builds a chain's Lagrangian and hands it over as a LagrangianSystem, as
model.py does for everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

from sympy import Add, Expr, Integer, Mul, Pow, Symbol

from pendula_codegen.errors import GenerationError

REMEMBERED = 1 << 17  # expressions


@dataclass(frozen=True)
class LagrangianSystem:
    """A mechanical system: L(q, v, t) and the generalised forces Q(q, v, t, inputs) beside it.

    name            how messages call it
    coordinates     q
    velocities      v = dq/dt, in the order of the coordinates
    parameters      every other symbol that L may hold
    inputs          further symbols that only the forces may hold (torques, damping)
    lagrangian      L, J
    forces          Q_k, generalised forces that L does not give, N m
    time            t, where L or the forces hold it
    """

    name: str
    coordinates: tuple[Symbol, ...]
    velocities: tuple[Symbol, ...]
    parameters: tuple[Symbol, ...]
    inputs: tuple[Symbol, ...]
    lagrangian: Expr
    forces: tuple[Expr, ...]
    time: Symbol | None = None

    @property
    def accelerations(self) -> tuple[Symbol, ...]:
        return tuple(Symbol(f"{q.name}_ddot") for q in self.coordinates)

    def __post_init__(self) -> None:
        clock = () if self.time is None else (self.time,)
        declared = (*self.coordinates, *self.velocities, *self.parameters, *clock)
        require_declared(self.lagrangian, declared, f"the Lagrangian of model '{self.name}'")
        for force in self.forces:
            require_declared(force, (*declared, *self.inputs), f"a load of model '{self.name}'")


def time_slope(system: LagrangianSystem, expression: Expr) -> Expr:
    """∂expression/∂t."""
    return Integer(0) if system.time is None else gradient(expression, (system.time,))[0]


def require_declared(expression: Expr, declared: Iterable[Symbol], what: str) -> None:
    """Raises GenerationError when `expression` holds a symbol that is not among `declared`."""
    known = {symbol.name for symbol in declared}
    strangers = sorted({symbol.name for symbol in expression.free_symbols} - known)
    if strangers:
        raise GenerationError(f"{what} holds the symbol '{strangers[0]}', which the model does not declare")


def gradient(expression: Expr, symbols: Sequence[Symbol]) -> list[Expr]:
    """∂expression/∂symbol for each symbol."""
    return [derivative(expression, symbol) for symbol in symbols]


@lru_cache(maxsize=REMEMBERED)
def derivative(expression: Expr, symbol: Symbol) -> Expr:
    """∂expression/∂symbol.

    Of sums and products only terms and factors that hold the symbol are looked at, and what comes again is
    differentiated once: second and third derivatives of a Lagrangian have few different parts.
    """
    if symbol not in symbols_of(expression):
        return Integer(0)
    if expression.is_Symbol:
        return Integer(1)
    if expression.is_Add:
        return Add(*(derivative(term, symbol) for term in expression.args if symbol in symbols_of(term)))
    if expression.is_Mul:
        factors = expression.args
        return Add(
            *(
                Mul(*factors[:k], derivative(factor, symbol), *factors[k + 1 :])
                for k, factor in enumerate(factors)
                if symbol in symbols_of(factor)
            )
        )
    if expression.is_Pow and symbol not in symbols_of(expression.exp):
        base, power = expression.args
        return Mul(power, Pow(base, power - 1), derivative(base, symbol))
    if expression.is_Function and len(expression.args) == 1:
        return Mul(expression.fdiff(1), derivative(expression.args[0], symbol))
    return expression.diff(symbol)


@lru_cache(maxsize=REMEMBERED)
def symbols_of(expression: Expr) -> frozenset[Symbol]:
    """Its free symbols; sympy looks at all of an expression each time."""
    if not expression.args:
        return frozenset(expression.free_symbols)
    return frozenset().union(*(symbols_of(part) for part in expression.args))


def jacobian(expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> list[list[Expr]]:
    """Row i, column j: ∂expressions[i]/∂symbols[j]."""
    return [gradient(expression, symbols) for expression in expressions]


def momenta(system: LagrangianSystem) -> list[Expr]:
    """p_k = ∂L/∂v_k."""
    return gradient(system.lagrangian, system.velocities)


def euler_lagrange(system: LagrangianSystem, accelerations: Sequence[Symbol]) -> list[Expr]:
    """d/dt ∂L/∂v_k − ∂L/∂q_k for each k, dv/dt = accelerations (paper eq. 10); loads are not subtracted."""
    p = momenta(system)
    p_D_q = jacobian(p, system.coordinates)
    p_D_v = jacobian(p, system.velocities)
    L_q = gradient(system.lagrangian, system.coordinates)
    return [
        Add(
            *(slope * v for slope, v in zip(row_q, system.velocities, strict=True)),
            *(inertia * a for inertia, a in zip(row_v, accelerations, strict=True)),
            time_slope(system, momentum),
            -force,
        )
        for momentum, row_q, row_v, force in zip(p, p_D_q, p_D_v, L_q, strict=True)
    ]
