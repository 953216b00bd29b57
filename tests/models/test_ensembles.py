"""Ensembles of models: members in the lanes of a register, and those that have to go alone."""

import h5py
import numpy as np
import pytest

AXIS = '\n[[ensemble.axis]]\nkey = "{}"\nfrom = {}\nto = {}\ncount = 9\n'
SCENARIOS = {
    "atwood": '[system]\nmodel = "swinging_atwood"\nparameters = { mu = 2.5 }\n[start]\nr = 1.0\ntheta = 1.5\n'
    + "[run]\nduration = 2.0\ntolerance = 1e-7\n"
    + '[ensemble]\nkeep = ["final", "energy_error", "steps"]\n'
    + AXIS.format("start.theta", 0.5, 2.5)
    + AXIS.format("system.parameters.mu", 1.5, 3.5),
    "furuta": '[system]\nmodel = "furuta"\nparameters = { arm_friction = 0.01, rod_friction = 0.0005 }\n'
    + '[[system.drive]]\ninput = "torque"\namplitude = 0.5\nfrequency = 6.0\n'
    + "[start]\nalpha = 0.1\ntheta = 1.0\n[run]\nduration = 2.0\ntolerance = 1e-7\n"
    + '[ensemble]\nkeep = ["final", "energy_error", "steps"]\n'
    + AXIS.format("start.theta", 0.5, 2.5)
    + AXIS.format("start.alpha_dot", -1, 1),
}

