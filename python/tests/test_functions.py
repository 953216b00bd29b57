"""Lagrangians that are written as functions."""

import math

import numpy as np
import pendula
import pytest
import sympy
from sympy import cos, sin
from sympy import sqrt as root

GRAVITY = 9.81
SHIFT = sympy.Rational(1, 3)


def height(theta):
    return -cos(theta)


@pendula.model
def bob(model, links):
    """A bob on a rod."""
    theta = model.coordinate("theta", "rad")
    length = model.parameter("length", "m", default=1.0, positive=True)
    model.lagrangian = length**2 * model.rate(theta) ** 2 / 2 - GRAVITY * length * height(theta)
    model.point("bob", (length * sin(theta), length * height(theta)))


def test_a_function_is_a_model():
    run = bob(length=2.0).simulate(3.0, theta=0.7)
    chain = pendula.Chain(links=1, lengths=2.0).simulate(3.0, theta=0.7)
    assert abs(run.y[0, -1] - chain.y[0, -1]) < 1e-8  # measured 4e-11
    assert run.success and bob.__doc__ == "A bob on a rod." and "bob" in repr(bob)
    assert pendula.model(bob.__wrapped__).file == bob.file
    text = bob.file.read_text()
    assert "def define(model, links)" in text and "GRAVITY = 9.81" in text and "pendula" not in text
    # The file stands alone.
    again = pendula.Model(bob.file, length=2.0).simulate(3.0, theta=0.7)
    assert np.array_equal(again.y, run.y)


def test_it_may_use_what_surrounds_it():
    stiffness = 3.0

    @pendula.model
    def sprung(model, links):
        x = model.coordinate("x", "m")
        model.lagrangian = model.rate(x) ** 2 / 2 - stiffness * root(1) * x**2 / 2 - SHIFT * x * 0
        model.point("mass", (x, sympy.Integer(0)))

    run = sprung().simulate(1.0, x=1.0)
    assert abs(run["x"][-1] - math.cos(math.sqrt(3))) < 1e-8  # measured 2e-11


def test_wrong_functions_are_named():
    with pytest.raises(
        pendula.InputError, match=r"few: expected the arguments \(model, links\), got \['model'\]"
    ):

        @pendula.model
        def few(model):
            pass

    table = {"a": 1}
    with pytest.raises(pendula.InputError, match=r"other: expected to use SymPy.* got table, of type dict"):

        @pendula.model
        def other(model, links):
            model.lagrangian = table["a"]

    with pytest.raises(TypeError, match="model: expected a function, got int"):
        pendula.model(3)

    @pendula.model
    def nothing(model, links):
        model.coordinate("x", "m")

    with pytest.raises(pendula.InputError, match="lagrangian"):
        nothing().simulate(1.0)
