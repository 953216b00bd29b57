"""Taylor series of a system's motion: which sums they take, in the form that takes fewest.

The motion about a time t is Σ c_k τ^k, where t + unit·τ is the time in question. In the momentum form

    dq/dt = v,  ∂L/∂v (q, v, t) = p,  dp/dt = f(q, v, t, u)

the coefficients v_k are solved for at every order; in the form of second order, with residual E = M(q) a + …,

    dq/dt = v,  dv/dt = a,  E(q, v, a, t, u) = 0

it is a_k. Both systems are linear with the matrix M at order 0, so that it is factored once a step, and no series of
its elimination is needed: what stands on the left is evaluated without the unknown coefficients, and what is missing on
the right is M₀ times them.

Inputs u are given with their coefficients: sines, polynomials and tables are the affair of who moves the system. Time
is the series (t, unit, 0, …).

What kernels have of this
-------------------------

Two functions of W motions, W = 1, 2, 4, 8, beside those of SystemFunctions (pendula/system/system_table.hpp), made by
series_tape.py, series_start.py and series_next.py:

    series_start(at, rows)               order 0: reads row 0 of the state, gives row 1 and `kept`
    series_next(at, rows, first, last)   orders first … last, first ≥ 1: give rows first + 1 … last + 1 of the state

    at     Conditions: parameters, times t at order 0; inputs, (last + 1, inputs, W), are coefficients of τ^k, order by
           order, so that row 0 is what other functions take
    rows   SeriesRows: unit, (W), s; and memory of three kinds, all of it the caller's, aligned to 64 bytes:
           state     rows of coefficients, order + 1 of them: of q, then of p, or of v in the form of second order
           kept      (SeriesInfo.kept, W): series_start writes it, series_next reads it
           operands  a row for each order up to last, row 0 unused: series_next writes and reads it

series_next(1, order − 1) after series_start has rows 0 … order of the state; it may be asked in parts, each of which
needs what was before. How long rows are, src/pendula/system/series_info.hpp says. For many motions a row of the state
is 2n x W numbers, one of the operands has W of each. One motion is laid out for its sums, which have a lane each: a row
of operands has the first operands of all sums, padded to a multiple of 8, then the second ones; a row of the state is
padded to 4 or a multiple of 8 numbers, so that registers can sum many coordinates at once. What pads is never written.

Rates follow from q: v_k = (k + 1) q_(k+1) / unit. A coefficient that is not finite says that there is no series: a
mass matrix that is singular, or a function at a point where it has none. Coefficients grow as unit^k: who sees them
overflow takes a smaller unit. Where nothing moves, all coefficients but those of order 0 are zero.

Two more give one order and how it changes along a direction, in dual numbers (pendula_codegen/table.py):
series_start_along, and series_next_along, which is told the sums of its order. The runtime makes of them the derivative
of a step (src/pendula/taylor/series_tangent.hpp).

SeriesInfo tells the form and how many sums, operands and kept numbers there are. Kernels in C++ of more than ten
coordinates, and of chains in space, have no series: their functions are null there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sympy import Add, Integer, Symbol, expand

from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.places import Place
from pendula_codegen.polynomial import Number
from pendula_codegen.program import Assignment, Problem, Program, pose
from pendula_codegen.series_graph import ONE, Operand, SeriesGraph, Value, rational
from pendula_codegen.straight_line import UNIT, Term
from pendula_codegen.vocabulary import ORDERS, Order

# Sums of squares have half as many products; what is computed beside sums counts little.
SQUARE, OTHER = 0.6, 0.02


@dataclass(frozen=True)
class Series:
    """The series of a system in one form.

    has_momenta   whether the state is q, p; else q, v
    size          coordinates
    solved        values that are p, or E: linear in the unknown v or a, on which each of them depends
    forces        values that are f; none in the form of second order
    order         the nodes that are needed, each after its parts
    sums          of products of coefficients, by their operands
    operands      all that stand in sums
    """

    graph: SeriesGraph
    has_momenta: bool
    size: int
    solved: tuple[Value, ...]
    forces: tuple[Value, ...]
    order: tuple[int, ...]
    sums: tuple[tuple[Operand, Operand], ...]
    operands: tuple[Operand, ...]

    @property
    def form(self) -> str:
        return "momentum" if self.has_momenta else "second order"

    @property
    def cost(self) -> float:
        return sum(SQUARE if a == b else 1.0 for a, b in self.sums) + OTHER * len(self.order)

    @property
    def places(self) -> list[tuple[int, int]]:
        """The sums by the places of their operands."""
        return [(self.operands.index(a), self.operands.index(b)) for a, b in self.sums]

    @property
    def is_linear(self) -> bool:
        """Whether what is solved for stands in linear terms alone."""
        return all(map(self.graph.is_linear, (node for _, node in self.solved)))

    def sums_of(self, node: int) -> list[int]:
        """Which sums a node needs."""
        return [self.sums.index(pair) for pair in self.graph.sums_of(node)]


def series_of(kernel: SystemKernel) -> Series:
    """The series with the fewest sums, of those the one with the fewest operands; of equals the second order."""
    forms = (series_in(kernel, momenta) for momenta in (False, True))
    return min(forms, key=lambda series: (len(series.sums), len(series.operands)))


def series_in(kernel: SystemKernel, has_momenta: bool) -> Series:
    """The cheapest series in one form."""
    found = _cheapest(kernel, _assignments(kernel, has_momenta), has_momenta)
    return found or _cheapest(kernel, _linear_assignments(kernel, has_momenta), has_momenta)


def _cheapest(kernel: SystemKernel, assignments: Sequence[Assignment], has_momenta: bool) -> Series | None:
    """As with other functions, all vocabularies are tried in the first order, and the best one in the others.

    None where the unknowns stand in terms that are not linear and cancel.
    """
    problems = [pose(assignments, vocabulary) for vocabulary in kernel.shared_vocabularies]
    best: tuple[float, Series, Problem] | None = None

    def take(problem: Problem, order: Order) -> None:
        nonlocal best
        program = problem.solve(order)
        for unknown_first in (False, True):
            series = _Reader(kernel, program, has_momenta, unknown_first).series()
            if series.is_linear and (best is None or series.cost < best[0]):
                best = series.cost, series, problem

    for problem in problems:
        take(problem, ORDERS[0])
    if best is None:
        return None
    if len(kernel.system.coordinates) <= UNROLLED:  # of more, each try takes seconds
        chosen = best[2]
        for order in ORDERS[1:]:
            take(chosen, order)
    return best[1]


def _assignments(kernel: SystemKernel, has_momenta: bool) -> list[Assignment]:
    if not has_momenta:
        return [(Place("E", index=(k,)), value) for k, value in enumerate(kernel.residual)]
    return [(Place("p", index=(k,)), value) for k, value in enumerate(kernel.L_v)] + _forces(kernel)


def _linear_assignments(kernel: SystemKernel, has_momenta: bool) -> list[Assignment]:
    """The same with entries of the mass matrix multiplied out."""
    system = kernel.system
    unknowns = system.velocities if has_momenta else kernel.accelerations
    still = {unknown: Integer(0) for unknown in unknowns}
    solved = [
        Add(
            value.xreplace(still),
            *(expand(entry) * unknown for entry, unknown in zip(kernel.mass.row(k), unknowns, strict=True)),
        )
        for k, value in enumerate(kernel.L_v if has_momenta else kernel.residual)
    ]
    found = [(Place("p", index=(k,)), value) for k, value in enumerate(solved)]
    return found + _forces(kernel) if has_momenta else found


def _forces(kernel: SystemKernel) -> list[Assignment]:
    forces = [slope + force for slope, force in zip(kernel.L_q, kernel.system.forces, strict=True)]
    return [(Place("f", index=(k,)), value) for k, value in enumerate(forces)]


class _Reader:
    """Reads a program as series."""

    def __init__(self, kernel: SystemKernel, program: Program, has_momenta: bool, unknown_first: bool):
        self._program = program
        self._has_momenta = has_momenta
        self._size = len(kernel.system.coordinates)
        self._graph = SeriesGraph(unknown_first)
        self._values: dict[int, Value] = {}
        leaves = kernel.leaves()
        self._symbols = {leaf.place: leaf.symbol for leaf in leaves}
        self._inputs = [leaf.place for leaf in leaves if leaf.kind == "input"]
        self._places = {angle.symbol: angle.place for angle in kernel.angles()}

    def series(self) -> Series:
        program, graph = self._program, self._graph
        for node in program.order:
            self._values[node] = self._made(node)
        outputs = [graph.multiplied_out(self._term(term)) for term in program.outputs]
        roots = [node for _, node in outputs if node is not None]
        graph.fuse(roots)
        order = graph.order(roots)
        sums = dict.fromkeys(pair for node in order for pair in graph.sums_of(node))
        operands = dict.fromkeys(operand for pair in sums for operand in pair)
        n = self._size
        return Series(
            graph,
            self._has_momenta,
            n,
            (*outputs[:n],),
            (*outputs[n:],),
            (*order,),
            (*sums,),
            (*operands,),
        )

    def _term(self, term: Term) -> Value:
        coefficient, node = term
        if not coefficient or node == UNIT:
            return rational(coefficient), None
        return self._scaled(coefficient, node)

    def _scaled(self, coefficient: Number, node: int) -> Value:
        constant, place = self._values[node]
        return rational(coefficient) * constant, place

    def _made(self, node: int) -> Value:
        program = self._program.graph
        if node in program.products:
            return self._graph.product([self._values[factor] for factor in program.products[node]])
        if node in program.sums:
            return self._graph.sum([self._term(term) for term in program.sums[node]])
        atom = self._program.atoms[node]
        if atom.difference is not None:
            return self._of_difference(*atom.difference)
        if node in program.definitions:
            return self._graph.call(atom.function, self._term(program.definitions[node]))
        return self._graph.call(atom.function, self._leaf(atom.place))

    def _of_difference(self, function: str, first: Symbol, second: Symbol) -> Value:
        x, y = (self._leaf(self._places[angle]) for angle in (first, second))
        return self._graph.call(function, self._graph.sum([x, (-y[0], y[1])]))

    def _leaf(self, place: Place) -> Value:
        graph = self._graph
        if place.argument == "q":
            return ONE, graph.node("q", index=place.index[0])
        if place.argument in ("v", "a"):
            is_unknown = (place.argument == "v") == self._has_momenta
            return ONE, graph.node("unknown" if is_unknown else "rate", index=place.index[0])
        if place.field == "time":
            return ONE, graph.node("time")
        if place in self._inputs:
            return ONE, graph.node("input", index=self._inputs.index(place))
        return self._symbols[place], None
