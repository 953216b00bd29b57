"""The kernel of a chain: what every system has, in the paper's terms, and the paper's own blocks and derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product

from sympy import Expr, Matrix, Rational, Symbol

from pendula_codegen.blocks import Blocks, collect_blocks, recompose
from pendula_codegen.chain import Chain
from pendula_codegen.entry_points import Argument, Declared, Function, Output, Q, SystemKernel, V
from pendula_codegen.model import Coordinate, Input, Parameter
from pendula_codegen.places import Place
from pendula_codegen.vocabulary import Form, Leaf, Vocabulary


def declared_by(chain: Chain) -> Declared:
    """What a chain has, which takes none of its equations."""
    links = chain.numbers
    axes = [""] if len(chain.model.torque) == 1 else [f"_{axis}" for axis in "xyz"]
    of_links = {
        "masses": ("kg", chain.mass, None, True),
        "lengths": ("m", chain.length, None, True),
        "damping": ("N m s", chain.damping, 0.0, False),
    }
    parameters = [
        Parameter(field, unit, tuple(map(of, links)), default, positive, per_link=True)
        for field, (unit, of, default, positive) in of_links.items()
    ]
    gravity = Parameter("gravity", "m/s^2", (chain.model.gravity,), 9.81, positive=False, per_link=False)
    return Declared(
        coordinates=[Coordinate(q, "rad") for q in chain.coordinates],
        parameters=[*parameters, gravity],
        inputs=[Input(Symbol(f"torque{axis}_{i}"), "N m") for i in links for axis in axes],
        points=[(f"bob_{i}", chain.model.dimension) for i in links],
    )


class ChainKernel(SystemKernel):
    """Everything that is emitted for one link model and number of links."""

    parameters = Argument("chain", "parameters")
    inputs = Argument("torque", "inputs")
    force_unit = "N m"
    momentum_unit = "N m s"
    mass_unit = "kg m²"

    def __init__(self, chain: Chain, paper_blocks: bool = False):
        """paper_blocks: whether the kernel has the paper's A, B, C, S, h, g as functions, which no run needs."""
        super().__init__(chain.system)
        self.chain = chain
        self.paper_blocks = paper_blocks

    @property
    def moves_by_series(self) -> bool:
        """Not in space: there rods have series without poles, which take less time."""
        return self.chain.model.dimension == 2

    @cached_property
    def blocks(self) -> Blocks:
        return collect_blocks(self.chain)

    @cached_property
    def residual(self) -> list[Expr]:
        return recompose(self.chain, self.blocks)

    @cached_property
    def mass(self) -> Matrix:
        kinds = range(self.chain.model.dof)
        return Matrix.vstack(*(Matrix.hstack(*(self.blocks.mass[a][b] for b in kinds)) for a in kinds))

    @property
    def accelerations(self) -> tuple[Symbol, ...]:
        return self.chain.accelerations

    @property
    def declared(self) -> Declared:
        return declared_by(self.chain)

    @property
    def input_rows(self) -> int:
        return len(self.chain.model.torque)

    @property
    def points(self) -> tuple[Matrix, Matrix]:
        return Matrix.hstack(*self.chain.positions), Matrix.hstack(*self.chain.rates)

    @property
    def equation(self) -> str:
        return self._paper(
            "E = C(q) a − S(q) v² + h(q) − Q(q, v, t)   [N m]   (paper eq. 15, 22)",
            "E = A(q) a − B(q) v² + C(q)[θ̇φ̇] + g(q) − Q(q, v, t)   [N m]   (paper eq. 27, corrected)",
        )

    def functions(self) -> list[Function]:
        return [
            *self.kinematics(),
            *self.energies(),
            self.mass_matrix(),
            *(self._block_functions() if self.paper_blocks else []),
            *self._generalized_force(),
            self.power(),
            *self.residuals(),
            *self._residual_jacobians(),
            *self._lagrangian_derivatives(),
            *self.momentum_forms(),
            *self.solved_forms(),
        ]

    # --- values

    def kinematics(self) -> list[Function]:
        numbers = self._paper("1, 2", "24–26")
        return [
            Function(
                "positions",
                f"Bob positions  r_i = Σ_(j≤i) l_j û_j   (paper eq. {numbers})",
                (self.parameters, Q),
                (self._points("r", self.chain.positions, "positions, a column a bob, {points}", "m"),),
            ),
            Function(
                "velocities",
                "Bob velocities  ṙ_i = Σ_(j≤i) l_j dû_j/dt",
                (self.parameters, Q, V),
                (self._points("r_dot", self.chain.rates, "velocities, a column a bob, {points}", "m/s"),),
            ),
        ]

    def _points(self, name: str, columns: Sequence[Matrix], meaning: str, unit: str) -> Output:
        shape = f"({self.chain.model.dimension} x {self.chain.links})"
        return Output(name, "points", Matrix.hstack(*columns), meaning.format(points=shape), unit)

    def energies(self) -> list[Function]:
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
                (self.parameters, Q) if name == "potential_energy" else (self.parameters, Q, V),
                (Output(symbol, "scalar", value, "scalar", "J"),),
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
        return [self._block(*row) for row in table]

    def mass_matrix(self) -> Function:
        where = self._paper("19", "28–31")
        return Function(
            "mass_matrix",
            f"Mass matrix  A = ∂p/∂v, symmetric   (paper eq. {where})",
            (self.parameters, Q),
            (self.square("A", self.mass, "mass matrix", "kg m²"),),
        )

    def _block(self, name: str, what: str, number: str, value: Matrix) -> Function:
        vector = value.cols == 1
        shape = f"({self.chain.links})" if vector else f"({self.chain.links} x {self.chain.links})"
        output = Output(
            f"{name}_block" if name in "gh" else name,
            "link_vector" if vector else "link_matrix",
            value,
            f"{what}, {shape}",
            "N m" if vector else "kg m²",
        )
        title = f"Block {name} of the equations of motion: {what}   (paper eq. {number})"
        return Function(f"block_{name}", title, (self.parameters, Q), (output,))

    # --- equations of motion

    def _generalized_force(self) -> list[Function]:
        number = self._paper("23", "23, in space")
        title = f"Generalised force  Q(q, v, torque) of torque and damping   (paper eq. {number})"
        read = (self.parameters, Q, V, self.inputs)
        forces = self.system.forces
        value = self.vector("Q", forces, "generalised force", "N m")
        D_q = self.square("Q_D_q", self.jacobian(forces, self.chain.coordinates), "∂Q/∂q", "N m")
        D_v = self.square("Q_D_v", self.jacobian(forces, self.chain.velocities), "∂Q/∂v", "N m s")
        return [
            Function("generalized_force", title, read, (value,)),
            Function("generalized_force_with_jacobians", title, read, (value, D_q, D_v)),
        ]

    def _residual_jacobians(self) -> list[Function]:
        """Each Jacobian of the residual alone."""
        _, *jacobians = self.residual_outputs
        residual = self.residuals()[0]
        return [
            Function(
                f"residual_{output.name[2:]}", f"Jacobian of the {residual.title}", residual.inputs, (output,)
            )
            for output in jacobians
        ]

    # --- the Lagrangian's derivatives

    def _lagrangian_derivatives(self) -> list[Function]:
        qq, qv, vv = self.hessian
        return [
            Function(
                "lagrangian_gradient",
                "Gradient of the Lagrangian L(q, v)",
                (self.parameters, Q, V),
                (
                    self.vector("L_q", self.L_q, "∂L/∂q", "N m"),
                    self.vector("L_v", self.L_v, "∂L/∂v = p", "N m s"),
                ),
            ),
            Function(
                "lagrangian_hessian",
                "Hessian of the Lagrangian L(q, v)",
                (self.parameters, Q, V),
                (
                    self.square("L_qq", qq, "∂²L/∂q_row ∂q_column", "N m"),
                    self.square("L_qv", qv, "∂²L/∂q_row ∂v_column", "N m s"),
                    self.square("L_vv", vv, "∂²L/∂v_row ∂v_column", "kg m²"),
                ),
            ),
        ]

    def _paper(self, planar: str, spatial: str) -> str:
        return planar if self.chain.model.dof == 1 else spatial

    # --- atoms

    def vocabularies(self) -> list[Vocabulary]:
        inertias = frozenset(s for s in self.chain.definitions if s.name.startswith("inertia"))
        alias = self.chain.mass_below(self.chain.links)
        definitions = {**tail_recursion(self.chain), **self.chain.rate_definitions}
        forms = [
            Form(pair_angles, (inertias if expanded else frozenset()) | {alias})
            for pair_angles in (True, False)
            for expanded in (False, True)
        ]
        leaves = [*self.leaves(), *self.motion()]
        return [Vocabulary(leaves, self.angles(), definitions, form) for form in forms]

    def leaves(self) -> list[Leaf]:
        chain, links = self.chain, self.chain.numbers
        fields = [("masses", chain.mass), ("lengths", chain.length), ("damping", chain.damping)]
        parameters = [
            Leaf(of(i), Place("chain", name, (i - 1,)), "parameter") for name, of in fields for i in links
        ]
        torques = [
            Leaf(component, Place("torque", index=(k, i - 1)), "input")
            for i in links
            for k, component in enumerate(chain.torque(i))
        ]
        gravity = Leaf(chain.model.gravity, Place("chain", "gravity"), "parameter")
        time = Leaf(chain.time, Place("chain", "time"), "parameter")
        return [*parameters, gravity, time, *torques]


def tail_recursion(chain: Chain) -> dict[Symbol, Expr]:
    """The chain's definitions with M_i = m_i + M_(i+1), one addition a link; M_n is m_n itself."""
    definitions = dict(chain.definitions)
    for i in chain.numbers:
        below = chain.mass_below(i + 1) if i < chain.links else Rational(0)
        definitions[chain.mass_below(i)] = chain.mass(i) + below
    return definitions
