"""Kernels in C and as LLVM's text: no warnings, equal to what models say, for any number of states."""

import math
import random
import re
from functools import cache

import mpmath
import pytest
from mpmath import mp, mpf
from sympy import Symbol, lambdify

from conftest import REPOSITORY
from loaded import COMPILERS, FEATURES, WIDTHS, LoadedKernel, table_of
from pendula_codegen.backends.c import INTERFACE, quoted
from pendula_codegen.model import Model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import model_names
from pendula_codegen.table import OF_MANY, PLAIN
from pendula_codegen.written import DIGITS, written
from series_error import series_error
from series_truth import Decimals, carry_out
from test_model_kernels import LINKED, read

CASES = [(name, 2 if name in LINKED else None) for name in model_names()]
# Registers of two, of four, and the widest that this processor has.
INSTRUCTIONS = ["x86-64"] * bool(FEATURES) + ["haswell"] * (" avx2 " in FEATURES) + ["native"]
# Every function that a model may have, time, and velocities in forces.
EVERYTHING = """
from sympy import *


def define(model, links):
    x = model.coordinate("x", "m")
    y = model.coordinate("y", "m")
    theta = model.coordinate("theta", "rad")
    a = model.parameter("a", "1", default=1.3, positive=True)
    b = model.parameter("b", "", default=0.7, positive=True)
    u, w = model.input("u", "N"), model.input("w", "what? \\u03bc")
    t = model.time
    x_dot, y_dot, theta_dot = map(model.rate, (x, y, theta))
    kinetic = a * (x_dot**2 + y_dot**2) / 2 + (2 + cos(theta)) * theta_dot**2 / 2
    kinetic += b * x_dot * theta_dot * cos(theta) / 4 + (1 + tanh(y) ** 2) * y_dot**2 / 2
    potential = exp(-b * x) + log(3 + x**2) + tan(x / 5) + asin(y / 7) + acos(x / 9) + atan(x * y)
    potential += sinh(x / 3) + cosh(y / 3) + tanh(x - y) + sqrt(2 + y**2) + cbrt(4 + x**2)
    potential += (5 + x**2) ** Rational(7, 5) + (2 + cos(theta)) ** 1.37 + 1 / (1 + exp(x))
    potential += sin(3 * x + t) * cos(t * b)
    model.lagrangian = kinetic - potential + x_dot * y * sin(t)
    model.dissipation = b * theta_dot**2 / 2
    model.force(x, u * cos(theta) - x_dot * exp(-(y**2)))
    model.force(theta, w + u * y)
    model.point("p", (x, y))
    model.point("r", (x + sin(theta), y, cos(theta) * t))
    model.constraint("tied", x**2 + a * sqrt(2 + y**2) - sin(theta + t), "m^2")
    model.constraint("turned", theta * t - b * y, "rad")
    model.constraint("rolled", y * model.rate(x) - sin(a * x + t) * model.rate(theta) + b * x * cos(y), "m^2/s")
"""
# Functions of several pieces, one in another, and one whose pieces have no values elsewhere.
PIECES = """
from sympy import *


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    k = model.parameter("k", "N/m", default=3.0, positive=True)
    push = model.input("push", "N")
    v, w = model.rate(x), model.rate(y)
    spring = Piecewise((k * x**2 / 2, x < 0), (0, True)) + Max(0, Abs(y) - k) ** 2
    shell = Piecewise((y**2, y < 1), (1 + log(y + 2) - log(3), True))
    shell += Piecewise((-3 + x**2, x < 1), (-4 / sqrt(x + 3), True))
    model.lagrangian = (v**2 + (1 + Abs(x)) * w**2) / 2 - spring - shell
    model.force(x, Min(k, Max(-k, push)) - v * Abs(v))
    model.force(y, Piecewise((sign(w), (x > 0) & (y < 2) | (v >= 1)), (exp(-w), sin(model.time) > 0), (0, True)))
    model.point("p", (x, Abs(y)))
"""
# More coordinates than linear systems are written out for.
MANY = """
from sympy import cos


def define(model, links):
    q = [model.coordinate(f"q_{k + 1}", "rad") for k in range(links)]
    m = model.parameter("m", "kg m^2", default=1.0, positive=True)
    v = [model.rate(x) for x in q]
    model.lagrangian = m * sum(v) ** 2 / 2 + sum((2 + cos(x)) * w**2 for x, w in zip(q, v)) / 2
    model.lagrangian += sum(cos(x - y) for x, y in zip(q, q[1:]))
"""


