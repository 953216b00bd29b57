"""Kernels by LLVM: they move as compiled ones do, are kept, and are taken where there is no C compiler."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pendula
import pytest
from pendula import _jit
from sympy import cos, exp, log, sin

pytest.importorskip("llvmlite")
EXAMPLES = Path(__file__).parents[2] / "examples"
LINKED = {"cart_chain", "driven_chain", "joint_springs", "rods"}


@pendula.model
def own(model, links):
    x, theta = model.coordinate("x", "m"), model.coordinate("theta", "rad")
    stiffness = model.parameter("stiffness", "N/m", default=3.0, positive=True)
    turn = model.rate(theta) * cos(theta + x) + sin(3 * x)
    model.lagrangian = (
        model.rate(x) ** 2 + model.rate(theta) ** 2 + model.rate(x) * model.rate(theta) * cos(theta)
    )
    model.lagrangian += 9.81 * cos(theta) - stiffness * (exp(x) - x) + log(2 + x**2)
    model.force(theta, -turn / 10 + model.input("torque", "N m"))


def model_of(name: str) -> pendula.Model:
    if name == "own":
        return own(inputs={"torque": 0.3})
    return pendula.Model(name, links=2 if name in LINKED else None)


@pytest.fixture
def by_each(monkeypatch):
    """by_each(work) -> what comes of it with kernels by the compiler, and by LLVM."""

    def both(work):
        found = []
        for by in ("compiler", "llvm"):
            monkeypatch.setenv("PENDULA_KERNELS_BY", by)
            found.append(work())
        return found

    return both


@pytest.mark.parametrize("name", [*pendula.models(), "own"])
@pytest.mark.parametrize("options", [{}, {"iteration": "newton"}, {"stages": 2}, {"form": "velocity"}])
def test_they_move_as_compiled_kernels_do(name, options, by_each):
    def moved():
        model = model_of(name)
        start = {q: 0.4 + 0.3 * k for k, q in enumerate(model.coordinates)} | dict.fromkeys(model.rates, 0.3)
        if model.constraints:
            if "form" in options:
                pytest.skip("constraints are for momentum form")
            start = tomllib.loads((EXAMPLES / f"{name}.toml").read_text())["start"]
        duration = 0.1 if model.constraints else 0.5  # a chain let go so parts from its neighbours at once
        run = model.simulate(duration, start=start, step=0.01, **options)
        return run.y, run.summary["kernel_by"], model.kernel

    (theirs, other, _), (ours, by, kernel) = by_each(moved)
    assert (other, by) == ("compiler", "llvm") and kernel.by == "jit" and kernel.file.suffix == ".o"
    assert np.abs(ours - theirs).max() < 1e-13 * np.abs(theirs).max()  # measured 1.3e-14, of the chain


def test_ensembles_exponents_and_derivatives(by_each):
    def found():
        model, start = own(), {"theta": 2.0, "x_dot": 0.3}
        ends = pendula.ensemble(model, 2.0, {"theta": (np.linspace(-2, 2, 50),)}, step=0.01)
        moved = pendula.differentiate(model, 1.0, start=start, step=0.01)
        exponents = pendula.lyapunov(model, 5.0, start=start, step=0.01).exponents
        by_parameters = moved.by_parameters["stiffness"][-1]
        return [np.array(ends["theta"]), moved.by_start[-1], by_parameters, exponents]

    theirs, ours = by_each(found)
    for these, those in zip(theirs, ours, strict=True):
        assert np.abs(np.subtract(these, those)).max() < 1e-13  # measured 6.2e-16


def run(code: str, tmp_path, **environment: str) -> str:
    given = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), **environment}
    given.pop("PENDULA_PYTHON", None)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=given, cwd=tmp_path, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


SWING = "import pendula, sys; swing = pendula.Model('furuta'); swing.simulate(0.1, theta=1.0); print(swing.kernel.by)\n"


def test_what_is_kept_needs_neither_sympy_nor_a_derivation(tmp_path):
    told = "pendula: derived the kernel of furuta, once; compiled by LLVM\n"
    assert run(SWING, tmp_path, PENDULA_KERNELS_BY="llvm") == "jit\n" + told
    assert run(SWING + "print('sympy' in sys.modules)", tmp_path, PENDULA_KERNELS_BY="llvm") == "jit\nFalse\n"
    (kept,) = (tmp_path / "pendula").iterdir()
    whole = kept.read_bytes()
    for damaged in (whole[: len(whole) // 2], whole.replace(b"ELF", b"FLE")):
        kept.write_bytes(damaged)
        again = run(SWING, tmp_path, PENDULA_KERNELS_BY="llvm")
        why = f"{told.rstrip()} (not loaded: {kept}: it is not what was written)\n"
        assert again == "jit\n" + why


def test_it_is_taken_where_there_is_no_compiler(tmp_path):
    (tmp_path / "empty").mkdir()
    alone = {"PATH": str(tmp_path / "empty"), "CC": "", "PENDULA_KERNELS_BY": ""}
    assert "by LLVM: no C compiler was found (CC names one)" in run(SWING, tmp_path, **alone)
    without = "import pendula._jit; pendula._jit.is_there = lambda: False\n"
    assert run(without + SWING, tmp_path, **alone).startswith("interpreted\n")
    wanted = "try: pendula.Model('furuta').kernel\nexcept pendula.InputError as error: print(error)"
    told = run(without + "import pendula\n" + wanted, tmp_path, **{**alone, "PENDULA_KERNELS_BY": "llvm"})
    assert (
        told == "model: PENDULA_KERNELS_BY: llvm is for Python with llvmlite (pip install 'pendula[jit]')\n"
    )


@pytest.mark.parametrize(
    ("found", "is_enough"), [("0.44.0", False), ("0.45.0", True), ("1.0", True), ("odd", False)]
)
def test_an_older_llvmlite_is_none(found, is_enough, monkeypatch):
    monkeypatch.setattr(_jit, "version", lambda name: found)
    assert _jit.is_there.__wrapped__() == is_enough


def test_text_that_is_none_is_told(tmp_path):
    (tmp_path / "kernel.ll").write_text("define nonsense")
    assert "expected" in _jit.compile_text(str(tmp_path / "kernel.ll"), str(tmp_path / "kernel.o"))
