"""A chain of n links of one model: its symbols, kinematics, energies and loads.

Kinetic energy in pair form, T = ½ Σ_ij μ_ij l_i l_j û̇_i·û̇_j with μ_ij = M_max(i,j): what two links give to it
follows from û(q_i)·û(q_j) by differentiation, is simplified once per model and instantiated per pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

from sympy import Add, Expr, Matrix, Rational, Symbol, expand, trigsimp

from pendula_codegen.errors import GenerationError
from pendula_codegen.link_model import LinkModel
from pendula_codegen.mechanics import LagrangianSystem, require_declared
from pendula_codegen.simplify import shortest_by_pythagoras


def on_link(symbol: Symbol, link: int, suffix: str = "") -> Symbol:
    """The template symbol `symbol` on link `link` (from 1): theta -> theta_2, with a suffix theta_dot_2."""
    return Symbol(f"{symbol.name}{suffix}_{link}")


@dataclass(frozen=True)
class LinkTerms:
    """What one link, or a pair, puts into the energies; template symbols carry the link number 1 or 2."""

    rate_self: Expr  # û̇_1·û̇_1
    rate_pair: Expr  # û̇_1·û̇_2
    height: Expr  # û_1·up
    loads: tuple[Expr, ...]  # Q_a of link 1


def _rate(expression: Matrix, coordinates: tuple[Symbol, ...], link: int) -> Matrix:
    """Time derivative of an expression in the coordinates of one link."""
    return sum(
        (expression.diff(on_link(q, link)) * on_link(q, link, "_dot") for q in coordinates),
        start=expression * 0,
    )


def _direction(model: LinkModel, link: int) -> Matrix:
    return model.direction.subs({q: on_link(q, link) for q in model.coordinates})


@cache
def link_terms(model: LinkModel) -> LinkTerms:
    """The simplified terms of `model`; the only place where SymPy simplifies."""
    first, second = _direction(model, 1), _direction(model, 2)
    angles = [on_link(q, 1) for q in model.coordinates]
    dot = trigsimp(first.dot(second))
    rate = _rate(first, model.coordinates, 1)
    pair = _rate(_rate(Matrix([dot]), model.coordinates, 1), model.coordinates, 2)[0]
    return LinkTerms(
        rate_self=shortest_by_pythagoras(rate.dot(rate), angles),
        rate_pair=expand(pair),
        height=first.dot(model.up),
        loads=tuple(shortest_by_pythagoras(load, angles) for load in _loads(model, first, rate)),
    )


def _loads(model: LinkModel, direction: Matrix, rate: Matrix) -> list[Expr]:
    """Q_a = torque's share − ∂(dissipation)/∂v_a, for link 1."""
    renamed = {symbol: on_link(symbol, 1) for symbol in (*model.torque, model.damping)}
    dissipation = model.dissipation(rate)
    return [
        (
            model.generalized_torque(direction, direction.diff(on_link(q, 1)))
            - dissipation.diff(on_link(q, 1, "_dot"))
        ).subs(renamed)
        for q in model.coordinates
    ]


