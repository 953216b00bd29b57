"""A model that is wrong gets one message with file and line, exit status 2, and nothing half-written."""

import os
import time
from pathlib import Path

import pytest

HEAD = """from sympy import *
two = lambda model: [model.coordinate(name, 'm') for name in 'xy']

def define(model, links):
"""

WRONG = {
    "undeclared symbol": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = model.rate(x)**2 / 2 - Symbol('k') * x**2\n",
        "wrong.py:6: lagrangian holds the symbol 'k', which the model does not declare",
    ),
    "another symbol of the same name": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = model.rate(x)**2 / 2 - Symbol('x')**2\n",
        "wrong.py:6: lagrangian holds a symbol 'x' that is not the model's own, a coordinate",
    ),
    "no kinetic energy": (
        "    x, y = two(model)\n    model.lagrangian = model.rate(x)**2 - y**2\n",
        "wrong.py:6: lagrangian: the coordinate y has no kinetic energy: its rate y_dot does not stand in it",
    ),
    "rate in a point": (
        "    x = model.coordinate('x', 'm')\n    model.point('bob', (model.rate(x), 0))\n",
        "wrong.py:6: point bob holds 'x_dot', the rate of x, which may not stand in it",
    ),
    "singular everywhere": (
        "    x, y = two(model)\n    model.lagrangian = (model.rate(x) + model.rate(y))**2\n",
        "wrong.py:6: lagrangian: its mass matrix is singular everywhere",
    ),
    "rates to the fourth": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = model.rate(x)**4\n",
        "wrong.py:6: lagrangian: expected powers of the rates up to 2, got others of x_dot",
    ),
    "no SymPy value": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = 'x'\n",
        "wrong.py:6: lagrangian: expected a SymPy expression, got str 'x'",
    ),
    "exception": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = model.rate(x)**2 / 2\n    links / 0\n",
        "wrong.py:7: ZeroDivisionError: division by zero",
    ),
    "exit": ("    import sys\n    sys.exit(0)\n", "wrong.py:6: expected a model that lets Python go on"),
    "syntax error": ("    x = = 1\n", "wrong.py:5: invalid syntax"),
    "input in the Lagrangian": (
        "    x, f = two(model)[0], model.input('f', 'N')\n    model.lagrangian = model.rate(x)**2 / 2 + f * x\n",
        "wrong.py:6: lagrangian: the input f may stand in forces only: model.force(q, f)",
    ),
    "name twice": (
        "    x = model.coordinate('x', 'm')\n    model.parameter('x', 'm')\n",
        "wrong.py:6: expected a new name, got 'x', which is a coordinate already",
    ),
    "keyword of C++": (
        "    x = model.coordinate('double', 'm')\n",
        "wrong.py:5: expected a name that no programming language uses, got 'double'",
    ),
    "no Lagrangian": (
        "    x = model.coordinate('x', 'm')\n",
        "wrong.py: expected model.lagrangian to be set",
    ),
    "no coordinate": ("    pass\n", "wrong.py: expected a coordinate: model.coordinate(name, unit)"),
    "misspelt": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangean = x\n",
        "wrong.py:6: model.lagrangean: expected lagrangian or dissipation, which can be set",
    ),
    "function that no kernel has": (
        "    x = model.coordinate('x', 'm')\n    model.lagrangian = model.rate(x)**2 / 2 - gamma(x)\n",
        "a kernel cannot evaluate",
    ),
    "no define": ("    pass\n", "wrong.py: expected a function define(model, links), got none"),
}


@pytest.mark.parametrize("name", WRONG)
def test_it_is_told_in_one_line(name, pendula, tmp_path):
    body, expected = WRONG[name]
    text = HEAD + body
    if name == "no define":
        text = text.replace("define", "describe")
    (tmp_path / "wrong.py").write_text(text)
    cache = tmp_path / "cache"
    ended = pendula("build", "wrong.py", cwd=tmp_path, XDG_CACHE_HOME=str(cache))
    assert ended.returncode == 2
    *_, line = ended.stderr.splitlines()
    assert expected in line and line.startswith("pendula: ")
    assert "Traceback" not in ended.stderr
    assert list((cache / "pendula").iterdir()) == []
    assert ended.stdout == ""


@pytest.mark.parametrize("name", ["sympy", "mpmath", "pendula_codegen", "runpy", "argparse", "usercustomize"])
def test_modules_of_the_working_folder_are_not_run(name, pendula, tmp_path):
    """Nor those of PYTHONPATH: whoever unpacks somebody's files and works beside them has not asked for it."""
    (tmp_path / f"{name}.py").write_text("raise SystemExit('it ran')\n")
    body, expected = WRONG["no kinetic energy"]
    (tmp_path / "wrong.py").write_text(HEAD + body)
    ended = pendula("build", "wrong.py", cwd=tmp_path, XDG_CACHE_HOME=str(tmp_path), PYTHONPATH=str(tmp_path))
    assert ended.returncode == 2
    assert "it ran" not in ended.stderr and expected in ended.stderr


