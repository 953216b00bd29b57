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


def test_it_is_called_before_it_moves():
    for take in (pendula.Simulation, pendula.linearize):
        with pytest.raises(pendula.InputError, match=r"got the function bob: bob\(\) is a Model$"):
            take(bob, {"theta": 0.5})


def test_it_may_use_what_surrounds_it():
    stiffness = 3.0

    @pendula.model
    def sprung(model, links):
        x = model.coordinate("x", "m")
        model.lagrangian = model.rate(x) ** 2 / 2 - stiffness * root(1) * x**2 / 2 - SHIFT * x * 0
        model.point("mass", (x, sympy.Integer(0)))

    run = sprung().simulate(1.0, x=1.0)
    assert abs(run["x"][-1] - math.cos(math.sqrt(3))) < 1e-8  # measured 2.8e-17


def test_wrong_functions_are_named():
    with pytest.raises(
        pendula.InputError, match=r"few: expected the arguments \(model, links\), got \(model\)"
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


def test_a_name_has_one_meaning(tmp_path):
    stiffness = 4.0

    def potential(x):
        return stiffness * x**2 / 2

    def outer(stiffness):
        def osc(model, links):
            x = model.coordinate("x", "m")
            model.lagrangian = model.rate(x) ** 2 / 2 - stiffness * x**2 / 2 - potential(x)

        return osc

    with pytest.raises(pendula.InputError, match="expected one meaning of stiffness in all functions"):
        pendula.model(outer(16.0))
    assert pendula.model(outer(4.0)).file.exists()


def twice(function):
    return lambda x: 2 * function(x)


def test_decorators_and_changed_texts_are_refused(tmp_path, monkeypatch):
    def plain(x):
        return x**2

    decorated = twice(plain)

    @pendula.model
    def fine(model, links):
        x = model.coordinate("x", "m")
        model.lagrangian = model.rate(x) ** 2 / 2 - plain(x)

    with pytest.raises(pendula.InputError, match="by def"):

        @pendula.model
        def wrong(model, links):
            x = model.coordinate("x", "m")
            model.lagrangian = model.rate(x) ** 2 / 2 - decorated(x)

    file = tmp_path / "changing.py"
    text = "def osc(model, links):\n    x = model.coordinate('x', 'm')\n"
    text += "    model.lagrangian = model.rate(x)**2 - {}*x**2\n"
    file.write_text(text.format(4))
    monkeypatch.syspath_prepend(tmp_path)
    import changing

    file.write_text(text.format(9))
    with pytest.raises(pendula.InputError, match="osc: expected a function whose text has not changed"):
        pendula.model(changing.osc)
    file.write_text(text.format(4))
    kept = pendula.model(changing.osc).file
    before = kept.read_text()
    kept.write_text("# changed")
    assert pendula.model(changing.osc).file.read_text() == before
