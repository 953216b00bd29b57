"""Taylor series of motions: without a rounding, the tapes that kernels are made of give what SymPy says."""

from fractions import Fraction

import mpmath
import pytest
from sympy import Rational, Symbol, diff, sin, symbols

from chains import chain, in_masses
from pendula_codegen.chain_kernel import ChainKernel
from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import model_names
from pendula_codegen.series import series_in, series_of
from pendula_codegen.series_tape import SeriesTapes, series_tapes
from series_truth import Decimals, Equations, Numbers, Rationals, carry_out, equations, motion
from test_c_kernels import EVERYTHING, MANY, own
from test_model_kernels import LINKED, read

ORDER = 12
FORMS = [True, False]
# Angles, distances, rates: the squares of the first three distances make one, so that their root is a fraction.
ANGLES = [Fraction(k, 7) for k in (5, 11, 17)]
DISTANCES = [Fraction(k, 2) for k in (1, 2, 2)]
RATES = [Fraction(k, 3) for k in (1, -2, 4, -1, 3, 2)]
INPUTS = [[Fraction(k + 1, 2), Fraction(-1, 3), Fraction(1, 5)] for k in range(9)]
TIME, UNIT = Fraction(3, 11), Fraction(1, 2)


class Case:
    """A system, its equations as SymPy derives them, and a start."""

    def __init__(self, kernel: SystemKernel, truth: Equations, is_angle: list[bool]):
        self.kernel, self.truth = kernel, truth
        leaves = kernel.leaves()
        self.parameters = [leaf for leaf in leaves if leaf.kind == "parameter" and leaf.place.field != "time"]
        self.inputs = [leaf.symbol for leaf in leaves if leaf.kind == "input"]
        self.time = Symbol("t", real=True)
        angles, distances = iter(ANGLES), iter(DISTANCES)
        self.q = [next(angles) if turns else next(distances) for turns in is_angle]
        self.v = RATES[: len(self.q)]
        self.numbers = [Fraction(k % 5 + 2, k % 3 + 2) for k in range(len(self.parameters))]

    def tapes(self, has_momenta: bool) -> SeriesTapes:
        places = [leaf.place for leaf in self.parameters]
        series = series_in(self.kernel, has_momenta)
        return series_tapes(self.kernel, lambda place: ("parameters", places.index(place)), series)

    def truths(self, numbers: Numbers, order: int) -> tuple[list, list]:
        of = numbers.of
        given = {leaf.symbol: [of(x)] for leaf, x in zip(self.parameters, self.numbers, strict=True)}
        given |= {u: [of(c) for c in series] for u, series in zip(self.inputs, INPUTS, strict=False)}
        given[self.time] = [of(TIME), of(1)]
        return motion(self.truth, numbers, given, [of(x) for x in (*self.q, *self.v)], order)

    def found(self, tapes: SeriesTapes, numbers: Numbers, momenta: list, order: int) -> list[list]:
        """The coefficients of the state, order by order, as the tapes give them, and back from UNIT to seconds."""
        of, n, unit = numbers.of, len(self.q), numbers.of(UNIT)
        inputs = [
            [of(series[k]) * unit**k if k < 3 else of(0) for series in INPUTS[: len(self.inputs)]]
            for k in range(order + 1)
        ]
        start = [*map(of, self.q), *(momenta if tapes.series.has_momenta else map(of, self.v))]
        given = {
            "parameters": [*map(of, self.numbers)],
            "times": [of(TIME)],
            "inputs": inputs[0],
            "state": start,
            "unit": [unit],
        }
        begun = carry_out(tapes.start, given, numbers)
        kept = [begun["kept"][k] for k in range(tapes.kept)] if tapes.kept else []
        rows, operands = [start, [begun["next"][k] for k in range(2 * n)]], [[]]
        for k in range(1, order):
            sums = [
                sum((operands[j][a] * operands[k - j][b] for j in range(1, k)), of(0))
                for a, b in tapes.series.places
            ]
            here = {
                "state": rows[k],
                "inputs": inputs[k],
                "kept": kept,
                "sums": sums,
                "order": [of(k), of(1) / k, unit / (k + 1), unit if k == 1 else of(0)],
            }
            made = carry_out(tapes.next, here, numbers)
            rows.append([made["next"][j] for j in range(2 * n)])
            operands.append([made.get("operands", {}).get(j) for j in range(len(tapes.series.operands))])
        return [[value / unit**k for value in row] for k, row in enumerate(rows)]

    def difference(self, has_momenta: bool, numbers: Numbers, order: int = ORDER) -> object:
        """The largest of all coefficients up to that order, relative to the largest there is of each."""
        q, p = self.truths(numbers, order)
        tapes = self.tapes(has_momenta)
        assert len(tapes.series.solved) == len(self.q)
        found = self.found(tapes, numbers, [series[0] for series in p], order)
        n, worst = len(self.q), numbers.of(0)
        for k, row in enumerate(found):
            true = [series[k] for series in q]
            if tapes.series.has_momenta and k < order:
                true += [series[k] for series in p]
            elif not tapes.series.has_momenta and k + 1 < len(q[0]):
                true += [(k + 1) * series[k + 1] for series in q]
            size = max(abs(value) for value in true)
            worst = max(worst, *(abs(x - y) / size for x, y in zip(row, true, strict=False)))
        assert len(found) == order + 1 and n > 0
        return worst


def of_model(name: str, links: int | None) -> Case:
    return case_of(read(name, links))


def case_of(model) -> Case:
    system = model.system
    forces = [model.force_along(x) for x in system.coordinates]
    truth = equations(system.coordinates, system.velocities, model.time, model.lagrangian, forces)
    return Case(ModelKernel(model), truth, [c.is_angle for c in model.coordinates])


def of_chain(space: str, links: int) -> Case:
    known = chain(space, links)
    lagrangian = in_masses(known, known.kinetic_energy - known.potential_energy)
    truth = equations(known.coordinates, known.velocities, None, lagrangian, known.forces)
    return Case(ChainKernel(known), truth, [True] * len(known.coordinates))


MODELS = [(name, links) for name in model_names() for links in ((1, 2) if name in LINKED else (None,))]


@pytest.mark.parametrize("has_momenta", FORMS, ids=["momentum", "second"])
@pytest.mark.parametrize(("name", "links"), MODELS)
def test_coefficients_of_models(name, links, has_momenta):
    assert of_model(name, links).difference(has_momenta, Rationals()) == 0


@pytest.mark.parametrize("has_momenta", FORMS, ids=["momentum", "second"])
@pytest.mark.parametrize(("space", "links"), [("planar", 1), ("planar", 2), ("planar", 3), ("spatial", 1)])
def test_coefficients_of_chains(space, links, has_momenta):
    assert of_chain(space, links).difference(has_momenta, Rationals()) == 0


@pytest.mark.parametrize("has_momenta", FORMS, ids=["momentum", "second"])
def test_every_function_of_models(tmp_path, has_momenta):
    with mpmath.workdps(50):
        case = case_of(own(EVERYTHING, "everything", tmp_path))
        assert case.difference(has_momenta, Decimals()) < 1e-40
