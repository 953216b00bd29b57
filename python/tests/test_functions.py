"""Lagrangians that are written as functions."""

import linecache
import math
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

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

    with pytest.raises(
        pendula.InputError, match=r"test_functions\.py:\d+: expected model\.lagrangian to be set"
    ):
        nothing()


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


# Where the text of functions is not known: by itself, with a function that it uses, with a default and a value.
TYPED = """
import pendula
from sympy import cos
size = 2.0
def height(theta, factor=1.0):
    return -factor * cos(theta)
@pendula.model
def swing(model, links):
    theta = model.coordinate("theta", "rad")
    g = model.parameter("gravity", "m/s^2", default=9.81)
    inside = [size * height(theta) for _ in range(1)]
    model.lagrangian = size**2 * model.rate(theta) ** 2 / 2 - g * inside[0]

run = swing().simulate(1.0, theta=0.7)
print(repr(swing()), repr(run.sol(0.9)[0]))
"""


@pytest.mark.parametrize("how", ["-c", "stdin", "typed"])
def test_a_function_without_a_text_is_a_model(how, tmp_path):
    words = {"-c": ["-c", TYPED], "stdin": ["-"], "typed": ["-i", "-q"]}[how]
    typed = TYPED.replace("    model.lagrangian", "    model.lagrangian")
    typed = typed.replace("cos(theta)\n@", "cos(theta)\n\n@")
    found = {
        **os.environ,
        "PYTHONPATH": str(Path(pendula.__file__).parents[1]),
        "XDG_CACHE_HOME": str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, *words], input=typed, env=found, capture_output=True, text=True, check=False
    )
    chain = pendula.Chain(links=1, lengths=2.0).simulate(1.0, theta=0.7)
    told, number = done.stdout.split("swing() ")[0], done.stdout.split("swing() ")[-1]
    assert told.strip(">. \n") == "", done.stderr
    number = float(re.search(r"-?[\d.]+", number.removeprefix("np.float64("))[0])
    assert abs(number - chain.sol(0.9)[0]) < 1e-8, done.stderr  # measured 5e-12
    # Whoever has the file needs no function.
    [file] = tmp_path.glob("pendula/functions/*/swing.py")
    again = pendula.Model(file).simulate(1.0, theta=0.7)
    assert abs(again.sol(0.9)[0] - number) < 1e-12  # measured 0


def test_errors_name_the_line_of_the_function_and_near_names(tmp_path, monkeypatch):
    file = tmp_path / "mine.py"
    file.write_text(
        "import pendula\n"
        "from sympy import cos\n"
        "\n"
        "@pendula.model\n"
        "def swing(model, links):\n"
        '    """A comment."""\n'
        "    # Another one.\n"
        "    theta = model.coordinate(\n"
        '        "theta", "rad"\n'
        "    )\n"
        "    model.lagrangian = model.rate(theta) ** 2 / 2 + {}\n"
    )
    text = file.read_text()
    for wrong, told in (
        (
            "cos(thet)",
            r"mine\.py:11: swing: expected to use names that are known, got thet; did you mean theta",
        ),
        ("sin(theta)", r"mine\.py:11: .* got sin; SymPy has it: from sympy import sin$"),
        (
            "__import__('math').cos(theta)",
            r"mine\.py:11: TypeError: .*; take SymPy's: from sympy import cos",
        ),
        ("__import__('numpy').cos(theta)", r"mine\.py:11: .*; take SymPy's: from sympy import cos"),
        ("model.parametr('a', '1')", r"mine\.py:11: AttributeError: .*; did you mean parameter "),
        ("1 / 0", r"mine\.py:11: ZeroDivisionError"),
        ("theta * 'a'", r"mine\.py:11: "),
    ):
        file.write_text(text.replace("{}", wrong))
        linecache.clearcache()
        with pytest.raises(pendula.InputError, match=told) as raised:
            runpy.run_path(str(file))["swing"]()
        assert "functions" not in str(raised.value), raised.value


def test_a_model_is_called_as_it_was_made():
    made = bob(length=2.0)
    assert repr(made) == "bob(length=2.0)" and repr(bob) == "<model bob>"
    assert made == bob(length=2.0) != bob(length=3.0) and hash(made) == hash(bob(length=2.0))


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