# Names that the generator has for momenta and accelerations, too; and of C and its libraries.
NAMES = """
def define(model, links):
    x, y, t1 = (model.coordinate(name, "m") for name in ("x", "V", "t1"))
    m, k = (model.parameter(name, "1", default=1.0, positive=True) for name in ("p_x", "x_ddot"))
    c, d = (model.parameter(name, "1", default=1.0, positive=True) for name in ("READ", "restrict"))
    force = model.input("unix", "N")
    model.lagrangian = m * (model.rate(x) ** 2 + model.rate(y) ** 2 + model.rate(t1) ** 2) / 2
    model.lagrangian -= k * x * y**2 + c * d * t1
    model.force(x, force * model.rate(y))
"""


class Truth:
    """The functions of a table in 50 digits, by SymPy's derivation of what the file says."""

    def __init__(self, model: Model):
        self.model, self.size = model, len(model.coordinates)
        kernel = ModelKernel(model)
        system = model.system
        self.symbols = {
            "parameters": [symbol for p in model.ordered_parameters for symbol in p.symbols],
            "times": [model.time],
            "inputs": [*system.inputs],
            "q": [*system.coordinates],
            "v": [*system.velocities],
            "a": [*system.accelerations],
            "p": [Symbol(f"given_{k}") for k in range(self.size)],
        }
        self._written = written(model)
        self._tapes = table_of(model).series
        self._arguments = [value for value, _ in kernel.call_arguments]
        self._known: dict[str, object] = {}
        self._exact: dict[tuple, dict[str, list]] = {}

    def rows(self) -> dict[str, int]:
        """How many rows each array has that functions take."""
        sizes = {name: len(symbols) for name, symbols in self.symbols.items()}
        tapes = self._tapes
        sizes |= {"unit": 1, "order": 4, "state": 2 * self.size, "kept": tapes.kept}
        sizes["sums"] = len(tapes.series.sums)
        varied = {"dq": "q", "dv": "v"}
        varied |= {f"d_{name}": name for name in ("parameters", "inputs", "state", "kept", "sums")}
        return sizes | {name: sizes[of] for name, of in varied.items()}

    def _values(self, name: str, expressions: list, at: dict[str, list]) -> list:
        if name not in self._known:
            symbols = [symbol for of in self.symbols.values() for symbol in of]
            self._known[name] = lambdify(symbols, expressions, "mpmath", dummify=True)
        return self._known[name](*(number for array in self.symbols for number in at[array]))

    def _said(self, name: str, at: dict[str, list]) -> list:
        return self._values(name, getattr(self._written, name), at)

    def _solved(self, right: list, at: dict[str, list]) -> list:
        entries, n = self._said("mass", at), self.size
        matrix = mpmath.matrix([[entries[i * n + j] for j in range(n)] for i in range(n)])
        return [*mpmath.lu_solve(matrix, mpmath.matrix(right))]

    def exact(self, function: str, numbers: dict[str, list[float]]) -> dict[str, list]:
        """What a function gives of these doubles, array by array in 50 digits, which are found once."""
        key = (function, *(number for array in numbers.values() for number in array))
        if key not in self._exact:
            with mp.workdps(DIGITS):
                at = {array: [*map(mpf, values)] for array, values in numbers.items()}
                self._exact[key] = self.of(function, at)
        return self._exact[key]

    def of(self, function: str, at: dict[str, list]) -> dict[str, list]:
        """The same of numbers of any kind."""
        said = self._said
        match function:
            case "hamiltonian_form":
                v = self._velocity(at)
                return {"v": v, "f": said("forces", {**at, "v": v})}
            case "momentum_form":
                return {"p": said("momenta", at), "f": said("forces", at)}
            case "momentum_form_with_jacobians":
                slopes = {"p_D_q": "momenta_q", "p_D_v": "mass", "f_D_q": "forces_q", "f_D_v": "forces_v"}
                return self.of("momentum_form", at) | {
                    array: said(name, at) for array, name in slopes.items()
                }
            case "residual":
                return {"E": said("residual", at)}
            case "residual_with_jacobians":
                slopes = {"E_D_q": "residual_q", "E_D_v": "residual_v", "E_D_a": "mass"}
                return self.of("residual", at) | {array: said(name, at) for array, name in slopes.items()}
            case "momentum_from_velocity":
                return {"p": said("momenta", at)}
            case "velocity_from_momentum":
                return {"v": self._velocity(at)}
            case "acceleration":
                return {"a": self._solved([-value for value in said("residual_at_rest", at)], at)}
            case "mass_matrix":
                return {"M": said("mass", at)}
            case "energies":
                return {"kinetic": said("kinetic_energy", at), "total": said("energy", at)}
            case "power":
                return {"P": said("power", at)}
            case "acceleration_along":
                slope = self._slope("acceleration", at, {"q": "dq", "v": "dv"})
                return self.of("acceleration", at) | {"da": slope["a"]}
            case "momentum_form_along":
                slope = self._slope("momentum_form", at, {"parameters": "d_parameters", "inputs": "d_inputs"})
                return {"dp": slope["p"], "df": slope["f"]}
            case "series_start" | "series_next":
                found = carry_out(getattr(self._tapes, function.removeprefix("series_")), at, Decimals())
                gives = ("next", "kept") if function == "series_start" else ("next", "operands")
                return {array: [found[array][k] for k in range(len(found.get(array, ())))] for array in gives}
            case "series_start_along" | "series_next_along":
                base = function.removesuffix("_along")
                moved = ("parameters", "inputs", "state") if "start" in base else ("state", "kept", "sums")
                slope = self._slope(base, at, {array: f"d_{array}" for array in moved})
                return self.of(base, at) | {f"d_{array}": rows for array, rows in slope.items()}
            case "call_arguments":
                return {"found": self._values("arguments", self._arguments, at)}
            case "constraints":
                return {"g": said("constraints", at), "g_D_q": said("constraints_q", at)}
            case "constraint_rates":
                return {
                    "g_dot": said("constraint_rates", at),
                    "g_ddot": said("constraint_second_rates", at),
                }
            case "constraint_rate_slopes":
                return {"g_dot_D_q": said("constraint_rates_q", at)}
            case "constraints_along" | "constraint_rates_along":
                moved = {"parameters": "d_parameters"}
                if function == "constraint_rates_along":
                    moved |= {"q": "dq", "v": "dv"}
                slope = self._slope(function.removesuffix("_along"), at, moved)
                if function == "constraints_along":
                    return {"dg": slope["g"], "d_g_D_q": slope["g_D_q"]}
                return {"d_g_dot": slope["g_dot"], "d_g_ddot": slope["g_ddot"]}
            case "switches":
                return {"g": self._values("switches", [s.value for s in self.model.switches], at)}
            case "positions":
                return {"r": said("positions", at)}
            case "velocities":
                return {"r_dot": said("velocities", at)}
        raise AssertionError(function)

    def _velocity(self, at: dict[str, list]) -> list:
        rest = self._said("momenta_at_rest", at)
        return self._solved([p - b for p, b in zip(at["p"], rest, strict=True)], at)

    def _slope(self, function: str, at: dict[str, list], by: dict[str, str]) -> dict[str, list]:
        """A derivative along a direction, by a difference of which 50 digits leave 20."""
        step = mpf(10) ** -15

        def moved(sign: int) -> dict[str, list]:
            there = {
                a: [x + sign * step * d for x, d in zip(at[a], at[d_a], strict=True)] for a, d_a in by.items()
            }
            return self.of(function, at | there)

        up, down = moved(1), moved(-1)
        return {
            array: [(x - y) / (2 * step) for x, y in zip(up[array], down[array], strict=True)] for array in up
        }


