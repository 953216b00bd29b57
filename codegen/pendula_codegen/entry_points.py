"""The entry points of a kernel: named functions, their arguments and what they compute, as places and expressions.

Which functions a kernel of any mechanical system has is said here; what chains have besides, in chain_kernel.py.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

from sympy import Add, Expr, Integer, Matrix, Rational, Symbol, expand

from pendula_codegen.mechanics import (
    LagrangianSystem,
    euler_lagrange,
    gradient,
    jacobian,
    time_slope,
)
from pendula_codegen.model import Coordinate, Input, Parameter
from pendula_codegen.places import Place
from pendula_codegen.program import Assignment, Program, shortest_program
from pendula_codegen.vocabulary import Angle, Form, Leaf, Vocabulary


@dataclass(frozen=True)
class Argument:
    """An input argument. `type`: parameters, inputs, vector (one number a coordinate)."""

    name: str
    type: str


@dataclass(frozen=True)
class Output:
    """One output argument: its type, its entries, and what documents it.

    type    scalar, vector, matrix, points, arguments, switches, constraints (a number each), constraint_slopes
            (a row each), link_vector or link_matrix
    lower   only the lower triangle is written
    """

    name: str
    type: str
    value: Matrix | Expr
    meaning: str
    unit: str = ""
    lower: bool = False

    @property
    def assignments(self) -> list[Assignment]:
        if not isinstance(self.value, Matrix):
            return [(Place(self.name), self.value)]
        rows, columns = self.value.shape
        if columns == 1 and self.type in ("vector", "link_vector", "arguments", "switches", "constraints"):
            return [(Place(self.name, index=(i,)), self.value[i, 0]) for i in range(rows)]
        return [
            (Place(self.name, index=(i, j)), self.value[i, j])
            for i, j in product(range(rows), range(columns))
            if j <= i or not self.lower
        ]


@dataclass(frozen=True)
class Solve:
    """A linear system that is solved within a function, before the other outputs are computed from its solution.

    matrix     symmetric positive definite, a local variable
    solution   an output; its value is the right-hand side
    unknowns   the symbols that the other outputs read the solution by
    """

    matrix: Output
    solution: Output
    unknowns: tuple[Symbol, ...]
    kind: str  # of the unknowns: v or a

    @property
    def assignments(self) -> list[Assignment]:
        return [*self.matrix.assignments, *self.solution.assignments]


@dataclass(frozen=True)
class Function:
    """An entry point. `other_values`: another form of the outputs' values, kept when it is cheaper."""

    name: str
    title: str
    inputs: tuple[Argument, ...]
    outputs: tuple[Output, ...]
    other_values: tuple[Matrix | Expr, ...] = ()
    solve: Solve | None = None

    @property
    def written(self) -> tuple[Output, ...]:
        """All outputs, in the order of the arguments."""
        return self.outputs if self.solve is None else (self.solve.solution, *self.outputs)

    def candidates(self) -> list[list[Assignment]]:
        first = [] if self.solve is None else self.solve.assignments
        values = [tuple(output.value for output in self.outputs)]
        if self.other_values:
            values.append(self.other_values)
        return [
            [
                *first,
                *(
                    assignment
                    for output, value in zip(self.outputs, chosen, strict=True)
                    for assignment in Output(
                        output.name, output.type, value, output.meaning, lower=output.lower
                    ).assignments
                ),
            ]
            for chosen in values
        ]


@dataclass(frozen=True)
class Declared:
    """What a system has: `points` by name and number of components; `switches` that decide between pieces, as text;
    `forces` of constraints by name and unit.

    The last parameters are two indicators for each switch.
    """

    coordinates: list[Coordinate]
    parameters: list[Parameter]
    inputs: list[Input]
    points: list[tuple[str, int]]
    switches: Sequence[str] = ()
    forces: Sequence[tuple[str, str]] = ()


V, Q, P, A = (Argument(name, "vector") for name in "vqpa")


