"""The n-independent kernel of one link: û(q) and its derivatives, for solvers that walk along chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

from sympy import Expr, Matrix, cos, sin

from pendula_codegen.model import LinkModel
from pendula_codegen.printing import Body, print_body
from pendula_codegen.program import Assignment, Program, shortest_program
from pendula_codegen.vocabulary import Angle, Form, Leaf, Vocabulary

ORDER_NAMES = {1: "first", 2: "second", 3: "third"}


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
                tuple(_entries("u", self.model.direction)),
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
                    for entry in _entries(f"u_{'abc'[:order]}[{k}]", self.derivative(index))
                ),
            )
            for order, name in ORDER_NAMES.items()
        ]
        return [*first, *others]

    def trig_names(self) -> list[str]:
        return [f"{f.__name__}_{q}" for q in self.model.coordinates for f in (sin, cos)]

    def render(self) -> list[RenderedLinkFunction]:
        return [self._render(function) for function in self.functions()]

    def program(self, function: LinkFunction) -> Program:
        return shortest_program([function.assignments], [lambda: self._vocabulary(function)])

    def _render(self, function: LinkFunction) -> RenderedLinkFunction:
        body = print_body(self.program(function))
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
        angles = [Angle(q, f"trig.sin_{q}", f"trig.cos_{q}", "trig") for q in self.model.coordinates]
        return Vocabulary(function.leaves, angles, {}, Form(pair_angles=False, expanded=frozenset()))


def _entries(name: str, value: Matrix) -> list[tuple[str, Expr]]:
    return [(f"{name}[{k}]", value[k]) for k in range(value.rows)]