truth_of = cache(Truth)


def drawn(truth: Truth, width: int, seed: int) -> dict[str, list[list[float]]]:
    draw = random.Random(seed)
    return {
        array: [
            [draw.uniform(0.5, 1.5) if array == "parameters" else draw.uniform(-1, 1) for _ in range(width)]
            for _ in range(rows)
        ]
        for array, rows in truth.rows().items()
    }


def error(loaded: LoadedKernel, truth: Truth, width: int, seed: int) -> float:
    """The largest of all functions, relative to the largest number that an array has, or 1."""
    given, worst = drawn(truth, width, seed), 0.0
    functions = [*zip(OF_MANY, loaded.table.of_many, strict=True)]
    functions += [*zip(PLAIN, loaded.table.plain, strict=True)] if width == 1 else []
    for name, function in functions:
        if function is None:
            continue
        found = loaded.call(name, width, given)
        for lane in range(width):
            true = truth.exact(name, {array: [row[lane] for row in rows] for array, rows in given.items()})
            assert {*true} == {*found}, name
            for array, rows in found.items():
                values = [row[lane] for row in rows]
                size = max([1.0, *(abs(float(value)) for value in true[array])])
                for value, expected in zip(values, true[array], strict=True):
                    worst = (
                        max(worst, abs(float(value - expected)) / size) if math.isfinite(value) else math.inf
                    )
    return worst


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(("name", "links"), CASES)
def test_kernels_compute_what_models_say(name, links, compiler, kernel_of):
    model = read(name, links)
    loaded, truth = kernel_of(model, compiler), truth_of(model)
    assert (
        max(error(loaded, truth, width, width) for width in WIDTHS) < 2e-14
    )  # measured 1e-14, of eight rods
    assert max(series_error(loaded, width, width) for width in WIDTHS) < 1e-12  # measured 1.9e-13


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("march", INSTRUCTIONS)
def test_every_function_of_models_with_any_instructions(compiler, march, own, kernel_of):
    model = own(EVERYTHING, "everything")
    loaded, truth = kernel_of(model, compiler, march), truth_of(model)
    assert max(error(loaded, truth, width, 10 + width) for width in WIDTHS) < 1e-14  # measured 1.3e-15
    assert max(series_error(loaded, width, width) for width in WIDTHS) < 1e-13  # measured 6.9e-16


