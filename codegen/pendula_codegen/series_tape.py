"""Series as two tapes: what a step begins with, and what each order takes.

Arrays that they read and give, by row:

    state      coefficients of one order: of q, then of p, or of v in the form of second order
    next       those of the following order
    unit       the unit of time, s, in powers of which the series is
    kept       what the first tape hands to the second one: constants, factors of the mass matrix, values at order 0
    order      k, 1/k, unit/(k + 1), and the coefficient of time: unit for k = 1, then 0
    sums       Σ A_j B_(k−j), 0 < j < k, of all pairs of operands
    operands   their coefficients of order k, by which later sums are made
    inputs     coefficients of the inputs: of order 0, or k
    times      t at order 0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.places import Place
from pendula_codegen.program import shortest_program
from pendula_codegen.series import Series, series_of
from pendula_codegen.series_next import Next
from pendula_codegen.series_start import Constants, Start, sign_and_size
from pendula_codegen.tape import Row, Tape


@dataclass(frozen=True)
class SeriesTapes:
    """start: order 0; next: order k from 1 on; kept: how many numbers go from the first to the second."""

    series: Series
    start: Tape
    next: Tape
    kept: int

    @property
    def operations(self) -> int:
        """Of an order, beside its sums."""
        return sum(1 for step in self.next.steps if step.operation not in ("read", "number"))


def series_tapes(
    kernel: SystemKernel, row: Callable[[Place], Row], series: Series | None = None
) -> SeriesTapes:
    """The series of a kernel, in its best form if none is given; `row`: where parameters stand."""
    series = series or series_of(kernel)
    start = Start(series, _constants_of(kernel, series, row))
    following = Next(series, start).give()  # which says what is kept
    return SeriesTapes(series, start.give(), following, len(start.kept))


def _constants_of(kernel: SystemKernel, series: Series, row: Callable[[Place], Row]) -> Constants:
    nodes = [series.graph.nodes[place] for place in series.order]
    held = [c for node in nodes for c in (*node.coefficients, node.offset)]
    held += [c for c, _ in (*series.solved, *series.forces)]
    sizes = dict.fromkeys(sign_and_size(c)[1] for c in held)
    wanted = [size for size in sizes if not size.is_Rational]
    tape = Tape()
    if not wanted:
        return Constants(tape, {})
    assignments = [(Place("constants", index=(k,)), constant) for k, constant in enumerate(wanted)]
    program = shortest_program([assignments], kernel.shared_vocabularies)

    def row_of(place: Place) -> Row:
        return ("constants", place.index[0]) if place.argument == "constants" else row(place)

    found = tape.record(program, row_of)
    return Constants(tape, {c: found["constants", k] for k, c in enumerate(wanted)})