ALONE = '--set=run.iteration="newton"'  # which no lanes have


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(text, *arguments) -> the data sets of the ensemble."""

    def move(text, *arguments) -> dict[str, np.ndarray]:
        (tmp_path / "ensemble.toml").write_text(text)
        (tmp_path / "out.h5").unlink(missing_ok=True)
        ended = pendula("ensemble", tmp_path / "ensemble.toml", "-o", tmp_path / "out.h5", *arguments)
        assert ended.returncode == 0, ended.stderr
        with h5py.File(tmp_path / "out.h5") as file:
            return {name: data[()] for name, data in file.items() if data.dtype.kind in "fiu"}

    return move


# Largest differences seen: 4e-6 of Atwood's machine, 5e-5 of rates of 12 rad/s that are shaken.
@pytest.mark.parametrize("name", SCENARIOS)
def test_members_in_lanes_end_where_others_do(name, moved):
    text = SCENARIOS[name]
    alone = moved(text, ALONE)
    lanes = moved(text.replace("[ensemble]", '[ensemble]\nmethod = "auto"'))
    asked = moved(text, '--set=run.method="taylor"', "--set=run.tolerance=1e-9")
    assert not (alone["steps"] == lanes["steps"]).all()  # so they went by another method
    for key in alone.keys() - {"steps"}:
        if (name, key) != ("furuta", "energy_error"):  # a drive's, as seen at other times
            assert np.abs(lanes[key] - alone[key]).max() < 2e-4, key
        assert (lanes[key] == asked[key]).all(), key


# Gauss steps of one size to rounding, which the motion makes more of: seen 9e-14 and 3.9e-12; chosen ones to the
# tolerance: 4.8e-8 and 2.4e-5.
@pytest.mark.parametrize("name", SCENARIOS)
def test_gauss_steps_in_lanes_are_those_of_others(name, moved):
    text = SCENARIOS[name]
    for steps, most in (
        (["--set=run.step=0.002", "--set=run.stages=4"], 3e-11),
        (['--set=run.method="gauss"'], 2e-4),
    ):
        alone, lanes = moved(text, ALONE, *steps), moved(text, *steps)
        for key in alone.keys() - {"steps", "energy_error"}:
            assert np.abs(lanes[key] - alone[key]).max() < most, key


def test_long_runs_of_models_stay_in_lanes(moved):
    """As long as they keep the energy: more than 2000 steps."""
    text = SCENARIOS["atwood"].replace("mu = 2.5", "mu = 3.0").replace("duration = 2.0", "duration = 200.0")
    text = text[: text.rindex("\n[[ensemble.axis]]")].replace("to = 2.5", "to = 1.5")  # regular ones
    alone = moved(text, '--set=run.method="gauss"')
    lanes = moved(text.replace("[ensemble]", '[ensemble]\nmethod = "auto"'))
    assert (lanes["steps"] > 2000).all()  # measured 2503 at least
    assert not (alone["steps"] == lanes["steps"]).any()
    assert lanes["energy_error"].max() < 3e-8  # measured 3.6e-9
    assert np.abs(lanes["theta"] - alone["theta"]).max() < 3e-4  # measured 3e-5


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("keep", ['"final", "energy_error", "steps"', '"ftle", "megno"'])
def test_a_member_depends_on_itself_alone(name, keep, moved):
    text = SCENARIOS[name].replace("[ensemble]", '[ensemble]\nmethod = "auto"')
    text = text.replace('"final", "energy_error", "steps"', keep)
    together = moved(text)
    divided = moved(text, "--threads", "2")
    one = moved(text.replace("count = 9", "count = 1"))
    for name_of, numbers in together.items():
        assert (numbers == divided[name_of]).all(), name_of
        if numbers.ndim == 2:
            assert numbers[0, 0] == one[name_of][0, 0], name_of


def test_tangents_in_lanes_grow_alike_by_all_methods(moved):
    """They begin alike, and have grown alike where steps are short; "run" is what `pendula lyapunov` tells."""
    text = SCENARIOS["furuta"].replace('"final", "energy_error", "steps"', '"ftle"')
    explicit = moved(text, '--set=run.method="fehlberg78"', "--set=run.tolerance=1e-12")["ftle"]
    steps = ["--set=run.step=0.002", "--set=run.stages=4"]
    gauss = moved(text.replace("[ensemble]", '[ensemble]\nmethod = "auto"'), *steps)["ftle"]
    assert np.abs(gauss - explicit).max() < 2e-8  # measured 2.4e-9 of 3.5 1/s
    assert np.abs(moved(text, *steps)["ftle"] - explicit).max() > 1e-3  # another tangent


# Exponents by tangents in lanes and by Gauss steps, of runs too short to tell much. Largest differences seen: 0.3 of
# their common errors; of members at random over 100 s, 1.3 (tests of loaded chains have true values).
@pytest.mark.parametrize("name", SCENARIOS)
def test_exponents_in_lanes_are_those_of_gauss_steps(name, moved):
    text = SCENARIOS[name].replace('"final", "energy_error", "steps"', '"lyapunov", "ftle", "megno"')
    text = text.replace("duration = 2.0", "duration = 10.0")
    alone = moved(text)
    automatic = text.replace("[ensemble]", '[ensemble]\nmethod = "auto"')
    lanes = moved(automatic)
    divided = moved(automatic, "--threads", "2")
    for key in lanes:
        assert (lanes[key] == divided[key]).all(), key
    assert not (alone["lyapunov"] == lanes["lyapunov"]).any()  # so they went another way
    error = np.hypot(alone["lyapunov_error"], lanes["lyapunov_error"])
    assert (np.abs(alone["lyapunov"] - lanes["lyapunov"]) < 2 * error).all()


def test_who_takes_long_there_goes_as_the_scenario_says(moved):
    """A series is tried for 20,000 steps at most."""
    text = SCENARIOS["atwood"].replace("mu = 2.5", "mu = 3.0")
    text = text[: text.index("\n[[ensemble.axis]]")] + AXIS.format("run.duration", 200.0, 2000.0)
    alone = moved(text, '--set=run.method="gauss"')
    tried = moved(text.replace("[ensemble]", '[ensemble]\nmethod = "auto"'))
    same = alone["steps"] == tried["steps"]
    assert same.any() and not same.all()
    for key in alone:
        assert (alone[key][same] == tried[key][same]).all(), key
    assert (tried["energy_error"][~same] < 1e-7).all()


HEAVY = """
def define(model, links):
    x = model.coordinate("x", "m")
    from sympy import exp
    model.lagrangian = (1 + exp(-100 * (x - 1.5) ** 2)) * model.rate(x) ** 2 / 2
"""


@pytest.mark.parametrize("method", ["taylor", "gauss"])
def test_momenta_become_rates_by_the_mass_at_each_start(moved, tmp_path, method):
    """A mass that is 1 but about x = 1.5, where it is 2."""
    (tmp_path / "heavy.py").write_text(HEAVY)
    ends = moved(
        f'[system]\nmodel = "heavy.py"\n[run]\nmethod = "{method}"\nduration = 1e-9\ntolerance = 1e-9\n'
        '[[ensemble.list]]\nkey = "start.x"\nvalues = [0.0, 1.5]\n'
        '[[ensemble.list]]\nkey = "start.p_x"\nvalues = [1.0, 1.0]\n'
    )
    # measured 0; 0.5 by the mass of another start
    assert np.abs(ends["x_dot"] - [1.0, 0.5]).max() < 1e-7
