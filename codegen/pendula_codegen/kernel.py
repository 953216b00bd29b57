"""The entry points of a dense kernel: named functions, their arguments, units and expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from sympy import Expr, Matrix, Rational, Symbol

from pendula_codegen.blocks import Blocks, collect_blocks, recompose
from pendula_codegen.chain import Chain
from pendula_codegen.mechanics import gradient, jacobian
from pendula_codegen.printing import Body, print_body
from pendula_codegen.program import Assignment, Program, shortest_program
from pendula_codegen.vocabulary import Angle, Form, Leaf, Vocabulary

INPUT_TYPES = {
    "chain": "Parameters<Real>",
    "q": "Vector<Real>",
    "v": "Vector<Real>",
    "a": "Vector<Real>",
    "p": "Vector<Real>",
    "torque": "Torque<Real>",
}


@dataclass(frozen=True)
class Output:
    """One output argument: C++ type, entries, and the line that documents it."""

    name: str
    type: str
    value: Matrix | Expr
    meaning: str
    lower: bool = False  # only the lower triangle is written

    @property
    def assignments(self) -> list[Assignment]:
        if not isinstance(self.value, Matrix):
            return [(self.name, self.value)]
        rows, columns = self.value.shape
        if self.type.startswith(("Vector", "LinkVector")):
            return [(f"{self.name}[{i}]", self.value[i, 0]) for i in range(rows)]
        return [
            (f"{self.name}({i}, {j})", self.value[i, j])
            for i, j in product(range(rows), range(columns))
            if j <= i or not self.lower
        ]


@dataclass(frozen=True)
class Function:
    """An entry point. `other_values`: another form of the outputs' values, kept when it is cheaper."""

    name: str
    title: str
    inputs: tuple[str, ...]
    outputs: tuple[Output, ...]
    other_values: tuple[Matrix | Expr, ...] = ()

    def candidates(self) -> list[list[Assignment]]:
        first = [assignment for output in self.outputs for assignment in output.assignments]
        if not self.other_values:
            return [first]
        others = [
            replace(output, value=value)
            for output, value in zip(self.outputs, self.other_values, strict=True)
        ]
        return [first, [assignment for output in others for assignment in output.assignments]]


@dataclass(frozen=True)
class RenderedFunction:
    function: Function
    body: Body

    @property
    def arguments(self) -> list[str]:
        """Parameters of the C++ function; an input that the mathematics does not need stays, unnamed."""
        read = [
            f"const {INPUT_TYPES[name]}& {name if name in self.body.sources else f'/*{name}*/'}"
            for name in self.function.inputs
        ]
        return [*read, *(f"{output.type}& {output.name}" for output in self.function.outputs)]


