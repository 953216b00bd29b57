"""Taylor series of motions: without a rounding, the tapes that kernels are made of give what SymPy says."""

from fractions import Fraction
from math import factorial

import mpmath
import pytest
from sympy import Rational, Symbol, cos, diff, expand, sin, symbols

from chains import chain, in_masses
from pendula_codegen.chain_kernel import ChainKernel
from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import find_model, model_names
from pendula_codegen.series import series_in
from pendula_codegen.series_tape import SeriesTapes, series_tapes
from series_truth import Decimals, Equations, Numbers, Rationals, by_tapes, equations, motion
from test_c_kernels import EVERYTHING, MANY
from test_model_kernels import LINKED, read

ORDER = 12
FORMS = [True, False]
# Angles of which no whole combination is another one: that would be a relation between their sines.
ANGLES = [
    Fraction(k, prime)
    for k, prime in zip(
        (5, 11, 17, 3, -4, 6, -8, 2, 9, -5, 13, 1), (7, 13, 19, 23, 29, 5, 11, 3, 17, 31, 37, 41), strict=True
    )
]
# The squares of the distances make one, so that their root is a fraction.
DISTANCES = [Fraction(k, 2) for k in (1, 2, 2)]
RATES = [Fraction(k, 3) for k in (1, -2, 4, -1, 3, 2, -3, 1, 2, -1, 5, 1)]
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
        self.given_inputs = INPUTS[: len(self.inputs)]
        self.numbers = [Fraction(k % 5 + 2, k % 3 + 2) for k in range(len(self.parameters))]

    def tapes(self, has_momenta: bool) -> SeriesTapes:
        places = [leaf.place for leaf in self.parameters]
        series = series_in(self.kernel, has_momenta)
        return series_tapes(self.kernel, lambda place: ("parameters", places.index(place)), series)

    def truths(self, numbers: Numbers, order: int) -> tuple[list, list]:
        of = numbers.of
        given = {leaf.symbol: [of(x)] for leaf, x in zip(self.parameters, self.numbers, strict=True)}
        given |= {
            u: [of(c) for c in series] for u, series in zip(self.inputs, self.given_inputs, strict=True)
        }
        given[self.time] = [of(TIME), of(1)]
        return motion(self.truth, numbers, given, [of(x) for x in (*self.q, *self.v)], order)

    def found(self, tapes: SeriesTapes, numbers: Numbers, momenta: list, order: int) -> list[list]:
        """The coefficients of the state, order by order, as the tapes give them, and back from UNIT to seconds."""
        of, unit = numbers.of, numbers.of(UNIT)
        inputs = [
            [of(series[k]) * unit**k if k < 3 else of(0) for series in self.given_inputs]
            for k in range(order + 1)
        ]
        given = {
            "parameters": [*map(of, self.numbers)],
            "times": [of(TIME)],
            "state": [*map(of, self.q), *(momenta if tapes.series.has_momenta else map(of, self.v))],
            "unit": [unit],
        }
        rows = by_tapes(tapes, numbers, given, inputs, order)
        return [[value / unit**k for value in row] for k, row in enumerate(rows)]

    def differences(self, numbers: Numbers, order: int = ORDER) -> list:
        """Of each form the largest one of all coefficients up to an order, relative to the largest of that order."""
        q, p = self.truths(numbers, order)
        return [self._difference(form, numbers, order, q, p) for form in FORMS]

    def _difference(self, has_momenta: bool, numbers: Numbers, order: int, q: list, p: list) -> object:
        found = self.found(self.tapes(has_momenta), numbers, [series[0] for series in p], order)
        assert len(found) == order + 1
        worst = numbers.of(0)
        for k, row in enumerate(found):
            true = [series[k] for series in q]
            if k < order:
                true += [series[k] for series in p] if has_momenta else [(k + 1) * x[k + 1] for x in q]
            size = max(abs(value) for value in true) or numbers.of(1)
            worst = max(worst, *(abs(x - y) / size for x, y in zip(row, true, strict=False)))
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


# Series do not move linkages.
FREE = [name for name in model_names() if "model.constraint(" not in find_model(name).read_text()]
MODELS = [(name, links) for name in FREE for links in ((1, 2) if name in LINKED else (None,))]


@pytest.mark.parametrize(("name", "links"), MODELS)
def test_coefficients_of_models(name, links):
    assert of_model(name, links).differences(Rationals()) == [0, 0]


@pytest.mark.parametrize(
    ("space", "links"), [("planar", 1), ("planar", 2), ("planar", 4), ("spatial", 1), ("spatial", 2)]
)
def test_coefficients_of_chains(space, links):
    assert of_chain(space, links).differences(Rationals()) == [0, 0]