def test_a_model_that_is_no_file_is_told_at_once(pendula, tmp_path):
    os.mkfifo(tmp_path / "pipe.py")
    (tmp_path / "zero.py").symlink_to("/dev/zero")
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "long.py").touch()
    os.truncate(tmp_path / "long.py", 2**34)
    for name, reason in {
        "pipe.py": "neither a file nor a link to one",
        "zero.py": "neither a file nor a link to one",
        "folder.py": "neither a file nor a link to one",
        "long.py": "more than 16 MiB",
        "none.py": "No such file or directory",
    }.items():
        ended = pendula("build", name, cwd=tmp_path)
        assert ended.stderr == f"pendula: expected a model file that can be read, got {name}: {reason}\n"
        assert ended.returncode == 2


def scenario(tmp_path, text):
    file = tmp_path / "run.toml"
    file.write_text(text)
    return file


SWINGING = '[system]\nmodel = "spring_pendulum"\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            '[system]\nmodel = "cubic"\n',
            "run.toml:2: system.model: expected a model file ending in .py, or a built-in",
        ),
        (
            '[system]\nmodel = "gone.py"\n',
            "run.toml:2: system.model: expected a model file that can be read, got ",
        ),
        ("[system]\n", "run.toml:1: system.model: expected a model file, or the name of a built-in model"),
        (SWINGING + "[chain]\n", "run.toml:3: chain: expected no [chain] beside [system]"),
        (SWINGING + "parameters = { stifness = 3 }\n", "(did you mean stiffness?)"),
        (SWINGING + "parameters = { mass = -1 }\n", "mass: expected a finite number > 0, got -1"),
        (SWINGING + "[start]\nr = 1\n", "run.toml:4: start.r: expected one of"),
        (
            SWINGING + '[[system.drive]]\ninput = "push"\n',
            "expected no constant and no amplitude, since the model has no inputs",
        ),
        (
            SWINGING + "[start]\nx = 1\nx_dot = 1\np_y = 1\n",
            "start.x_dot: expected no rates beside the momenta",
        ),
    ],
)
def test_a_wrong_scenario_is_told_by_file_and_line(text, expected, pendula, tmp_path):
    ended = pendula("simulate", scenario(tmp_path, text))
    assert ended.returncode == 2
    assert expected in ended.stderr.splitlines()[-1]


def test_missing_tools_are_named(pendula, tmp_path):
    no_python = pendula("build", "furuta", XDG_CACHE_HOME=str(tmp_path), PENDULA_PYTHON="/none/python3")
    assert no_python.returncode == 2
    assert "models take a Python with the packages of" in no_python.stderr.splitlines()[-1]
    no_compiler = pendula("build", "furuta", XDG_CACHE_HOME=str(tmp_path), CC="/none/cc")
    assert no_compiler.returncode == 2
    assert "models take a C compiler; /none/cc: " in no_compiler.stderr.splitlines()[-1]
    assert list((tmp_path / "pendula").iterdir()) == []


def test_a_singular_start_names_the_coordinate(pendula, tmp_path):
    text = '[system]\nmodel = "swinging_atwood"\n[start]\nr = 0.0\ntheta = 1.0\n[run]\nduration = 1.0\n'
    ended = pendula("simulate", scenario(tmp_path, text))
    assert ended.returncode == 2
    expected = "start: expected coordinates where the mass matrix is not singular, got no inertia in theta"
    assert ended.stderr.splitlines()[-1].endswith(f"run.toml:3: {expected}")


def test_a_second_run_starts_at_once(pendula, tmp_path):
    """Nothing is derived or compiled again: neither tool is needed."""
    assert pendula("build", "spring_pendulum").returncode == 0
    kept = pendula("build", "spring_pendulum")
    assert kept.stderr == "" and "kept in" in kept.stdout


def test_a_kernel_that_is_no_longer_used_goes(pendula, tmp_path):
    assert pendula("build", "spring_pendulum").returncode == 0
    kernel = Path(pendula("build", "spring_pendulum").stdout.split("kept in")[1].strip())
    forgotten, recent = kernel.with_name("forgotten-0.so"), kernel.with_name("recent-0.so")
    for file, days in {forgotten: 91, recent: 30, kernel: 91}.items():
        file.touch()
        os.utime(file, times=(time.time() - days * 24 * 3600,) * 2)
    assert pendula("build", "spring_pendulum").returncode == 0
    assert kernel.exists() and recent.exists() and not forgotten.exists()
    recent.unlink()


def test_flags_of_the_user_reach_the_compiler(pendula, tmp_path):
    wrong = pendula("build", "furuta", XDG_CACHE_HOME=str(tmp_path), CFLAGS="-O1  -fno-such-flag")
    assert wrong.returncode == 2
    assert "-fno-such-flag" in wrong.stderr.splitlines()[-1]
