"""Kernels of models, against SymPy's own derivation of the equations of motion, and of everything in between."""

import math
import random
from functools import cache

import pytest
from sympy import Rational, Symbol, atan, cos, diff, exp, lambdify, log, simplify, sin, sqrt, symbols, tan
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

from pendula_codegen.model import Model, read_model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import find_model, model_names
from pendula_codegen.render import render_model
from pendula_codegen.simplify import shortest
from test_straight_line import evaluate

LINKED = {"cart_chain", "driven_chain", "joint_springs", "rods"}
CASES = [(name, n) for name in model_names() for n in ((1, 2, 3) if name in LINKED else (None,))]


@cache
def read(name: str, links: int | None) -> Model:
    """It is read once."""
    return read_model(find_model(name), links)


def values_of(model: Model, seed: int) -> dict[Symbol, float]:
    """A number for every symbol of the model."""
    draw = random.Random(seed)
    system = model.system
    kernel = ModelKernel(model)
    held = (*system.coordinates, *system.velocities, *system.parameters, *system.inputs, model.time)
    return {
        symbol: draw.uniform(0.5, 1.5) for symbol in (*held, *kernel.accelerations, *kernel.momentum_symbols)
    }


def named(model: Model, values: dict[Symbol, float]) -> dict[str, float]:
    """The same by the names of atoms, with the sines and cosines of angles."""
    numbers = {symbol.name: value for symbol, value in values.items()}
    for coordinate in model.coordinates:
        angle = numbers[coordinate.symbol.name]
        numbers[f"sin_{coordinate.symbol.name}"] = math.sin(angle)
        numbers[f"cos_{coordinate.symbol.name}"] = math.cos(angle)
    return numbers


def derived_by_sympy(model: Model, values: dict[Symbol, float]) -> list[float]:
    """E by SymPy's LagrangesMethod, which takes the Lagrangian as the file wrote it, not as it was shortened."""
    system, t = model.system, dynamicsymbols._t
    moving = [dynamicsymbols(q.name) for q in system.coordinates]
    swap = {v: x.diff(t) for v, x in zip(system.velocities, moving, strict=True)}
    swap |= dict(zip(system.coordinates, moving, strict=True)) | {model.time: t}
    equations = LagrangesMethod(model.lagrangian.xreplace(swap), moving).form_lagranges_equations()
    kernel = ModelKernel(model)
    back = {x.diff(t, 2): values[a] for x, a in zip(moving, kernel.accelerations, strict=True)}
    back |= {x.diff(t): values[v] for x, v in zip(moving, system.velocities, strict=True)}
    at = {x: values[q] for x, q in zip(moving, system.coordinates, strict=True)}
    return [
        float(equation.subs(back).subs(at).subs(t, values[model.time]).subs(values) - force.subs(values))
        for equation, force in zip(equations, system.forces, strict=True)
    ]


def residual_error(model: Model, seed: int) -> float:
    """Of the generated residual against SymPy's, relative to the largest."""
    values, kernel = values_of(model, seed), ModelKernel(model)
    truth = derived_by_sympy(model, values)
    computed = evaluate(kernel.program(kernel.residuals()[0]), named(model, values).__getitem__)
    return max(abs(a - b) for a, b in zip(computed, truth, strict=True)) / max(1.0, *map(abs, truth))


@pytest.mark.parametrize(("name", "links"), CASES)
def test_the_residual_is_what_sympy_derives(name, links):
    assert residual_error(read(name, links), seed=7) < 1e-14  # measured 2.4e-16