@pytest.mark.parametrize("compiler", COMPILERS)
def test_functions_of_several_pieces(compiler, own, kernel_of):
    model = own(PIECES, "pieces")
    loaded, truth = kernel_of(model, compiler), truth_of(model)
    assert max(error(loaded, truth, width, 20 + width) for width in WIDTHS) < 1e-14  # measured 8.9e-16
    assert max(series_error(loaded, width, width) for width in WIDTHS) < 1e-13  # measured 4.9e-15


@pytest.mark.parametrize("compiler", COMPILERS)
def test_linear_systems_too_large_to_be_written_out(compiler, own, kernel_of):
    model = own(MANY, "many", 12)
    loaded, truth = kernel_of(model, compiler), truth_of(model)
    assert max(error(loaded, truth, width, width) for width in (1, 4)) < 1e-14  # measured 1.6e-15
    assert max(series_error(loaded, width, width) for width in (1, 4)) < 1e-13  # measured 4.8e-15


@pytest.mark.parametrize("compiler", COMPILERS)
def test_names_of_models_meet_no_others(compiler, own, kernel_of):
    model = own(NAMES, "double")
    loaded, truth = kernel_of(model, compiler), truth_of(model)
    assert error(loaded, truth, 2, 1) < 1e-14  # measured 1.4e-16


@pytest.fixture(
    scope="module",
    params=[(name, march) for name in COMPILERS for march in INSTRUCTIONS[-2:]],
    ids="-".join,
)
def everything(request, own, kernel_of) -> tuple[LoadedKernel, Truth]:
    model = own(EVERYTHING, "everything")
    return kernel_of(model, *request.param), truth_of(model)


