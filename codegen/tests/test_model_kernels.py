"""Kernels of models, against SymPy's own derivation of the equations of motion, and of everything in between."""

import math
import random

import pytest
from sympy import Rational, Symbol, cos, diff, exp, lambdify, simplify, sin, sqrt, symbols
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

from pendula_codegen.model import Model, read_model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.models import find_model, model_names
from pendula_codegen.render import render_model
from pendula_codegen.simplify import shortest
from test_straight_line import evaluate

LINKED = {"cart_chain", "driven_chain", "joint_springs", "rods"}
CASES = [(name, n) for name in model_names() for n in ((1, 2, 3) if name in LINKED else (None,))]


def read(name: str, links: int | None) -> Model:
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


@pytest.mark.parametrize(("name", "links"), CASES)
def test_the_residual_is_what_sympy_derives(name, links):
    """SymPy's LagrangesMethod takes the Lagrangian as the file wrote it, not as it was shortened."""
    model = read(name, links)
    system, t = model.system, dynamicsymbols._t
    moving = [dynamicsymbols(q.name) for q in system.coordinates]
    rates = [x.diff(t) for x in moving]
    swap = dict(zip(system.velocities, rates, strict=True))
    swap |= dict(zip(system.coordinates, moving, strict=True)) | {model.time: t}
    method = LagrangesMethod(model.lagrangian.xreplace(swap), moving)
    equations = method.form_lagranges_equations()
    values = values_of(model, seed=len(moving))
    kernel = ModelKernel(model)
    back = {x.diff(t, 2): values[a] for x, a in zip(moving, kernel.accelerations, strict=True)}
    back |= {x.diff(t): values[v] for x, v in zip(moving, system.velocities, strict=True)}
    at = {x: values[q] for x, q in zip(moving, system.coordinates, strict=True)}
    truth = [
        float(equation.subs(back).subs(at).subs(t, values[model.time]).subs(values) - force.subs(values))
        for equation, force in zip(equations, system.forces, strict=True)
    ]
    [residual, *_] = kernel.residuals()
    computed = evaluate(kernel.program(residual), named(model, values).__getitem__)
    scale = max(1.0, *map(abs, truth))
    worst = max(abs(a - b) for a, b in zip(computed, truth, strict=True)) / scale
    assert worst < 1e-13  # measured 7e-16


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
        assert worst < 1e-13, function.name  # measured 2e-15


def test_all_forms_of_a_lagrangian_are_shortened_to_the_same_length():
    a, b, p, q = symbols("a b p q", real=True)
    long = (p * cos(a) + q * cos(b)) ** 2 + (p * sin(a) + q * sin(b)) ** 2
    assert simplify(shortest(long, [a, b]) - (p**2 + q**2 + 2 * p * q * cos(a - b))) == 0
    assert len(shortest(long, [a, b]).args) == 3
    root = sqrt(1 + a**2) / (1 + b) ** 2 - exp(-a * (1 + b))
    assert simplify(shortest(root, []) - root) == 0


def test_rates_of_expressions_are_their_derivatives():
    model = Model("any", 1, "any.py")
    x, y = model.coordinate("x", "m"), model.coordinate("y", "rad")
    value = x * sin(y) + model.time**2
    expected = model.rate(x) * sin(y) + x * cos(y) * model.rate(y) + 2 * model.time
    assert simplify(model.rate(value) - expected) == 0
    assert diff(model.rate(x), model.rate(x)) == 1


def test_a_header_says_what_its_model_says():
    text = render_model(read("cart_chain", 2), "cart_chain.py").text
    assert "struct CartChain2 {" in text
    assert 'coordinate_names = {"x", "theta_1", "theta_2"};' in text
    assert "coordinate_is_angle = {false, true, true};" in text
    assert 'input_names = {"push"};' in text
    assert "constant_masses = true;" in text
    assert "constant_masses = false;" in render_model(read("furuta", None), "furuta.py").text
    assert "Real time;" in render_model(read("driven_chain", 1), "driven_chain.py").text
    assert "Real time;" not in text


def test_names_that_mean_something_in_the_code_are_no_obstacle():
    """A coordinate called p, a parameter called f: arguments and outputs have the same names."""
    model = Model("letters", 1, "letters.py")
    p, v = model.coordinate("p", "m"), model.coordinate("v", "m")
    f = model.parameter("f", "N/m", positive=True)
    model.lagrangian = Rational(1, 2) * (model.rate(p) ** 2 + model.rate(v) ** 2) - f * p**2 * v
    text = render_model(model, "letters.py").text
    assert "const Real& p_ = q[0];" in text and "const Real& f_ = parameters.f;" in text