def random_model(seed: int) -> Model:
    """A Lagrangian that nobody would write, of all that one may: two to three coordinates, angles and lengths."""
    draw = random.Random(seed)
    model = Model(f"random_{seed}", 1, "random.py")
    q = [model.coordinate(f"q_{k}", draw.choice(["rad", "m"])) for k in range(draw.choice([2, 3]))]
    a = [model.parameter(f"a_{k}", "1", default=1.0, positive=True) for k in range(4)]
    t, v = model.time, [model.rate(x) for x in q]

    def term():
        x, y, b = draw.choice(q), draw.choice(q), draw.choice(a)
        return b * draw.choice(
            [
                sin(x),
                cos(2 * x - y),
                x**2 * y,
                exp(-b * x),
                sqrt(1 + x**2),
                log(2 + cos(y)),
                1 / (1 + b * x**2),
                (1 + x**2) ** Rational(-3, 2),
                cos(b * t + x) * y,
                atan(x * y),
            ]
        )

    kinetic = sum((b + term() ** 2) * w**2 for b, w in zip(a, v, strict=False)) / 2
    kinetic += draw.choice([0, 1]) * sin(q[0] - q[1]) / 4 * v[0] * v[1] + term() * v[0]
    model.lagrangian = kinetic - sum(term() * term() for _ in range(3))
    model.dissipation = a[0] * (v[0] - v[1]) ** 2 / 2
    model.force(q[0], term() * model.input("f", "N"))
    return model


@pytest.mark.parametrize("seed", range(12))
def test_the_residual_of_random_lagrangians_is_what_sympy_derives(seed):
    assert residual_error(random_model(seed), seed) < 1e-14  # measured 1.1e-15


@pytest.mark.parametrize("seed", range(12))
def test_the_forms_of_random_lagrangians_agree(seed):
    """hamiltonian_form solves M v = p − ∂L/∂v at rest within; the momenta of these rates are p again."""
    model = random_model(seed)
    kernel, values = ModelKernel(model), values_of(random_model(seed), seed)
    system = kernel.system
    mass = [[float(entry.subs(values)) for entry in row] for row in kernel.mass.tolist()]
    p = [float(expression.subs(values)) for expression in kernel.L_v]
    known = {**values, **dict(zip(kernel.momentum_symbols, p, strict=True))}
    by_function = {function.name: function for function in kernel.functions()}
    form = by_function["hamiltonian_form"]
    outputs = evaluate(kernel.program(form), named(model, known).__getitem__)
    size = len(p)
    lower = size * (size + 1) // 2
    right, f = outputs[lower : lower + size], outputs[lower + size :]
    rates = [values[v] for v in system.velocities]
    solved = [sum(m * v for m, v in zip(row, rates, strict=True)) for row in mass]
    assert right == pytest.approx(solved, rel=1e-14, abs=1e-14)  # measured 2.9e-16
    momentum_form = by_function["momentum_form"]
    again = evaluate(kernel.program(momentum_form), named(model, values).__getitem__)
    assert [*p, *f] == pytest.approx(again, rel=1e-14, abs=1e-14)  # measured 3.9e-16


@pytest.mark.parametrize(("name", "links"), CASES)
def test_every_entry_point_computes_its_expressions(name, links):
    model = read(name, links)
    kernel = ModelKernel(model)
    values = values_of(model, seed=3)
    for function in kernel.functions():
        assignments = function.candidates()[0]
        truth = lambdify(list(values), [e for _, e in assignments], "math")(*values.values())
        computed = evaluate(kernel.program(function), named(model, values).__getitem__)
        scale = max(1.0, *map(abs, truth))
        worst = max(abs(a - b) for a, b in zip(computed, truth, strict=True)) / scale
        assert worst < 1e-14, function.name  # measured 4.4e-16


def test_all_forms_of_a_lagrangian_are_shortened_to_the_same_length():
    a, b, p, q = symbols("a b p q", real=True)
    long = (p * cos(a) + q * cos(b)) ** 2 + (p * sin(a) + q * sin(b)) ** 2
    assert simplify(shortest(long, [a, b], [p]) - (p**2 + q**2 + 2 * p * q * cos(a - b))) == 0
    assert len(shortest(long, [a, b], [p]).args) == 3


