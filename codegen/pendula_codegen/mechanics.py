"""Analytical mechanics of any Lagrangian L(q, v, t): momenta, gradient, Hessian, Euler–Lagrange equations.

Nothing here knows about chains; chain.py builds a chain's Lagrangian and hands it over as a LagrangianSystem, as
model.py does for everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sympy import Add, Expr, Integer, Mul, Symbol

from pendula_codegen.errors import GenerationError


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
    """∂expression/∂symbol for each symbol.

    A chain's Lagrangian is a long sum of products that each hold few symbols, so every product is
    differentiated by its own symbols only, factor by factor: the work is proportional to what is not zero,
    and SymPy remembers the derivative of a factor that comes again.
    """
    parts: dict[Symbol, list[Expr]] = {symbol: [] for symbol in symbols}
    for term in Add.make_args(expression):
        factors = Mul.make_args(term)
        for k, factor in enumerate(factors):
            for symbol, slope in _factor_gradient(factor, parts.keys() & factor.free_symbols):
                parts[symbol].append(Mul(*factors[:k], slope, *factors[k + 1 :]))
    return [Add(*parts[symbol]) for symbol in symbols]


def _factor_gradient(factor: Expr, symbols: Iterable[Symbol]) -> Iterable[tuple[Symbol, Expr]]:
    if factor.is_Symbol:
        return ((symbol, Integer(1)) for symbol in symbols)
    if factor.is_Add or factor.is_Mul:
        held = list(symbols)
        return zip(held, gradient(factor, held), strict=True)
    return ((symbol, factor.diff(symbol)) for symbol in symbols)


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
