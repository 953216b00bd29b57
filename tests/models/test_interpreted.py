"""Models without a compiler: their kernels are interpreted, and move as compiled ones do."""

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import EXAMPLES
from test_documentation import blocks
from test_forcing import MODEL as FORCED
from test_forcing import SHARP

INTERPRETED = {"PENDULA_KERNELS_BY": "interpreter"}
OWN = {"forced": FORCED, "sharp": SHARP, "sprung": blocks("python")[0]}
MODELS = [
    *[(name, None) for name in ("furuta", "spring_pendulum", "swinging_atwood", "forced", "sharp")],
    *[(name, 2) for name in ("cart_chain", "driven_chain", "rods", "joint_springs", "sprung")],
]
SCENARIO = """
[system]
model = "furuta"
[start]
theta = 2.0
alpha_dot = 1.0
[run]
duration = 3.0
"""
MEMBERS = """
[[ensemble.axis]]
key = "start.theta"
from = 0.5
to = 2.5
count = 19
[ensemble]
keep = ["final", "energy_error"]
"""


@pytest.mark.parametrize(("model", "links"), MODELS)
def test_they_compute_what_models_say(model, links, pendula, tmp_path):
    if model in OWN:
        (tmp_path / f"{model}.py").write_text(OWN[model])
        model = tmp_path / f"{model}.py"
    ended = pendula("check", model, *([] if links is None else ["--links", links]), **INTERPRETED)
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(scenario, by, *options) -> the summary."""

    def run(text: str, by: str, *options: str) -> dict:
        scenario = tmp_path / "run.toml"
        scenario.write_text(text)
        ended = pendula("simulate", scenario, "--json", *options, PENDULA_KERNELS_BY=by)
        assert ended.returncode == 0, ended.stderr
        return json.loads(ended.stdout)

    return run


METHODS = {
    "default": "",
    "2 stages": "stages = 2",
    "3 stages": "stages = 3",
    "velocity form": 'form = "velocity"',
    "radau": 'method = "radau"',
    "newton": 'iteration = "newton"',
    "dopri5": 'method = "dopri5"',
}


def test_the_summary_says_what_ran(pendula, tmp_path, moved):
    for by in ("compiler", "interpreter"):
        assert moved(SCENARIO, by)["kernel_by"] == by
    scenario = tmp_path / "run.toml"
    solvers = {
        by: re.search("solver .*", pendula("simulate", scenario, PENDULA_KERNELS_BY=by).stdout)[0]
        for by in ("compiler", "interpreter")
    }
    assert solvers["compiler"].endswith("kernel furuta")
    assert solvers["interpreter"] == solvers["compiler"] + ", interpreted"


def test_a_build_says_it(pendula):
    for by, said in (("compiler", "compiled"), ("interpreter", "interpreted")):
        assert pendula("build", "furuta", PENDULA_KERNELS_BY=by).stdout.splitlines()[1] == said


@pytest.mark.parametrize("method", METHODS)
def test_they_move_as_compiled_kernels_do(method, moved):
    text = SCENARIO + METHODS[method]
    ends = [moved(text, by)["final"] for by in ("compiler", "interpreter")]
    for of in ("q", "v"):
        theirs, ours = ([*end[of].values()] for end in ends)
        assert ours == pytest.approx(theirs, abs=1e-8)  # measured 3.2e-10, asked for 1e-9


def test_ensembles_and_exponents(pendula, tmp_path):
    scenario = tmp_path / "run.toml"
    scenario.write_text(SCENARIO + MEMBERS)
    ends = {}
    for by in ("compiler", "interpreter"):
        file = tmp_path / f"{by}.h5"
        ended = pendula("ensemble", scenario, "-o", file, PENDULA_KERNELS_BY=by)
        assert ended.returncode == 0, ended.stderr
        with h5py.File(file) as kept:
            ends[by] = np.array([kept[name] for name in ("alpha", "theta", "alpha_dot", "theta_dot")])
    assert np.abs(ends["interpreter"] - ends["compiler"]).max() < 1e-8  # measured 2.2e-13
    scenario.write_text(SCENARIO)
    exponents = [
        json.loads(pendula("lyapunov", scenario, "--json", PENDULA_KERNELS_BY=by).stdout)["exponents"]
        for by in ("compiler", "interpreter")
    ]
    assert exponents[1] == pytest.approx(exponents[0], abs=1e-8)  # measured 4e-12


def without_compiler(tmp_path: Path) -> str:
    """A PATH with nothing in it."""
    (tmp_path / "empty").mkdir(exist_ok=True)
    return str(tmp_path / "empty")


def test_a_machine_without_a_compiler(pendula, tmp_path):
    """It is told once, and again where a compiler was asked for."""
    alone = {"PATH": without_compiler(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache"), "CC": ""}
    scenario = EXAMPLES / "spring_pendulum.toml"
    first = pendula("simulate", scenario, "--set=run.duration=0.1", **alone)
    assert first.returncode == 0
    told = "pendula: derived the kernel of spring_pendulum, once; interpreted: no C compiler was found (CC names one)"
    assert first.stderr.splitlines()[0] == told
    assert pendula("simulate", scenario, "--set=run.duration=0.1", **alone).stderr == ""
    refused = pendula("build", "spring_pendulum", PENDULA_KERNELS_BY="compiler", **alone)
    assert refused.returncode == 2
    assert refused.stderr == "pendula: models take a C compiler, got no cc, gcc or clang (CC names one)\n"


def test_both_are_kept(pendula, tmp_path):
    cache = str(tmp_path / "cache")
    made = [
        pendula("build", "spring_pendulum", XDG_CACHE_HOME=cache, PENDULA_KERNELS_BY=by).stderr
        for by in ("auto", "interpreter", "auto", "interpreter")
    ]
    assert "; compiled by " in made[0] and made[1].endswith("; interpreted\n") and made[2:] == ["", ""]
    assert sorted(file.suffix for file in (tmp_path / "cache/pendula").iterdir()) == [".program", ".so"]


@pytest.mark.parametrize("damage", ["cut", "flipped", "unsealed"])
def test_a_program_that_is_not_what_was_written_is_made_anew(damage, pendula, tmp_path):
    cache = tmp_path / "cache"
    given = {"XDG_CACHE_HOME": str(cache), **INTERPRETED}
    pendula("build", "spring_pendulum", **given)
    (program,) = (cache / "pendula").iterdir()
    whole = program.read_bytes()
    damaged = {
        "cut": whole[: len(whole) // 2],
        "flipped": whole.replace(b"\tmultiply", b"\tmultiplx").replace(b"add", b"adb", 1),
        "unsealed": whole[: whole.rindex(b"pendula kernel")],
    }
    assert damaged[damage] != whole
    program.write_bytes(damaged[damage])
    assert "derived the kernel of spring_pendulum" in pendula("build", "spring_pendulum", **given).stderr
    assert program.read_bytes() == whole


def test_llvm_is_for_python_alone(pendula):
    ended = pendula("build", "spring_pendulum", PENDULA_KERNELS_BY="llvm")
    assert ended.returncode == 2
    told = "pendula: PENDULA_KERNELS_BY: llvm is for Python with llvmlite (pip install 'pendula[jit]')\n"
    assert ended.stderr == told


def test_what_nobody_runs_kernels_by_is_refused(pendula):
    ended = pendula("build", "spring_pendulum", PENDULA_KERNELS_BY="magic")
    assert ended.returncode == 2
    assert (
        ended.stderr
        == "pendula: PENDULA_KERNELS_BY: expected compiler, llvm, interpreter or auto, got magic\n"
    )