def test_nothing_else_is_multiplied_out():
    a, b, x, v = symbols("a b x v", real=True)
    for said in (
        sqrt(1 + a**2) / (1 + b) ** 2 - exp(-((a - 2) ** 2) * (1 + b)),
        (x - 1000) ** 2 * v**2,
        (v - x) ** 2,
        (cos(a) - cos(b)) ** 2,  # where nothing moves
        (x + sin(a)) ** 2 * v**2,
    ):
        assert shortest(said, [a, b], [v]) == said


def test_rates_of_expressions_are_their_derivatives():
    model = Model("any", 1, "any.py")
    x, y = model.coordinate("x", "m"), model.coordinate("y", "rad")
    value = x * sin(y) + model.time**2
    expected = model.rate(x) * sin(y) + x * cos(y) * model.rate(y) + 2 * model.time
    assert simplify(model.rate(value) - expected) == 0
    assert diff(model.rate(x), model.rate(x)) == 1


def test_a_header_says_what_its_model_says():
    text = render_model(read("cart_chain", 2), "cart_chain.py").text
    assert "struct cart_chain_2_kernel {" in text
    assert 'coordinate_names = {"x", "theta_1", "theta_2"};' in text
    assert "coordinate_is_angle = {false, true, true};" in text
    assert "coordinate_is_periodic = {false, true, true};" in text
    wound = render_model(read("joint_springs", 2), "joint_springs.py").text
    assert "coordinate_is_angle = {true, true};" in wound
    assert "coordinate_is_periodic = {false, false};" in wound
    assert 'input_names = {"push"};' in text
    assert "constant_masses = true;" in text
    assert "constant_masses = false;" in render_model(read("furuta", None), "furuta.py").text
    assert "_real time;" in render_model(read("driven_chain", 1), "driven_chain.py").text
    assert "_real time;" not in text


def test_names_that_mean_something_in_the_code_are_no_obstacle(tmp_path):
    """A coordinate called p, a parameter called f: arguments and outputs have the same names."""
    file = tmp_path / "letters.py"
    file.touch()
    model = Model("letters", 1, str(file))
    p, v = model.coordinate("p", "m"), model.coordinate("v", "m")
    f = model.parameter("f", "N/m", positive=True)
    model.lagrangian = Rational(1, 2) * (model.rate(p) ** 2 + model.rate(v) ** 2) - f * p**2 * v
    text = render_model(model, "letters.py").text
    assert "const Real& p_ = q[0];" in text and "const Real& f_ = parameters.f;" in text


def test_a_kernel_tells_what_narrow_functions_are_taken_of():
    model = Model("narrow", 1, "narrow.py")
    x, a = model.coordinate("x", "m"), model.coordinate("a", "rad")
    w, push = model.parameter("w", "m", default=0.1), model.input("push", "N")
    v, t = model.rate(x), model.time
    model.lagrangian = v**2 / 2 + model.rate(a) ** 2 / 2 - exp(-((x / w) ** 2)) - 1 / (1 + (x - w) ** 2)
    model.lagrangian += x**4 * cos(3 * a) + exp(w) - log(1 + x**2) + sqrt(x**2 + w)
    model.force(x, push * exp(-t) - v / sqrt(v**2 + w) + tan(a) + atan(push) + 2**x)
    assert dict(ModelKernel(model).call_arguments) == {
        -(x**2) / w**2: False,
        1 + (x - w) ** 2: True,
        1 + x**2: True,
        x**2 + w: True,
        v**2 + w: True,
        cos(a): True,
        -t: False,
        push: False,
        x * log(2): False,
    }


@pytest.mark.parametrize(("name", "links"), CASES)
def test_models_of_sines_and_whole_powers_pay_nothing(name, links):
    kernel = ModelKernel(read(name, links))
    tells = "call_arguments" in [function.name for function in kernel.functions()]
    assert tells == bool(kernel.call_arguments) == (name == "spring_pendulum")  # the root of a length