class SystemKernel(ABC):
    """Everything that is emitted for one mechanical system."""

    parameters = Argument("parameters", "parameters")
    inputs = Argument("inputs", "inputs")
    equation = "E = d/dt ∂L/∂v − ∂L/∂q − Q"
    suffix = ""  # of variables that are called after something of the model
    force_unit = ""
    momentum_unit = ""
    mass_unit = ""

    def __init__(self, system: LagrangianSystem):
        self.system = system

    # --- what a kind of system says of itself

    @property
    def moves_by_series(self) -> bool:
        """Whether Taylor series of it are of use."""
        return True

    @abstractmethod
    def leaves(self) -> list[Leaf]:
        """Parameters and inputs, and where they stand."""

    @property
    @abstractmethod
    def declared(self) -> Declared:
        """Names, units and defaults, in the order in which numbers stand."""

    @property
    def input_rows(self) -> int:
        """Rows of the array of inputs, whose columns stand one after the other."""
        return len(self.system.inputs)

    @property
    @abstractmethod
    def points(self) -> tuple[Matrix | None, Matrix | None]:
        """Positions and velocities of the points that files and pictures show."""

    def angles(self) -> list[Angle]:
        """Coordinates whose sines and cosines are computed once each."""
        return [Angle(q, Place("q", index=(k,))) for k, q in enumerate(self.system.coordinates)]

    def vocabularies(self) -> list[Vocabulary]:
        """One per form; shared by all functions, so that what two of them hold is expanded once."""
        return self.plain_vocabularies()

    def plain_vocabularies(self) -> list[Vocabulary]:
        """Those of expressions that somebody wrote, whose sums stay as they are."""
        forms = [Form(pair_angles, frozenset()) for pair_angles in (True, False)]
        leaves = [*self.leaves(), *self.motion()]
        return [Vocabulary(leaves, self.angles(), {}, form, keep_sums=True) for form in forms]

    def functions(self) -> list[Function]:
        """All entry points, in the order of the header."""
        return [
            *self.kinematics(),
            *self.energies(),
            self.mass_matrix(),
            self.power(),
            *self.momentum_forms(),
            *self.solved_forms(),
            *self.residuals(),
        ]

    # --- values

    @property
    def accelerations(self) -> tuple[Symbol, ...]:
        return self.system.accelerations

    @cached_property
    def momentum_symbols(self) -> tuple[Symbol, ...]:
        return tuple(Symbol(f"p_{q.name}") for q in self.system.coordinates)

    def motion(self) -> list[Leaf]:
        system = self.system
        return [
            Leaf(symbol, Place(name, index=(k,)), name)
            for name, symbols in (
                ("q", system.coordinates),
                ("v", system.velocities),
                ("a", self.accelerations),
                ("p", self.momentum_symbols),
            )
            for k, symbol in enumerate(symbols)
        ]

    @cached_property
    def L_q(self) -> list[Expr]:
        return gradient(self.system.lagrangian, self.system.coordinates)

    @cached_property
    def L_v(self) -> list[Expr]:
        return gradient(self.system.lagrangian, self.system.velocities)

    @cached_property
    def hessian(self) -> tuple[Matrix, Matrix, Matrix]:
        q, v = self.system.coordinates, self.system.velocities
        return self.jacobian(self.L_q, q), self.jacobian(self.L_q, v), self.jacobian(self.L_v, v)

    @cached_property
    def mass(self) -> Matrix:
        return self.hessian[2]

    @cached_property
    def residual(self) -> list[Expr]:
        equations = euler_lagrange(self.system, self.accelerations)
        return [e - force for e, force in zip(equations, self.system.forces, strict=True)]

    @cached_property
    def kinetic_energy(self) -> Expr:
        """½ vᵀ M v; of terms of L that are it, as they are: squares of sums have digits that their products lose."""
        quadratic, others = self._by_degree
        v = Matrix(self.system.velocities)
        slopes = gradient(Add(*others), self.system.velocities)
        mass = self.jacobian(slopes, self.system.velocities)
        return Add(*quadratic, Rational(1, 2) * (v.T * mass * v)[0])

    @cached_property
    def energy(self) -> Expr:
        """v·∂L/∂v − L, in the same way."""
        quadratic, others = self._by_degree
        slopes = gradient(Add(*others), self.system.velocities)
        gained = (v * p for v, p in zip(self.system.velocities, slopes, strict=True))
        return Add(*quadratic, *gained, *(-term for term in others))

    @cached_property
    def _by_degree(self) -> tuple[list[Expr], list[Expr]]:
        """Terms of L that are squares in the rates, and the others."""
        quadratic, others = [], []
        for term in Add.make_args(self.system.lagrangian):
            pairs = zip(self.system.velocities, gradient(term, self.system.velocities), strict=True)
            twice = Add(*(v * slope for v, slope in pairs))
            is_square = twice != 0 and expand(twice - 2 * term) == 0
            (quadratic if is_square else others).append(term)
        return quadratic, others

    @cached_property
    def _momentum_at_rest(self) -> list[Expr]:
        """∂L/∂v at v = 0: not zero where L has terms linear in the rates."""
        still = {v: Integer(0) for v in self.system.velocities}
        return [p.xreplace(still) for p in self.L_v]

    @cached_property
    def _at_rest(self) -> list[Expr]:
        """−E with zero accelerations: the right-hand side of M a = b."""
        still = {a: Integer(0) for a in self.accelerations}
        return [-equation.xreplace(still) for equation in self.residual]

    def jacobian(self, expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> Matrix:
        return Matrix(jacobian(expressions, symbols))

    def vector(self, name: str, value: Sequence[Expr], meaning: str, unit: str) -> Output:
        return Output(name, "vector", Matrix(list(value)), f"{meaning}, ({len(value)})", unit)

    def square(self, name: str, value: Matrix, meaning: str, unit: str, lower: bool = False) -> Output:
        return Output(name, "matrix", value, f"{meaning}, ({value.rows} x {value.rows})", unit, lower)

    # --- functions

    def kinematics(self) -> list[Function]:
        positions, velocities = self.points
        if positions is None:
            return []
        return [
            Function(
                "positions",
                "Points, component by component",
                (self.parameters, Q),
                (Output("r", "points", positions, f"positions, ({positions.rows})", "m"),),
            ),
            Function(
                "velocities",
                "Velocities of the points, component by component",
                (self.parameters, Q, V),
                (Output("r_dot", "points", velocities, f"velocities, ({positions.rows})", "m/s"),),
            ),
        ]

    def energies(self) -> list[Function]:
        read = (self.parameters, Q, V)
        T, h = self.kinetic_energy, self.energy
        return [
            Function(
                "kinetic_energy",
                "Kinetic energy  T = ½ vᵀ M v",
                read,
                (Output("T", "scalar", T, "scalar", "J"),),
            ),
            Function("energy", "Energy  h = v·∂L/∂v − L", read, (Output("h", "scalar", h, "scalar", "J"),)),
        ]

    def mass_matrix(self) -> Function:
        return Function(
            "mass_matrix",
            "Mass matrix  M = ∂p/∂v, symmetric",
            (self.parameters, Q),
            (self.square("M", self.mass, "mass matrix", self.mass_unit),),
        )

    def power(self) -> Function:
        gained = zip(self.system.forces, self.system.velocities, strict=True)
        value = sum((force * v for force, v in gained), -time_slope(self.system, self.system.lagrangian))
        return Function(
            "power",
            "What forces, and L where it holds time, bring  dh/dt = Q·v − ∂L/∂t",
            (self.parameters, Q, V, self.inputs),
            (Output("P", "scalar", value, "scalar", "W"),),
        )

    def momentum_forms(self) -> list[Function]:
        qq, qv, _ = self.hessian
        forces, q, v = self.system.forces, self.system.coordinates, self.system.velocities
        f = [slope + force for slope, force in zip(self.L_q, forces, strict=True)]
        read = (self.parameters, Q, V, self.inputs)
        title = "Momentum form  p = ∂L/∂v,  f = ∂L/∂q + Q, so that dq/dt = v, dp/dt = f"
        p = self.vector("p", self.L_v, "momenta", self.momentum_unit)
        force = self.vector("f", f, "rates of the momenta", self.force_unit)
        f_D_q = qq + self.jacobian(forces, q)
        f_D_v = qv + self.jacobian(forces, v)
        return [
            Function("momentum_form", title, read, (p, force)),
            Function(
                "momentum_form_with_jacobians",
                title,
                read,
                (
                    p,
                    force,
                    self.square("p_D_q", qv.T, "∂p_row/∂q_column", self.momentum_unit),
                    self.square("p_D_v", self.mass, "∂p_row/∂v_column = mass matrix", self.mass_unit),
                    self.square("f_D_q", f_D_q, "∂f_row/∂q_column", self.force_unit),
                    self.square("f_D_v", f_D_v, "∂f_row/∂v_column", self.momentum_unit),
                ),
            ),
            Function("momentum_from_velocity", "Momenta  p = ∂L/∂v", (self.parameters, Q, V), (p,)),
        ]

    def solved_forms(self) -> list[Function]:
        """Those that solve M x = b."""
        forces = self.system.forces
        f = [slope + force for slope, force in zip(self.L_q, forces, strict=True)]
        matrix = self.square("M", self.mass, "mass matrix, lower triangle", self.mass_unit, lower=True)
        momentum = [p - b for p, b in zip(self.momentum_symbols, self._momentum_at_rest, strict=True)]
        rates = self.vector("v", momentum, "rates; not finite where the mass matrix is singular", "")
        accelerations = self.vector(
            "a", self._at_rest, "accelerations; not finite where the mass matrix is singular", ""
        )
        by_momentum = Solve(matrix, rates, self.system.velocities, "v")
        return [
            Function(
                "hamiltonian_form",
                "Hamiltonian form  v = M⁻¹ (p − ∂L/∂v at v = 0),  f = ∂L/∂q + Q: dq/dt and dp/dt in one pass",
                (self.parameters, Q, P, self.inputs),
                (self.vector("f", f, "rates of the momenta", self.force_unit),),
                solve=by_momentum,
            ),
            Function(
                "velocity_from_momentum",
                "Rates from momenta  v = M⁻¹ (p − ∂L/∂v at v = 0)",
                (self.parameters, Q, P),
                (),
                solve=by_momentum,
            ),
            Function(
                "acceleration",
                f"Accelerations: {self.equation} = 0",
                (self.parameters, Q, V, self.inputs),
                (),
                solve=Solve(matrix, accelerations, self.accelerations, "a"),
            ),
        ]

    def residuals(self) -> list[Function]:
        read = (self.parameters, Q, V, A, self.inputs)
        title = f"Euler–Lagrange residual  {self.equation}"
        value, *jacobians = self.residual_outputs
        return [
            Function("residual", title, read, (value,)),
            Function("residual_with_jacobians", title, read, (value, *jacobians)),
        ]

    @cached_property
    def residual_outputs(self) -> tuple[Output, ...]:
        """E, ∂E/∂q, ∂E/∂v, ∂E/∂a."""
        q, v = self.system.coordinates, self.system.velocities
        return (
            self.vector("E", self.residual, "residual", self.force_unit),
            self.square("E_D_q", self.jacobian(self.residual, q), "∂E_row/∂q_column", self.force_unit),
            self.square("E_D_v", self.jacobian(self.residual, v), "∂E_row/∂v_column", self.momentum_unit),
            self.square("E_D_a", self.mass, "∂E_row/∂a_column = mass matrix", self.mass_unit),
        )

    # --- programs

    @cached_property
    def shared_vocabularies(self) -> list[Vocabulary]:
        return self.vocabularies()

    def program(self, function: Function) -> Program:
        return shortest_program(function.candidates(), self.shared_vocabularies)
