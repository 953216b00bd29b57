"""A function body: expressions in, the shortest straight-line program of several candidates out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sympy import Expr

from pendula_codegen.places import Place
from pendula_codegen.polynomial import Polynomial, ordered
from pendula_codegen.straight_line import Graph, Term, factor, share
from pendula_codegen.vocabulary import ORDERS, Atom, Order, Vocabulary

SIN_COS = 10  # operations that one sine or cosine counts for in a comparison of candidates

Assignment = tuple[Place, Expr]  # where the value goes


@dataclass(frozen=True)
class Program:
    """Straight-line code for `targets`; node k < len(atoms) of the graph is atoms[k]."""

    targets: tuple[Place, ...]
    atoms: tuple[Atom, ...]
    graph: Graph
    outputs: tuple[Term, ...]
    order: tuple[int, ...]
    operations: int

    @property
    def trig(self) -> int:
        """How many sines, cosines, roots and the like are read."""
        return sum(1 for node in self.order if node < len(self.atoms) and self.atoms[node].is_call)

    @property
    def cost(self) -> int:
        return self.operations + SIN_COS * self.trig

    def needed_by(self, count: int) -> int:
        """How many nodes, of the order, the first `count` outputs need: they come first in it."""
        return len(self.graph.order(node for _, node in self.outputs[:count]))


@dataclass(frozen=True)
class Problem:
    """Assignments as polynomials in the atoms of one vocabulary: all that a program needs but an order."""

    targets: tuple[Place, ...]
    vocabulary: Vocabulary
    values: tuple[Polynomial, ...]
    definitions: dict[int, Polynomial]

    def solve(self, order: Order) -> Program:
        ranking = self.vocabulary.ranking(order)
        rank = {atom: k for k, atom in enumerate(ranking)}

        def ranked(polynomial: Polynomial) -> Polynomial:
            return ordered(
                {tuple(sorted(rank[a] for a in monomial)): c for monomial, c in polynomial.items()}
            )

        graph = Graph(atoms=len(ranking))
        for atom, definition in self.definitions.items():
            graph.definitions[rank[atom]] = factor(graph, ranked(definition))
        outputs = tuple(factor(graph, ranked(value)) for value in self.values)
        share(graph, outputs)
        needed = graph.order(node for _, node in outputs)
        atoms = tuple(self.vocabulary.atoms[atom] for atom in ranking)
        return Program(self.targets, atoms, graph, outputs, tuple(needed), graph.operations(outputs, needed))


def shortest_program(
    alternatives: Sequence[Sequence[Assignment]], vocabularies: Sequence[Vocabulary]
) -> Program:
    """The candidate that costs least, the first of several equals.

    Every alternative in every vocabulary competes in the first order; the winner is then tried in the others.
    """
    problems = [pose(assignments, atoms) for assignments in alternatives for atoms in vocabularies]
    programs = [problem.solve(ORDERS[0]) for problem in problems]
    winner = min(range(len(problems)), key=lambda k: programs[k].cost)
    finalists = [programs[winner], *(problems[winner].solve(order) for order in ORDERS[1:])]
    return min(finalists, key=lambda program: program.cost)


def pose(assignments: Sequence[Assignment], vocabulary: Vocabulary) -> Problem:
    values = tuple(vocabulary.polynomial(value) for _, value in assignments)
    targets = tuple(target for target, _ in assignments)
    return Problem(targets, vocabulary, values, vocabulary.definitions(values))