def test_every_function_of_models(own):
    with mpmath.workdps(50):
        differences = case_of(own(EVERYTHING, "everything")).differences(Decimals())
        assert max(differences) < 1e-48  # measured 2.9e-50


def test_large_linear_systems(own):
    """Whose factors are kept, and not written out at order 0."""
    with mpmath.workdps(50):
        case = case_of(own(MANY, "many", 12))
        assert max(case.differences(Decimals(), 5)) < 1e-46


# What built-in models do not have, by the body of their file.
OTHERS = {
    "nothing acts": "model.lagrangian = v**2 / 2 + w**2",
    "linear": "model.lagrangian = (v**2 + w**2) / 2 + v * w / 3 - x**2 + x * y - 3 * y",
    "quotients": """
    model.lagrangian = (v**2 / (1 + y**2) + w**2 * (2 + x / (3 + y**2))) / 2 + v * w / (5 + x**2)
    model.lagrangian -= x * y / (x**2 + y**2 + 1) ** 2""",
    "powers": "model.lagrangian = v**2 * x**4 / 3 + w**2 - 1 / x**6 + x**5 * y",
    "time": "model.lagrangian = (v**2 + w**2) * (2 + t**2) / 2 + v * x * t**3 - x**3 / (1 + t**2)",
    "rates in the Lagrangian": "model.lagrangian = (v**2 + w**2) / 2 + (x * w - y * v) * (x**2 + y**2)",
    "drag": """
    model.lagrangian = (v**2 + w**2) / 2 - y
    model.force(x, -v * (2 + v**2 + w**2) ** 3)
    model.force(y, -w * v / (1 + w**2))""",
}


@pytest.mark.parametrize("what", OTHERS)
def test_coefficients_of_other_models(what, own):
    head = """
def define(model, links):
    x, y, t = model.coordinate("x", "m"), model.coordinate("y", "m"), model.time
    v, w = model.rate(x), model.rate(y)
    """
    assert case_of(own(head + OTHERS[what] + "\n", "other")).differences(Rationals()) == [0, 0]


# The momentum is 3 (x_dot + x)² − 3 x_dot²: linear once multiplied out, which keeps fewer digits.
CANCELLING = """
def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    v, w = model.rate(x), model.rate(y)
    model.lagrangian = (v + x + 1) ** 3 - v**3 + w**2 / (2 + y**2) - x**2 * y
    model.force(y, -w * v / 2)
"""


def test_momenta_in_which_terms_cancel(own):
    assert case_of(own(CANCELLING, "cancelling")).differences(Rationals()) == [0, 0]


def test_a_pendulum_by_repeated_differentiation():
    """SymPy differentiates the equation of motion; nothing of the other tests stands in this one."""
    q, v, g, length, m, damping = symbols("theta_1 theta_dot_1 g l_1 m_1 lambda_1")
    change = -g / length * sin(q) - damping * v / (m * length**2)
    slopes = [q, v, change]
    while len(slopes) <= ORDER:
        slopes.append(expand(diff(slopes[-1], q) * v + diff(slopes[-1], v) * change))
    case, numbers = of_chain("planar", 1), Rationals()
    case.given_inputs = [[Fraction(0)] * 3]
    s, c = numbers.sine_and_cosine(case.q[0])
    at = {leaf.symbol.name: x for leaf, x in zip(case.parameters, case.numbers, strict=True)}
    at |= {"theta_1": case.q[0], "theta_dot_1": case.v[0]}
    values = [(sin(q), Rational(s)), (cos(q), Rational(c))]
    values += [(symbol, Rational(at[symbol.name])) for symbol in (q, v, g, length, m, damping)]
    true = [Fraction(str(slope.subs(values))) / factorial(k) for k, slope in enumerate(slopes)]
    found = case.found(case.tapes(False), numbers, [], ORDER)
    assert [row[0] for row in found] == true


def test_sums_are_few():
    """How many a form takes, momentum and second order: a sum more is a tenth of a double pendulum's step."""
    counts = {
        "planar": [
            [len(series_in(of_chain("planar", n).kernel, form).sums) for form in FORMS] for n in (2, 4)
        ],
        **{
            name: [len(series_in(of_model(name, None).kernel, form).sums) for form in FORMS]
            for name in ("swinging_atwood", "furuta", "spring_pendulum")
        },
    }
    assert counts == {
        "planar": [[10, 12], [36, 36]],
        "swinging_atwood": [6, 7],
        "furuta": [8, 11],
        "spring_pendulum": [7, 7],
    }
