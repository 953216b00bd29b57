"""Models: what they have, and how they get their kernels."""

import math
import os
import signal
import subprocess
import sys
import time

import pendula
import pytest

MODEL = """
from sympy import cos

def define(model, links):
    theta = model.coordinate("theta", "rad")
    length = model.parameter("length", "m")
    model.force(theta, model.input("torque", "N m"))
    model.lagrangian = length**2 * model.rate(theta) ** 2 / 2 + 9.81 * length * cos(theta)
    model.point("bob", (length * theta, 0 * theta))
"""


def test_a_model_tells_what_it_has():
    cart = pendula.Model("cart_chain", links=2, cart_mass=2.0)
    assert cart.links == 2 and cart.points[0] == "cart"
    assert cart.coordinates == ["x", "theta_1", "theta_2"] and cart.rates == [
        "x_dot",
        "theta_dot_1",
        "theta_dot_2",
    ]
    assert cart.inputs == ["push"] and cart.parameters["cart_mass"] == 2.0
    assert cart.units["x"] == "m" and cart.units["theta_dot_1"] == "rad/s" and cart.units["push"] == "N"
    assert "links=2" in repr(cart) and "cart_mass=2.0" in repr(cart)
    assert {"furuta", "cart_chain"} <= set(pendula.models())
    for name in pendula.models():
        assert pendula.Model(name).coordinates


TIED = """
def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - 9.81 * y
    model.constraint("rod", (x**2 + y**2 - 0.64) / 1.6, "m")
"""


def test_a_model_with_constraints(tmp_path):
    """A pendulum: its rod pulls by m (v²/l - g y/l)."""
    (tmp_path / "tied.py").write_text(TIED)
    tied = pendula.Model(tmp_path / "tied.py")
    assert tied.constraints == ["rod"] and pendula.Model("furuta").constraints == []
    run = tied.simulate(3.0, x=0.6, y=-0.5, assemble=["y", "x_dot", "y_dot"])
    assert run.summary["assembled"]["y"] == pytest.approx(-math.sqrt(0.28), abs=1e-14)
    assert max(run.summary["constraint_error"].values()) < 1e-13  # measured
    pull = ((run["x_dot"] ** 2 + run["y_dot"] ** 2) - 9.81 * run["y"]) / 0.8
    assert abs(run["force_rod"] + pull).max() < 1e-8
    with pytest.raises(pendula.InputError, match="unknown keyword assemble"):
        pendula.Model("furuta").simulate(1.0, assemble=["theta"])


def test_kernels_are_told(tmp_path, monkeypatch):
    file = tmp_path / "own.py"
    file.write_text(MODEL)
    own = pendula.Model(file)
    assert math.isnan(own.parameters["length"]) and own.units["length"] == "m"
    assert own.kernel.by in ("compiled", "jit", "interpreted") and own.kernel.file.exists()
    monkeypatch.setenv("PENDULA_KERNELS_BY", "interpreter")
    assert pendula.Model(file).kernel.by == "interpreted"


def test_kernels_do_not_take_each_others_place(tmp_path):
    """One that is loaded twice, and let go once, keeps a name that the next one would have."""
    file, other = tmp_path / "own.py", tmp_path / "other.py"
    file.write_text(MODEL)
    other.write_text(MODEL.replace("theta", "phi"))
    kept = pendula.Simulation(pendula.Model(file, length=1.0), {"theta": 0.1})
    for _ in range(3):
        assert pendula.Model(file).coordinates == ["theta"]
        assert pendula.Model(other).coordinates == ["phi"]
    assert kept.names == ["theta", "theta_dot"]


def test_what_needs_no_sympy_does_not_import_it():
    assert pendula.Model("furuta").kernel  # it is there by now
    code = (
        "import pendula, sys\n"
        "pendula.Model('furuta').coordinates\n"
        "pendula.Model('furuta').simulate(0.1)\n"
        "assert 'sympy' not in sys.modules"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_model_may_print(tmp_path):
    file = tmp_path / "talkative.py"
    file.write_text("print('hello')\n" + MODEL)
    assert pendula.Model(file).coordinates == ["theta"]
    file.write_text("print('hello')\n" + MODEL.replace("model.coordinate(", "model.koordinate("))
    with pytest.raises(pendula.InputError, match=r"koordinate") as refused:
        _ = pendula.Model(file).coordinates
    assert "requirements" not in str(refused.value) and "hello" not in str(refused.value)


@pytest.mark.parametrize("by", ["compiler", "interpreter"])
def test_ctrl_c_while_a_kernel_is_made(by, tmp_path):
    """The signal goes to this process alone, as a notebook sends it."""
    file = tmp_path / "slow.py"
    slow = MODEL.replace("length**2", "length**2 * sum(cos(k * theta) ** 2 for k in range(1, 30))")
    file.write_text(slow if by == "compiler" else "import time\ntime.sleep(30)\n" + MODEL)
    code = (
        "import pendula, sys, time\n"
        "print('begun', flush=True)\n"
        "try:\n"
        "    pendula.Model(sys.argv[1], length=1.0).simulate(1.0)\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    given = {**os.environ, "PENDULA_KERNELS_BY": by, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", code, str(file)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=given
    ) as child:
        assert child.stdout.readline() == "begun\n"
        time.sleep(1.0)
        child.send_signal(signal.SIGINT)
        begun = time.monotonic()
        assert child.stdout.readline() == "interrupted\n"
        assert time.monotonic() - begun < 25  # of 30 s where it sleeps; measured 0.05
        child.kill()
