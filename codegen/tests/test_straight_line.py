"""The emitted programs compute what the expressions say, with one sine and one cosine an angle."""

import math
import random
import re

import pytest
from sympy import (
    Abs,
    Integer,
    Rational,
    Symbol,
    atan,
    cos,
    exp,
    lambdify,
    log,
    pi,
    sin,
    sinh,
    sqrt,
    symbols,
    tan,
)

from chains import chain
from pendula_codegen.backends.cpp import print_body
from pendula_codegen.chain_kernel import ChainKernel
from pendula_codegen.errors import GenerationError
from pendula_codegen.language import refusal
from pendula_codegen.link import LinkKernel
from pendula_codegen.links import LINKS
from pendula_codegen.places import Place
from pendula_codegen.program import shortest_program
from pendula_codegen.straight_line import UNIT
from pendula_codegen.vocabulary import Angle, Form, Leaf, Vocabulary

x, y, theta = symbols("x_1 y_1 theta_1")
SMALL = [("planar", 1), ("planar", 3), ("spatial", 1), ("spatial", 2)]


def call(function, x: float) -> float:
    """What a call atom computes; a definition is its argument itself. Errors are infinite or no number, as in C++."""
    if function == "":
        return x
    try:
        if isinstance(function, tuple):
            return x ** float(function[1]) if x >= 0 else math.nan
        return 1 / x if function == "inverse" else getattr(math, function)(x)
    except (OverflowError, ZeroDivisionError):
        return math.inf
    except ValueError:
        return math.nan


def evaluate(program, value_of) -> list[float]:
    """Runs a program as it is printed; `value_of(name)` gives what is read."""
    values = {UNIT: 1.0}
    graph = program.graph
    for node in program.order:
        if node in graph.definitions:
            coefficient, part = graph.definitions[node]
            values[node] = call(program.atoms[node].function, float(coefficient) * values[part])
        elif node < len(program.atoms):
            values[node] = value_of(program.atoms[node].name)
        elif node in graph.products:
            values[node] = math.prod(values[part] for part in graph.products[node])
        else:
            terms = sorted(graph.sums[node], key=lambda term: term[0] < 0)
            values[node] = sum(float(c) * values[part] for c, part in terms)
    return [float(c) * values[node] if c else 0.0 for c, node in program.outputs]


def random_values(c, seed: int) -> dict[str, float]:
    draw = random.Random(seed)
    plain = [*c.coordinates, *c.velocities, *c.accelerations, c.model.gravity]
    plain += [s for i in c.numbers for s in (c.mass(i), c.length(i), c.damping(i), *c.torque(i))]
    values = {symbol.name: draw.uniform(0.5, 2.0) for symbol in plain}
    for angle in c.coordinates:
        values[f"sin_{angle}"] = math.sin(values[angle.name])
        values[f"cos_{angle}"] = math.cos(values[angle.name])
    values.update({f"p_{angle}": draw.uniform(0.5, 2.0) for angle in c.coordinates})
    return values


@pytest.mark.parametrize(("space", "n"), SMALL)
def test_every_entry_point_computes_its_expressions(space, n):
    c = chain(space, n)
    kernel = ChainKernel(c)
    values = random_values(c, seed=n)
    tails = {c.mass_below(i).name: sum(values[c.mass(k).name] for k in range(i, n + 1)) for i in c.numbers}
    inertias = {
        c.inertia(i, j).name: tails[f"M_{j}"] * values[f"l_{i}"] * values[f"l_{j}"]
        for i in c.numbers
        for j in range(i, n + 1)
    }
    numbers = {Symbol(name): value for name, value in {**values, **tails, **inertias}.items()}
    for function in kernel.functions():
        truth = lambdify(list(numbers), [e for _, e in function.candidates()[0]], "math")(*numbers.values())
        computed = evaluate(kernel.program(function), values.__getitem__)
        scale = max(1.0, *map(abs, truth))
        worst = max(abs(a - b) for a, b in zip(computed, truth, strict=True)) / scale
        assert worst < 1e-14, function.name  # measured 4e-16


@pytest.mark.parametrize(("space", "n"), SMALL)
def test_one_sine_and_one_cosine_an_angle(space, n, fresh_headers):
    text = fresh_headers[f"{space}_{n}.hpp"].split(" private:")[0]
    for body in re.findall(r"static void .*?\n  }\n", text, re.S):
        calls = re.findall(r"\b(sin|cos|sine_and_cosine)\((.*?)[,)]", body)
        angles = [angle for _, angle in calls]
        assert len(angles) == len(set(angles)) <= len(chain(space, n).coordinates)
        assert all(re.fullmatch(r"(q|state)\[\d\]", angle) for angle in angles)


def test_residual_alone_computes_nothing_of_its_jacobian(fresh_headers):
    """Every temporary of the residual is read by the residual."""
    text = fresh_headers["spatial_2.hpp"]
    body = text.split("static void residual(")[1].split("\n  }\n")[0].split(") {")[1]
    for name in re.findall(r"const Real&? (\w+) =", body):
        assert len(re.findall(rf"\b{name}\b", body)) > 1, name


def vocabulary(*definitions) -> Vocabulary:
    leaves = [Leaf(x, Place("x", index=(0,)), "x"), Leaf(y, Place("y", index=(0,)), "y")]
    angles = [Angle(s, Place("q", index=(k,))) for k, s in enumerate(symbols("theta_1:4"))]
    return Vocabulary(leaves, angles, dict(definitions), Form(pair_angles=True, expanded=frozenset()))


