"""The n-independent kernel of one link: û(q) and its derivatives, for solvers that walk along chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

from sympy import (
    Expr,
    Integer,
    Matrix,
    Rational,
    Symbol,
    cos,
    cxxcode,
    fraction,
    simplify,
    sin,
    together,
    zeros,
)

from pendula_codegen.backends.cpp import Body, array_entry, print_body
from pendula_codegen.link_model import LinkModel
from pendula_codegen.places import Place
from pendula_codegen.program import Assignment, Program, shortest_program
from pendula_codegen.vocabulary import Angle, Form, Leaf, Vocabulary

ORDER_NAMES = {1: "first", 2: "second"}


@dataclass(frozen=True)
class LinkFunction:
    """An entry point of the link kernel: what it reads, what it writes, and what to say about it."""

    name: str
    title: str
    inputs: tuple[tuple[str, str], ...]  # C++ type, name
    outputs: tuple[tuple[str, str], ...]
    assignments: tuple[Assignment, ...]
    leaves: tuple[Leaf, ...] = ()


@dataclass(frozen=True)
class RenderedLinkFunction:
    name: str
    documentation: list[str]
    arguments: list[str]
    body: Body


class LinkKernel:
    def __init__(self, model: LinkModel):
        self.model = model

    def indices(self, order: int) -> list[tuple[int, ...]]:
        """Sets of `order` coordinates in storage order: θθ, θφ, φφ."""
        return list(combinations_with_replacement(range(self.model.dof), order))

    def index_names(self) -> dict[int, list[str]]:
        coordinates = [q.name for q in self.model.coordinates]
        return {
            order: [" ".join(coordinates[a] for a in index) for index in self.indices(order)]
            for order in ORDER_NAMES
        }

    def derivative(self, index: Sequence[int]) -> Matrix:
        value = self.model.direction
        for a in index:
            value = value.diff(self.model.coordinates[a])
        return value

    def functions(self) -> list[LinkFunction]:
        trig = (("Trig<Real>", "trig"),)
        first = [
            LinkFunction(
                "direction",
                "Direction û(q), a unit vector.",
                trig,
                (("Cartesian<Real>", "u"),),
                tuple(_entries("u", (), self.model.direction)),
            )
        ]
        others = [
            LinkFunction(
                f"direction_{name}",
                f"Derivatives of û of order {order}: {', '.join(self.index_names()[order])}.",
                trig,
                ((f"{name.capitalize()}<Real>", f"u_{'abc'[:order]}"),),
                tuple(
                    entry
                    for k, index in enumerate(self.indices(order))
                    for entry in _entries(f"u_{'abc'[:order]}", (k,), self.derivative(index))
                ),
            )
            for order, name in ORDER_NAMES.items()
        ]
        return [*first, *others, *self._motion(), self._torque_load()]

    def _motion(self) -> list[LinkFunction]:
        """Entry points between coordinates and Cartesian vectors."""
        v, u_dot = self._leaves("v"), self._leaves("u_dot")
        inverse = Leaf(self.inverse, Place("inverse_determinant"), "inverse_determinant")
        dual = (("Trig<Real>", "trig"), ("Real", "inverse_determinant"))
        trig = (("Trig<Real>", "trig"),)
        return [
            LinkFunction(
                "velocity",
                "Rate of the direction, sum of v_a u_a.",
                (*trig, ("Coordinates<Real>", "v")),
                (("Cartesian<Real>", "u_dot"),),
                tuple(_entries("u_dot", (), self._sum(v, self._first))),
                v,
            ),
            LinkFunction(
                "metric_determinant",
                "Determinant of the metric u_a·u_b, zero where the coordinates fail.",
                trig,
                (("Real", "determinant"),),
                ((Place("determinant"), self._determinant),),
            ),
            LinkFunction(
                "rates",
                "Rates v_a = u^a·u_dot of the coordinates from the rate of the direction.",
                (*dual, ("Cartesian<Real>", "u_dot")),
                (("Coordinates<Real>", "v"),),
                tuple((Place("v", index=(a,)), _dot(self._dual[a], u_dot)) for a in range(self.model.dof)),
                (*u_dot, inverse),
            ),
        ]

    def _torque_load(self) -> LinkFunction:
        """A torque as a vector: its generalised force along q_a is u_a·load."""
        model = self.model
        u, torque = self._leaves("u"), self._leaves("torque", len(model.torque))
        direction = Matrix([leaf.symbol for leaf in u])
        axes = [Matrix([int(j == k) for j in range(model.dimension)]) for k in range(model.dimension)]
        turn = dict(zip(model.torque, [leaf.symbol for leaf in torque], strict=True))
        turning = Matrix([model.generalized_torque(direction, axis).subs(turn) for axis in axes])
        return LinkFunction(
            "torque_load",
            "Load of a torque on a link of direction u.",
            (("Torque<Real>", "torque"), ("Cartesian<Real>", "u")),
            (("Cartesian<Real>", "load"),),
            tuple(_entries("load", (), turning)),
            (*torque, *u),
        )

    inverse = Symbol("inverse")

    @cached_property
    def _first(self) -> list[Matrix]:
        return [self.derivative((a,)) for a in range(self.model.dof)]

    @cached_property
    def _determinant(self) -> Expr:
        return simplify(self._metric.det())

    @cached_property
    def _metric(self) -> Matrix:
        return Matrix(
            self.model.dof, self.model.dof, lambda a, b: simplify(self._first[a].dot(self._first[b]))
        )

    @cached_property
    def _dual(self) -> list[Matrix]:
        """u^a with u^a·u_b = 1 for a = b and 0 otherwise; divisions are by inverse_determinant."""
        inverse = self._metric.inv()
        dual = [
            sum(
                (inverse[a, b] * self._first[b] for b in range(self.model.dof)),
                zeros(self.model.dimension, 1),
            )
            for a in range(self.model.dof)
        ]
        return [vector.applyfunc(self._without_division) for vector in dual]

    def _without_division(self, value: Expr) -> Expr:
        value = simplify(value)
        if fraction(together(value))[1] == 1:
            return value
        return simplify(value * self._determinant) * self.inverse

    def _leaves(self, name: str, count: int | None = None) -> tuple[Leaf, ...]:
        """Components of the vector argument `name`, Cartesian, or one a coordinate for rates."""
        if count is None:
            count = self.model.dof if name == "v" else self.model.dimension
        return tuple(
            Leaf(Symbol(f"{name}_{k}"), Place(name, index=(k,)), "input" if name == "torque" else name)
            for k in range(count)
        )

    def _sum(self, factors: Sequence[Leaf], vectors: Sequence[Matrix]) -> Matrix:
        terms = (factor.symbol * vector for factor, vector in zip(factors, vectors, strict=True))
        return sum(terms, zeros(self.model.dimension, 1))

    def angles(self) -> list[tuple[str, str]]:
        """C++ for (y, x) of each coordinate atan2(y, x) of a direction u."""
        u = Matrix([Symbol(f"u[{k}]") for k in range(self.model.dimension)])
        powers = [
            (lambda _, exponent: exponent == 2, lambda base, _: f"{base} * {base}"),
            (lambda _, exponent: exponent == Rational(1, 2), lambda base, _: f"sqrt({base})"),
        ]

        def printed(part: Expr) -> str:
            return cxxcode(part, user_functions={"Pow": powers}).replace("std::", "")

        return [(printed(y), printed(x)) for y, x in (a.args for a in self.model.angles(u))]

    def trig_names(self) -> list[str]:
        return [f"{f.__name__}_{q}" for q in self.model.coordinates for f in (sin, cos)]

    def render(self) -> list[RenderedLinkFunction]:
        return [self._render(function) for function in self.functions()]

    def program(self, function: LinkFunction) -> Program:
        return shortest_program([function.assignments], [self._vocabulary(function)])

    def _render(self, function: LinkFunction) -> RenderedLinkFunction:
        body = print_body(self.program(function), entry=array_entry)
        read = [
            f"const {kind}& {name if name in body.sources else f'/*{name}*/'}"
            for kind, name in function.inputs
        ]
        return RenderedLinkFunction(
            function.name,
            [function.title, f"{body.counts.arithmetic.capitalize()}."],
            [*read, *(f"{kind}& {name}" for kind, name in function.outputs)],
            body,
        )

    def _vocabulary(self, function: LinkFunction) -> Vocabulary:
        angles = [
            Angle(q, given=(Place("trig", f"sin_{q}"), Place("trig", f"cos_{q}")))
            for q in self.model.coordinates
        ]
        return Vocabulary(function.leaves, angles, {}, Form(pair_angles=False, expanded=frozenset()))


def _dot(vector: Matrix, leaves: Sequence[Leaf]) -> Expr:
    return sum((component * leaf.symbol for component, leaf in zip(vector, leaves, strict=True)), Integer(0))


def _entries(name: str, before: tuple[int, ...], value: Matrix) -> list[Assignment]:
    """The components of a vector, or of the one that stands at `before` among several."""
    return [(Place(name, index=(*before, k)), value[k]) for k in range(value.rows)]