@pytest.mark.parametrize("width", WIDTHS)
def test_an_iteration_on_stages(width, everything):
    """Against the same in 50 digits."""
    loaded, truth = everything
    draw, n = random.Random(width), 3
    given = drawn(truth, width, 3)
    stages = {
        "m": [draw.uniform(-0.3, 0.3) for _ in range(width * width)],
        "hb": [draw.uniform(0, 0.1) for _ in range(width)],
        "start": [x for _ in range(2 * n) for x in (draw.uniform(-0.5, 0.5), draw.uniform(-1e-17, 1e-17))],
        "weights": [draw.uniform(0.5, 2) for _ in range(2 * n)],
        "increments": [draw.uniform(-0.3, 0.3) for _ in range(2 * n * width)],
    }
    m, before, starts = stages["m"], stages["increments"], stages["start"]
    expected = [mpf(0)] * (2 * n * width)
    with mp.workdps(DIGITS):
        for lane in range(width):
            reached = [
                mpf(starts[2 * k])
                + starts[2 * k + 1]
                + sum(mpf(m[j * width + lane]) * before[k * width + j] for j in range(width))
                for k in range(2 * n)
            ]
            at = {array: [mpf(row[lane]) for row in rows] for array, rows in given.items()}
            moved = truth.of("hamiltonian_form", {**at, "q": reached[:n], "p": reached[n:]})
            for k, rate in enumerate([*moved["v"], *moved["f"]]):
                expected[k * width + lane] = stages["hb"][lane] * rate
    found, change, size = loaded.iterate(width, given, stages)
    weights = [weight for weight in stages["weights"] for _ in range(width)]
    assert max(abs(x - float(y)) for x, y in zip(found, expected, strict=True)) < 1e-14
    assert change == pytest.approx(
        max(w * abs(float(y) - x) for w, x, y in zip(weights, before, expected, strict=True)), rel=1e-13
    )
    assert size == pytest.approx(
        max(w * abs(float(y)) for w, y in zip(weights, expected, strict=True)), rel=1e-13
    )
    spoilt, change, _ = loaded.iterate(width, given, {**stages, "increments": [*before[:-1], math.nan]})
    assert math.isnan(change) and len(spoilt) == len(found)


NEIGHBOURS = {
    "a large angle": ("q", 2, 3e7),
    "no number": ("q", 2, math.nan),
    "an infinite angle": ("q", 2, math.inf),
    "a large exponent": ("q", 0, -2000.0),
    "a root of a negative number": ("parameters", 0, -1.0),
}


@pytest.mark.parametrize("width", WIDTHS[1:])
@pytest.mark.parametrize("what", NEIGHBOURS)
def test_states_do_not_see_their_neighbours(what, width, everything):
    """Members of an ensemble come out to the bit as they do beside others."""
    loaded, truth = everything
    array, row, number = NEIGHBOURS[what]
    usual = drawn(truth, width, 5)
    odd = {name: [[*each] for each in rows] for name, rows in usual.items()}
    odd[array][row][width - 1] = number
    for name, function in zip(OF_MANY, loaded.table.of_many, strict=True):
        assert function is not None
        alone, beside = loaded.call(name, width, usual), loaded.call(name, width, odd)
        for given in alone:
            assert [each[:-1] for each in alone[given]] == [each[:-1] for each in beside[given]], name


@pytest.mark.parametrize("width", WIDTHS)
def test_large_angles_are_as_exact(width, everything):
    loaded, truth = everything
    given = drawn(truth, width, 6)
    given["q"][2] = [10 ** random.Random(lane).uniform(4, 9) for lane in range(width)]
    found = loaded.call("mass_matrix", width, given)["M"]
    for lane in range(width):
        at = {array: [row[lane] for row in rows] for array, rows in given.items()}
        true = truth.exact("mass_matrix", at)["M"]
        assert [row[lane] for row in found] == pytest.approx([float(x) for x in true], rel=1e-15, abs=1e-15)


def test_what_a_kernel_says_of_itself(everything):
    loaded, _ = everything
    lines = loaded.description.splitlines()
    assert lines == [
        "name\teverything",
        "model\teverything",
        "links\t1",
        "depends_on_time\t1",
        "constant_masses\t0",
        "coordinate\tx\tm\t0\t0",
        "coordinate\ty\tm\t0\t0",
        "coordinate\ttheta\trad\t1\t0",
        "parameter\ta\t1\t1\t1.3\t1\t0",
        "parameter\tb\t\t1\t0.7\t1\t0",
        "input\tu\tN",
        "input\tw\twhat? μ",
        "point\tp\t2\tbob",
        "point\tr\t3\tbob",
        *(line for line in lines if line.startswith("argument\t")),
        "constraint\ttied\tm^2\t0",
        "constraint\tturned\trad\t0",
        "constraint\trolled\tm^2/s\t1",
        f"series\t1\t61\t77\t{loaded.table.series.kept}",
        *(f"sum\t{first}\t{second}" for first, second in loaded.table.series.series.places),
    ]


def test_the_runtime_knows_this_interface(everything):
    header = (REPOSITORY / "src/pendula/system/system_table.hpp").read_text()
    known = int(re.search(r"system_interface = (\d+);", header)[1])
    assert everything[0].interface == known == INTERFACE


def test_strings_of_c():
    assert quoted('a\t"?\\') == r'"a\t\"\?\\\n"'