def body_of(*expressions) -> list[str]:
    assignments = [(Place("out", index=(k,)), e) for k, e in enumerate(expressions)]
    lines = print_body(shortest_program([assignments], [vocabulary()])).lines
    return [
        line
        for line in lines
        if not line.startswith(("const Real&", "Real sin_")) and not re.search(r"(sin|cos|cosine)\(", line)
    ]


def test_shared_products_and_sums_become_temporaries():
    assert body_of(x * y + 1, 3 * x * y) == [
        "const Real x_1_y_1 = x_1 * y_1;",
        "out[0] = Real(1.0) + x_1_y_1;",
        "out[1] = Real(3.0) * x_1_y_1;",
    ]
    assert body_of((x + y) * cos(theta), (x + y) * sin(theta)) == [
        "const Real t1 = x_1 + y_1;",
        "out[0] = cos_theta_1 * t1;",
        "out[1] = sin_theta_1 * t1;",
    ]


def test_squares_are_products_and_signs_cost_nothing():
    assert body_of(-x * x, y - x) == ["out[0] = -x_1 * x_1;", "out[1] = y_1 - x_1;"]


def test_fractions_are_exact_constants():
    assert body_of(x / 2, y / 3) == ["out[0] = Real(0.5) * x_1;", "out[1] = Real(1.0 / 3.0) * y_1;"]


def test_sums_of_angles_are_expanded():
    a, b, c = symbols("theta_1:4")
    v = vocabulary()
    for expression, expanded in [
        (sin(a + b), sin(a) * cos(b) + cos(a) * sin(b)),
        (cos(2 * a), cos(a) ** 2 - sin(a) ** 2),
        (cos(a - b + c), cos(a - b) * cos(c) - sin(a - b) * sin(c)),
    ]:
        flat = Vocabulary(
            [], [Angle(s, Place("q")) for s in (a, b, c)], {}, Form(pair_angles=False, expanded=frozenset())
        )
        assert flat.polynomial(expression) == flat.polynomial(expanded)
        assert v.polynomial(expression)
    assert v.polynomial(sin(b - a)) == {m: -k for m, k in v.polynomial(sin(a - b)).items()}


def test_what_a_kernel_cannot_compute_is_refused():
    with pytest.raises(GenerationError, match=r"^a kernel cannot evaluate Abs\(x_1\): it has \+ −"):
        vocabulary().polynomial(Abs(x))
    with pytest.raises(GenerationError, match=r"holds the symbol 'z', which is not an argument$"):
        vocabulary().polynomial(Symbol("z"))
    assert refusal(x**65) == "a kernel cannot evaluate x_1**65: it has powers up to 64"
    with pytest.raises(GenerationError, match=r"no finite real number$"):
        vocabulary().polynomial(x * sqrt(Integer(-2)))


def test_sines_of_many_times_an_angle_are_not_expanded():
    """cos(10 x) by cos x has coefficients of a thousand that cancel; cos(10⁶ x) would never end."""
    place = Place("q", index=(0,))
    atoms = Vocabulary(
        [Leaf(theta, place, "q")], [Angle(theta, place)], {}, Form(pair_angles=False, expanded=frozenset())
    )
    for times, expanded in ((3, True), (5, False), (1000000, False)):
        program = shortest_program([[(Place("out"), cos(times * theta))]], [atoms])
        assert (not program.graph.definitions) == expanded


def test_functions_are_computed_once_for_each_argument():
    assert body_of(sqrt(x + y), (y + x) ** Rational(-3, 2)) == [
        "const Real sqrt_1 = sqrt(x_1 + y_1);",
        "const Real inverse_1 = Real(1.0) / sqrt_1;",
        "out[0] = sqrt_1;",
        "out[1] = inverse_1 * inverse_1 * inverse_1;",
    ]
    assert body_of(exp(2 * x), 1 / (2 * y)) == [
        "const Real exp_1 = exp(Real(2.0) * x_1);",
        "const Real inverse_1 = Real(1.0) / y_1;",
        "out[0] = exp_1;",
        "out[1] = Real(0.5) * inverse_1;",
    ]


@pytest.mark.parametrize(
    "expression",
    [
        x ** Rational(1, 3) + x ** Rational(2, 5) / y,
        tan(x) + atan(y) * log(x) - sinh(x * y),
        exp(-x) * sin(x * y + 1) + cos(x * y + 1) ** 2,
        x**y + pi * sqrt(2) * y + 0.1,
        x**40 - y ** (-7),
        1 / (1 / x + 1 / y),
    ],
)
def test_functions_compute_what_they_say(expression):
    values = {"x_1": 1.3, "y_1": 0.7}
    program = shortest_program([[(Place("out"), expression)]], [vocabulary()])
    assert evaluate(program, values.__getitem__)[0] == pytest.approx(
        float(expression.subs({x: 1.3, y: 0.7})), rel=1e-14
    )  # measured 3e-16


@pytest.mark.parametrize("model", LINKS.values(), ids=LINKS)
def test_every_link_entry_point_computes_its_expressions(model):
    kernel = LinkKernel(model)
    draw = random.Random(7)
    angles = {q: draw.uniform(0.3, 2.0) for q in model.coordinates}
    values = {
        f"{f.__name__}_{q}": getattr(math, f.__name__)(a) for q, a in angles.items() for f in (sin, cos)
    }
    for function in kernel.functions():
        read = {leaf.symbol: draw.uniform(-2.0, 2.0) for leaf in function.leaves}
        values.update({symbol.name: value for symbol, value in read.items()})
        truth = [float(value.subs({**angles, **read})) for _, value in function.assignments]
        computed = evaluate(kernel.program(function), values.__getitem__)
        assert computed == pytest.approx(truth, rel=1e-14, abs=1e-14), function.name  # measured 2e-16