@dataclass(frozen=True)
class Chain:
    """n links of one model. Coordinates are ordered by kind: q = (θ_1..θ_n, φ_1..φ_n).

    drives   torques by their symbols, and functions of time that are added to them
    """

    model: LinkModel
    links: int
    drives: tuple[tuple[Symbol, Expr], ...] = ()

    def __post_init__(self) -> None:
        if self.links < 1:
            raise GenerationError(f"a chain has at least one link: got --links {self.links}")
        what = f"the link direction of model '{self.model.name}'"
        require_declared(Add(*self.model.direction), self.model.coordinates, what)

    @cached_property
    def terms(self) -> LinkTerms:
        return link_terms(self.model)

    @property
    def numbers(self) -> range:
        """Link numbers as in the paper, from 1."""
        return range(1, self.links + 1)

    def _by_kind(self, suffix: str) -> tuple[Symbol, ...]:
        return tuple(on_link(q, i, suffix) for q in self.model.coordinates for i in self.numbers)

    @cached_property
    def coordinates(self) -> tuple[Symbol, ...]:
        return self._by_kind("")

    @cached_property
    def velocities(self) -> tuple[Symbol, ...]:
        return self._by_kind("_dot")

    @cached_property
    def accelerations(self) -> tuple[Symbol, ...]:
        return self._by_kind("_ddot")

    @cached_property
    def momenta(self) -> tuple[Symbol, ...]:
        return tuple(Symbol(f"p_{q.name}") for q in self.coordinates)

    def mass(self, i: int) -> Symbol:
        return on_link(self.model.mass, i)

    def length(self, i: int) -> Symbol:
        return on_link(self.model.length, i)

    def mass_below(self, i: int) -> Symbol:
        """M_i = Σ_{k≥i} m_k (paper eq. 7), as a symbol of its own."""
        return Symbol(f"M_{i}")

    def inertia(self, i: int, j: int) -> Symbol:
        """M_max(i,j) l_i l_j, as a symbol of its own."""
        return Symbol(f"inertia_{min(i, j)}_{max(i, j)}")

    def damping(self, i: int) -> Symbol:
        return on_link(self.model.damping, i)

    def torque(self, i: int) -> tuple[Symbol, ...]:
        return tuple(on_link(component, i) for component in self.model.torque)

    @property
    def time(self) -> Symbol:
        """t, s, which drives may hold."""
        return Symbol("t", real=True)

    @cached_property
    def definitions(self) -> dict[Symbol, Expr]:
        """What the symbols M_i and inertia_i_j stand for."""
        tails = {
            self.mass_below(i): Add(*(self.mass(k) for k in range(i, self.links + 1))) for i in self.numbers
        }
        pairs = {
            self.inertia(i, j): self.mass_below(j) * self.length(i) * self.length(j)
            for i in self.numbers
            for j in range(i, self.links + 1)
        }
        return {**tails, **pairs}

    def _instance(self, expression: Expr | Matrix, first: int, second: int | None = None) -> Expr | Matrix:
        """A template expression of links 1 (and 2) rewritten for links `first` (and `second`)."""
        links = {1: first} if second is None else {1: first, 2: second}
        templates = [(q, suffix) for q in self.model.coordinates for suffix in ("", "_dot")]
        templates += [(symbol, "") for symbol in (*self.model.torque, self.model.damping)]
        renamed = {
            on_link(s, k, suffix): on_link(s, i, suffix) for s, suffix in templates for k, i in links.items()
        }
        return expression.xreplace(renamed)

    @cached_property
    def positions(self) -> list[Matrix]:
        """r_i = Σ_{j≤i} l_j û(q_j) (paper eq. 1–2, 24–26)."""
        direction = _direction(self.model, 1)
        return self._running_sum([self.length(j) * self._instance(direction, j) for j in self.numbers])

    @cached_property
    def rates(self) -> list[Matrix]:
        """ṙ_i = Σ_{j≤i} l_j û̇_j."""
        rate = _rate(_direction(self.model, 1), self.model.coordinates, 1)
        return self._running_sum([self.length(j) * self._instance(rate, j) for j in self.numbers])

    @cached_property
    def rate_symbols(self) -> list[Matrix]:
        """ṙ_i as symbols of their own (x_dot_i, …), so that the bobs' energies need not be written out."""
        return [
            Matrix([Symbol(f"{axis}_dot_{i}") for axis in "xyz"[: self.model.dimension]])
            for i in self.numbers
        ]

    @cached_property
    def rate_definitions(self) -> dict[Symbol, Expr]:
        """What rate_symbols stand for: ṙ_i = ṙ_(i−1) + l_i û̇_i."""
        rate = _rate(_direction(self.model, 1), self.model.coordinates, 1)
        definitions: dict[Symbol, Expr] = {}
        before = rate * 0
        for i, symbols in zip(self.numbers, self.rate_symbols, strict=True):
            step = before + self.length(i) * self._instance(rate, i)
            definitions.update(zip(symbols, step, strict=True))
            before = symbols
        return definitions

    def _running_sum(self, steps: list[Matrix]) -> list[Matrix]:
        return [sum(steps[: i + 1], start=steps[0] * 0) for i in range(self.links)]

    @cached_property
    def kinetic_energy(self) -> Expr:
        """T = ½ Σ_i M_i l_i² |û̇_i|² + Σ_{i<j} M_j l_i l_j û̇_i·û̇_j, J (paper eq. 8), term by term."""
        own = [
            Rational(1, 2) * self.inertia(i, i) * term
            for i in self.numbers
            for term in Add.make_args(self._instance(self.terms.rate_self, i))
        ]
        shared = [
            self.inertia(i, j) * term
            for i in self.numbers
            for j in range(i + 1, self.links + 1)
            for term in Add.make_args(self._instance(self.terms.rate_pair, i, j))
        ]
        return Add(*own, *shared)

    @cached_property
    def kinetic_energy_of_bobs(self) -> Expr:
        """T = ½ Σ_i m_i |ṙ_i|², J: the definition, linear in n, in rate_symbols."""
        rates = zip(self.numbers, self.rate_symbols, strict=True)
        return Add(*(Rational(1, 2) * self.mass(i) * rate.dot(rate) for i, rate in rates))

    @cached_property
    def potential_energy(self) -> Expr:
        """U = Σ_i M_i g l_i û_i·up, J (paper eq. 9)."""
        return Add(
            *(
                self.mass_below(i)
                * self.model.gravity
                * self.length(i)
                * self._instance(self.terms.height, i)
                for i in self.numbers
            )
        )

    @cached_property
    def forces(self) -> list[Expr]:
        """Q: torque and damping along each coordinate, N m (paper eq. 23)."""
        driven: dict[Symbol, Expr] = {}
        for torque, added in self.drives:
            driven[torque] = driven.get(torque, torque) + added
        return [self._instance(load, i).xreplace(driven) for load in self.terms.loads for i in self.numbers]

    @cached_property
    def system(self) -> LagrangianSystem:
        return LagrangianSystem(
            name=self.model.name,
            coordinates=self.coordinates,
            velocities=self.velocities,
            parameters=(self.model.gravity, *map(self.length, self.numbers), *self.definitions),
            inputs=tuple(s for i in self.numbers for s in (self.damping(i), *self.torque(i))),
            lagrangian=self.kinetic_energy - self.potential_energy,
            forces=tuple(self.forces),
            time=self.time if self.drives else None,
        )
