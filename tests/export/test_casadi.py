"""Exported functions of CasADi's external interface: as acados calls them, and as CasADi does where it is there."""

import random
import subprocess
from importlib.util import find_spec

import pytest
from conftest import COMPILER, CONSUMER, EXAMPLES, FLAGS, consumer, numbers

STEP = 0.02


@pytest.fixture
def cart(export, tmp_path):
    """A cart with two links, that a force pushes; its CasADi functions, too."""
    folder = export(tmp_path, "cart_chain", "--links", "2", "--stages", "3", language="casadi")
    assert (folder / "system_casadi.c").exists()
    return folder


def test_the_step_is_a_discrete_model_of_acados(cart):
    program = cart / "acados"
    files = [CONSUMER / "acados.c", cart / "system.c", cart / "system_casadi.c"]
    subprocess.run([COMPILER, *FLAGS, "-O1", f"-I{cart}", *files, "-o", program, "-lm"], check=True)
    ours = numbers(consumer(cart), 1, STEP)
    start = [0.0] * 6
    given = [*start, *ours["inputs"], *ours["parameters"], 0.0, STEP]
    ended = subprocess.run([program, *map(repr, given)], capture_output=True, text=True)
    assert ended.returncode == 0, ended.returncode
    found = [*map(float, ended.stdout.split())]
    assert found[:6] == ours["state"]
    # A column for each row of the derivative by (u, x).
    by_state, by_inputs = ours["by_state"], ours["by_inputs"]
    assert found[6:] == [x for row in range(6) for x in (by_inputs[row], *by_state[6 * row : 6 * row + 6])]


def library(folder):
    shared = folder / "system.so"
    files = [folder / "system.c", folder / "system_casadi.c"]
    command = [COMPILER, *FLAGS, "-O1", "-fPIC", "-shared", *files, "-o", shared, "-lm"]
    subprocess.run(command, check=True)
    return shared


needs_casadi = pytest.mark.skipif(find_spec("casadi") is None, reason="CasADi is not installed: 280 MB")


def differences(function, arguments, place, casadi):
    """The derivative of a function's result by an argument, of fourth order."""
    step, columns = 1e-3, []
    for k in range(arguments[place].numel()):
        value = 0
        for away, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
            moved = [casadi.DM(each) for each in arguments]
            moved[place][k] += away * step
            value += weight / step * function(*moved)
        columns.append(value)
    return casadi.horzcat(*columns)


@needs_casadi
@pytest.mark.parametrize("name", ["system_next", "system_dynamics"])
@pytest.mark.parametrize(
    "model",
    [
        ("cart_chain", "--links", "2"),
        ("driven_chain",),
        ("swinging_atwood",),
        (EXAMPLES / "driven_damped.toml",),
    ],
)
def test_casadi_calls_functions_and_their_jacobians_where_it_is_installed(name, model, export, tmp_path):
    import casadi

    function = casadi.external(name, str(library(export(tmp_path, *model, language="casadi"))))
    slope = function.jacobian()
    draw = random.Random(5)
    arguments = [
        casadi.DM([draw.uniform(0.5, 1.5) for _ in range(function.size1_in(k))])
        for k in range(function.n_in())
    ]
    if name == "system_next":
        arguments[4] = casadi.DM(STEP)
    found = slope(*arguments, function(*arguments))
    for place in range(function.n_in()):
        if function.size1_in(place) == 0:
            continue
        true = differences(function, arguments, place, casadi)
        error = float(casadi.norm_inf(casadi.vec(casadi.DM(found[place]) - true)))
        size = max(1.0, float(casadi.norm_inf(casadi.vec(true))))
        assert error < 1e-9 * size  # measured 1.8e-11


@needs_casadi
def test_second_derivatives_are_those_that_casadi_finds_by_itself_where_it_is_installed(cart, monkeypatch):
    import casadi

    monkeypatch.syspath_prepend(EXAMPLES)
    from swing_up import NUMBERS, OPTIONS, by_hand

    theirs, ours = by_hand(), casadi.external("system_dynamics", str(library(cart)), OPTIONS)
    x, u, weights = casadi.MX.sym("x", 6), casadi.MX.sym("u"), casadi.DM([0.3, -0.7, 0.5, 1.1, -0.4, 0.8])
    at = casadi.DM([0.3, 2.9, 1.2, 0.4, -1.3, 0.7, 5.0])
    found = []
    for rates in (ours(x, u, NUMBERS, 0), theirs(x, u)):
        hessian, _ = casadi.hessian(casadi.dot(weights, rates), x)
        found.append(casadi.Function("hessian", [x, u], [hessian])(at[:6], at[6]))
    error = float(casadi.norm_inf(casadi.vec(found[0] - found[1])))
    assert error < 1e-6, found  # of 24; measured 1.5e-7
