"""Exported systems, built as somebody does who has nothing of pendula. PENDULA_PROGRAM names the program."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
CONSUMER = Path(__file__).parent / "consumer"
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror")
COMPILER = next((name for name in ("gcc", "clang") if shutil.which(name)), None)
# A cart with a pendulum that rubs and runs against a bumper.
BUMPER = """
from sympy import Piecewise, cos, sign, sin


def define(model, links):
    x, theta = model.coordinate("x", "m"), model.coordinate("theta", "rad")
    stiffness = model.parameter("stiffness", "N/m", default=500.0)
    rub = model.parameter("rub", "N", default=0.2)
    v, w = model.rate(x), model.rate(theta)
    beyond = x - 0.2
    contact = Piecewise((stiffness * beyond**2 / 2, beyond > 0), (0, True))
    model.lagrangian = v**2 + v * w * cos(theta) + w**2 / 2 + 9.81 * cos(theta) - contact
    model.force(x, model.input("push", "N") - rub * sign(v))
    model.point("cart", (x, 0))
    model.point("bob", (x + sin(theta), -cos(theta)))
"""


@pytest.fixture(scope="session")
def environment(tmp_path_factory) -> dict[str, str]:
    kept = os.environ.get("XDG_CACHE_HOME") or str(tmp_path_factory.mktemp("cache"))
    return {**os.environ, "XDG_CACHE_HOME": kept}


@pytest.fixture(scope="session")
def pendula(environment):
    """pendula(*arguments, cwd=…) -> the finished process."""

    def run(*arguments, cwd=None) -> subprocess.CompletedProcess:
        return subprocess.run(
            [os.environ["PENDULA_PROGRAM"], *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=cwd,
            env=environment,
            timeout=300,
        )

    return run


@pytest.fixture(scope="session")
def export(pendula):
    """export(folder, what, *options) -> the folder, with the C files of `what`, which is called system."""

    def run(folder: Path, what, *options, language: str = "c") -> Path:
        ended = pendula("export", what, "--as", language, "--name", "system", "-o", folder, *options)
        assert ended.returncode == 0, ended.stderr
        assert ended.stdout.splitlines()[:2] == [f"{folder}/system.h", f"{folder}/system.c"]
        return folder

    return run


def consumer(folder: Path, number: str = "double", *flags: str, main: str = "main.c") -> Path:
    """A program that stands on the exported sources alone, in a folder of its own."""
    program = folder / "consumer"
    assert COMPILER, "expected gcc or clang"
    names = [f"-D{name}" for name in ("SYSTEM=system", 'HEADER="system.h"', f"NUMBER={number}")]
    files = [CONSUMER / main, folder / "system.c"]
    subprocess.run(
        [COMPILER, *FLAGS, "-O1", *flags, *names, f"-I{folder}", *files, "-o", program, "-lm"], check=True
    )
    return program


def numbers(program: Path, steps: int, h: float, *moved) -> dict[str, list[float]]:
    """What the consumer prints; `moved`: what is another number, which of them, by how much."""
    command = [program, str(steps), repr(h), *map(str, moved)]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    lines = (line.split() for line in ended.stdout.splitlines())
    return {name: [*map(float, values)] for name, *values in lines}
