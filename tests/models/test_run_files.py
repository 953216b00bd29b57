"""Runs of models that go on from their run files."""

from itertools import product

import h5py
import numpy as np
import pytest
from conftest import EXAMPLES, ROOT


def bits(file):
    with h5py.File(file) as run:
        return {name: data[...].tobytes() for name, data in run.items() if name not in ("run", "events")}


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *product(("cart_chain", "driven_chain", "furuta", "swinging_atwood"), ("gauss", "dopri5")),
        ("four_bar", "gauss"),
        ("peaucellier", "gauss"),
    ],
)
def test_a_run_goes_on_as_if_it_had_never_stopped(name, method, pendula, tmp_path):
    # By an accuracy, the tolerance depends on how long a run is.
    method = ["--set", f"run.method={method}", "--set", "run.tolerance=1e-9", "--quiet"]
    method += ["--set", "run.accuracy="] * (name == "cart_chain")
    scenario = EXAMPLES / f"{name}.toml"
    whole = ["simulate", scenario, *method, "-o", "whole.h5"]
    part = ["simulate", scenario, *method, "-o", "part.h5", "--set", "run.duration=0.777"]
    for run in (whole, part):
        assert pendula(*run, cwd=tmp_path).returncode == 0
    with h5py.File(tmp_path / "whole.h5") as whole:
        end = whole["t"][-1]
    for duration in [*np.random.default_rng(11).uniform(0.777, end, 5).cumsum(), end]:
        if duration <= end:
            resumed = pendula(
                "simulate", "--resume", "part.h5", "--set", f"run.duration={duration}", cwd=tmp_path
            )
            assert resumed.returncode == 0, resumed.stderr
    assert bits(tmp_path / "whole.h5") == bits(tmp_path / "part.h5")


def test_units_are_those_of_the_model(pendula, tmp_path):
    assert pendula("simulate", EXAMPLES / "cart_chain.toml", "-o", "run.h5", cwd=tmp_path).returncode == 0
    with h5py.File(tmp_path / "run.h5") as run:
        units = {name: run[name].attrs["units"] for name in run if name not in ("run", "events")}
        assert units["x"] == "m" and units["x_dot"] == "m/s" and units["theta_dot_1"] == "rad/s"
        assert "define(model, links)" in run["run/model"].asstr()[()]


def test_a_model_that_has_changed_is_refused(pendula, tmp_path):
    model, scenario = tmp_path / "cart_chain.py", tmp_path / "cart.toml"
    text = (ROOT / "codegen/pendula_codegen/models/cart_chain.py").read_text()
    model.write_text(text)
    run = (EXAMPLES / "cart_chain.toml").read_text()
    scenario.write_text(run.replace('"cart_chain"', '"cart_chain.py"'))
    assert pendula("simulate", scenario, "-o", "run.h5", cwd=tmp_path).returncode == 0
    model.write_text(text + "# not the same any more\n")
    ended = pendula("simulate", "--resume", "run.h5", cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.endswith("system.model: the model is no longer the one that the run began with\n")
    model.unlink()
    ended = pendula("simulate", "--resume", "run.h5", cwd=tmp_path)
    assert ended.returncode == 2 and "cart_chain.py" in ended.stderr