class DenseKernel:
    """Everything that is emitted for one model and number of links."""

    def __init__(self, chain: Chain):
        self.chain = chain

    @cached_property
    def blocks(self) -> Blocks:
        return collect_blocks(self.chain)

    @cached_property
    def residual(self) -> list[Expr]:
        return recompose(self.chain, self.blocks)

    @cached_property
    def _at_rest(self) -> list[Expr]:
        """−E with zero accelerations: the right-hand side of A a = b."""
        still = {a: Rational(0) for a in self.chain.accelerations}
        return [-equation.xreplace(still) for equation in self.residual]

    def functions(self) -> list[Function]:
        return [
            *self._kinematics(),
            *self._energies(),
            *self._block_functions(),
            *self._forces(),
            *self._residuals(),
            *self._lagrangian_derivatives(),
            *self._momentum_forms(),
            self._linear_system(),
        ]

    # --- values

    def _kinematics(self) -> list[Function]:
        numbers = self._paper("1, 2", "24–26")
        return [
            Function(
                "positions",
                f"Bob positions  r_i = Σ_(j≤i) l_j û_j   (paper eq. {numbers})",
                ("chain", "q"),
                (self._points("r", self.chain.positions, "positions, a column a bob, {points}", "m"),),
            ),
            Function(
                "velocities",
                "Bob velocities  ṙ_i = Σ_(j≤i) l_j dû_j/dt",
                ("chain", "q", "v"),
                (self._points("r_dot", self.chain.rates, "velocities, a column a bob, {points}", "m/s"),),
            ),
        ]

    def _points(self, name: str, columns: Sequence[Matrix], meaning: str, unit: str) -> Output:
        shape = f"({self.chain.model.dimension} x {self.chain.links})"
        return Output(name, "Points<Real>", Matrix.hstack(*columns), f"{meaning.format(points=shape)}|{unit}")

    def _energies(self) -> list[Function]:
        T, bobs, U = self.chain.kinetic_energy, self.chain.kinetic_energy_of_bobs, self.chain.potential_energy
        table = [
            ("kinetic_energy", "T", "Kinetic energy  T = ½ Σ m_i |ṙ_i|²   (paper eq. 8)", T, bobs),
            ("potential_energy", "U", "Potential energy  U = Σ M_i g l_i û_i·up   (paper eq. 9)", U, None),
            ("energy", "E", "Energy  E = T + U", T + U, bobs + U),
            ("lagrangian", "L", "Lagrangian  L = T − U", T - U, bobs - U),
        ]
        return [
            Function(
                name,
                title,
                ("chain", "q") if name == "potential_energy" else ("chain", "q", "v"),
                (Output(symbol, "Real", value, "scalar|J"),),
                (other,) if other is not None else (),
            )
            for name, symbol, title, value, other in table
        ]

    def _block_functions(self) -> list[Function]:
        dof, blocks = self.chain.model.dof, self.blocks
        if dof == 1:
            table = [
                ("C", "coefficients of the accelerations", "19", blocks.mass[0][0]),
                ("S", "coefficients of the squared rates", "20, corrected", blocks.square[0][0]),
                ("h", "gravity", "18", blocks.rest[0]),
            ]
        else:
            kinds = list(product(range(2), range(2)))
            mass_numbers, square_numbers = ["28", "29", "30", "31"], ["32", "33", "34", "34"]
            table = [
                *(
                    (f"A{a + 1}{b + 1}", "coefficients of the accelerations", number, blocks.mass[a][b])
                    for (a, b), number in zip(kinds, mass_numbers, strict=True)
                ),
                *(
                    (f"B{a + 1}{b + 1}", "coefficients of the squared rates", number, blocks.square[a][b])
                    for (a, b), number in zip(kinds, square_numbers, strict=True)
                ),
                *(
                    (
                        f"C{a + 1}",
                        "coefficients of the products θ̇_j φ̇_j",
                        f"{35 + a}, corrected",
                        blocks.cross[a],
                    )
                    for a in range(2)
                ),
                ("g", "gravity", "37", blocks.rest[0]),
            ]
        return [self._mass_matrix(), *(self._block(*row) for row in table)]

    def _mass_matrix(self) -> Function:
        where = self._paper("19", "28–31")
        return Function(
            "mass_matrix",
            f"Mass matrix  A = ∂p/∂v, symmetric   (paper eq. {where})",
            ("chain", "q"),
            (self._square("A", self._mass, "mass matrix", "kg m²"),),
        )

    def _block(self, name: str, what: str, number: str, value: Matrix) -> Function:
        vector = value.cols == 1
        shape = f"({self.chain.links})" if vector else f"({self.chain.links} x {self.chain.links})"
        output = Output(
            f"{name}_block" if name in "gh" else name,
            "LinkVector<Real>" if vector else "LinkMatrix<Real>",
            value,
            f"{what}, {shape}|{'N m' if vector else 'kg m²'}",
        )
        title = f"Block {name} of the equations of motion: {what}   (paper eq. {number})"
        return Function(f"block_{name}", title, ("chain", "q"), (output,))

    # --- equations of motion

    @cached_property
    def _mass(self) -> Matrix:
        kinds = range(self.chain.model.dof)
        return Matrix.vstack(*(Matrix.hstack(*(self.blocks.mass[a][b] for b in kinds)) for a in kinds))

    def _jacobian(self, expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> Matrix:
        return Matrix(jacobian(expressions, symbols))

    def _vector(self, name: str, value: Sequence[Expr], meaning: str, unit: str) -> Output:
        return Output(name, "Vector<Real>", Matrix(list(value)), f"{meaning}, ({len(value)})|{unit}")

    def _square(self, name: str, value: Matrix, meaning: str, unit: str, lower: bool = False) -> Output:
        size = value.rows
        return Output(name, "Matrix<Real>", value, f"{meaning}, ({size} x {size})|{unit}", lower)

    def _forces(self) -> list[Function]:
        number = self._paper("23", "23, in space")
        title = f"Generalised force  Q(q, v, torque) of torque and damping   (paper eq. {number})"
        inputs = ("chain", "q", "v", "torque")
        Q = self.chain.forces
        value = self._vector("Q", Q, "generalised force", "N m")
        return [
            Function("generalized_force", title, inputs, (value,)),
            Function(
                "generalized_force_with_jacobians",
                title,
                inputs,
                (
                    value,
                    self._square("Q_D_q", self._jacobian(Q, self.chain.coordinates), "∂Q/∂q", "N m"),
                    self._square("Q_D_v", self._jacobian(Q, self.chain.velocities), "∂Q/∂v", "N m s"),
                ),
            ),
        ]

    def _residuals(self) -> list[Function]:
        equation = self._paper(
            "E = C(q) a − S(q) v² + h(q) − Q(q, v, t)   [N m]   (paper eq. 15, 22)",
            "E = A(q) a − B(q) v² + C(q)[θ̇φ̇] + g(q) − Q(q, v, t)   [N m]   (paper eq. 27, corrected)",
        )
        inputs = ("chain", "q", "v", "a", "torque")
        value = self._vector("E", self.residual, "residual", "N m")
        D_q = self._square(
            "E_D_q", self._jacobian(self.residual, self.chain.coordinates), "∂E_row/∂q_column", "N m"
        )
        D_v = self._square(
            "E_D_v", self._jacobian(self.residual, self.chain.velocities), "∂E_row/∂v_column", "N m s"
        )
        D_a = self._square("E_D_a", self._mass, "∂E_row/∂a_column = mass matrix", "kg m²")
        title = f"Euler–Lagrange residual  {equation}"
        return [
            Function("residual", title, inputs, (value,)),
            *(
                Function(name, f"Jacobian of the Euler–Lagrange residual  {equation}", inputs, (output,))
                for name, output in (("residual_D_q", D_q), ("residual_D_v", D_v), ("residual_D_a", D_a))
            ),
            Function("residual_with_jacobians", title, inputs, (value, D_q, D_v, D_a)),
        ]

    # --- the Lagrangian's derivatives

    @cached_property
    def _L_q(self) -> list[Expr]:
        return gradient(self.chain.system.lagrangian, self.chain.coordinates)

    @cached_property
    def _L_v(self) -> list[Expr]:
        return gradient(self.chain.system.lagrangian, self.chain.velocities)

    @cached_property
    def _hessian(self) -> tuple[Matrix, Matrix, Matrix]:
        q, v = self.chain.coordinates, self.chain.velocities
        return self._jacobian(self._L_q, q), self._jacobian(self._L_q, v), self._jacobian(self._L_v, v)

    def _lagrangian_derivatives(self) -> list[Function]:
        qq, qv, vv = self._hessian
        return [
            Function(
                "lagrangian_gradient",
                "Gradient of the Lagrangian L(q, v)",
                ("chain", "q", "v"),
                (
                    self._vector("L_q", self._L_q, "∂L/∂q", "N m"),
                    self._vector("L_v", self._L_v, "∂L/∂v = p", "N m s"),
                ),
            ),
            Function(
                "lagrangian_hessian",
                "Hessian of the Lagrangian L(q, v)",
                ("chain", "q", "v"),
                (
                    self._square("L_qq", qq, "∂²L/∂q_row ∂q_column", "N m"),
                    self._square("L_qv", qv, "∂²L/∂q_row ∂v_column", "N m s"),
                    self._square("L_vv", vv, "∂²L/∂v_row ∂v_column", "kg m²"),
                ),
            ),
        ]

    def _momentum_forms(self) -> list[Function]:
        qq, qv, vv = self._hessian
        Q = self.chain.forces
        f = [slope + force for slope, force in zip(self._L_q, Q, strict=True)]
        inputs = ("chain", "q", "v", "torque")
        title = "Momentum form  p = ∂L/∂v,  f = ∂L/∂q + Q, so that dq/dt = v, dp/dt = f"
        p = self._vector("p", self._L_v, "momenta", "N m s")
        force = self._vector("f", f, "rates of the momenta", "N m")
        f_D_q = qq + self._jacobian(Q, self.chain.coordinates)
        f_D_v = qv + self._jacobian(Q, self.chain.velocities)
        return [
            Function("momentum_form", title, inputs, (p, force)),
            Function(
                "momentum_form_with_jacobians",
                title,
                inputs,
                (
                    p,
                    force,
                    self._square("p_D_q", qv.T, "∂p_row/∂q_column", "N m s"),
                    self._square("p_D_v", vv, "∂p_row/∂v_column = mass matrix", "kg m²"),
                    self._square("f_D_q", f_D_q, "∂f_row/∂q_column", "N m"),
                    self._square("f_D_v", f_D_v, "∂f_row/∂v_column", "N m s"),
                ),
            ),
            Function("momentum_from_velocity", "Momenta  p = A(q) v", ("chain", "q", "v"), (p,)),
        ]

    def _linear_system(self) -> Function:
        return Function(
            "acceleration_system",
            "Linear system  A a = b  of the accelerations; of A only the lower triangle is written",
            ("chain", "q", "v", "torque"),
            (
                self._square("A", self._mass, "mass matrix, lower triangle", "kg m²", lower=True),
                self._vector("b", self._at_rest, "−E at zero acceleration", "N m"),
            ),
        )

    def _paper(self, planar: str, spatial: str) -> str:
        return planar if self.chain.model.dof == 1 else spatial

    # --- rendering

    def render(self) -> list[RenderedFunction]:
        return [
            RenderedFunction(function, print_body(self.program(function))) for function in self.functions()
        ]

    def program(self, function: Function) -> Program:
        return shortest_program(function.candidates(), self._vocabularies)

    @cached_property
    def _vocabularies(self) -> list[Vocabulary]:
        """One per form; shared by all functions, so that what two of them hold is expanded once."""
        inertias = frozenset(s for s in self.chain.definitions if s.name.startswith("inertia"))
        alias = self.chain.mass_below(self.chain.links)
        definitions = {**tail_recursion(self.chain), **self.chain.rate_definitions}
        forms = [
            Form(pair_angles, (inertias if expanded else frozenset()) | {alias})
            for pair_angles in (True, False)
            for expanded in (False, True)
        ]
        return [Vocabulary(self._leaves(), self._angles(), definitions, form) for form in forms]

    def _leaves(self) -> list[Leaf]:
        chain, links = self.chain, self.chain.numbers
        fields = [("masses", chain.mass), ("lengths", chain.length), ("damping", chain.damping)]
        parameters = [Leaf(of(i), f"chain.{name}[{i - 1}]", "chain") for name, of in fields for i in links]
        torques = [
            Leaf(component, f"torque({k}, {i - 1})", "torque")
            for i in links
            for k, component in enumerate(chain.torque(i))
        ]
        motion = [
            Leaf(symbol, f"{name}[{k}]", name)
            for name, symbols in (("v", chain.velocities), ("a", chain.accelerations))
            for k, symbol in enumerate(symbols)
        ]
        return [*parameters, Leaf(chain.model.gravity, "chain.gravity", "chain"), *torques, *motion]

    def _angles(self) -> list[Angle]:
        return [Angle(q, f"sin(q[{k}])", f"cos(q[{k}])", "q") for k, q in enumerate(self.chain.coordinates)]


def tail_recursion(chain: Chain) -> dict[Symbol, Expr]:
    """The chain's definitions with M_i = m_i + M_(i+1), one addition a link; M_n is m_n itself."""
    definitions = dict(chain.definitions)
    for i in chain.numbers:
        below = chain.mass_below(i + 1) if i < chain.links else Rational(0)
        definitions[chain.mass_below(i)] = chain.mass(i) + below
    return definitions
