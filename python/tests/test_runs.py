"""Runs of the package are those of the command line, with SciPy's names."""

import csv
import pickle
import warnings
from pathlib import Path

import numpy as np
import pendula
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENARIOS = sorted(file.name for file in EXAMPLES.glob("*.toml"))


def rows_of(file: Path) -> tuple[list[str], np.ndarray]:
    with file.open() as lines:
        header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    return header, np.array(rows, dtype=float)


# Long ones are cut: what is compared are bits, of every row that there is.
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_example_is_that_of_the_command_line(name, command_line, tmp_path):
    few = {"run.duration": 0.5, "run.estimate": False}
    words = [word for key, one in few.items() for word in ("--set", f"{key}={str(one).lower()}")]
    if "every" not in (EXAMPLES / name).read_text():
        words += ["--set", "output.every=1"]
        few["output.every"] = 1
    summary = command_line(EXAMPLES / name, tmp_path / "rows.csv", *words)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = pendula.Scenario(EXAMPLES / name, few).run()
    header, rows = rows_of(tmp_path / "rows.csv")
    assert sorted(run.columns) == sorted(header)
    assert run.t.size == len(rows) > 1
    for k, column in enumerate(header):
        assert np.array_equal(run[column], rows[:, k]), column
    ignored = ("wall_seconds", "scenario", "trajectory")
    for key, value in summary.items():
        assert key in ignored or run.summary[key] == value, key
    assert [str(one.message) for one in caught] == summary["warnings"]
    assert all(one.category is pendula.TrustWarning for one in caught)


def test_a_solution_has_scipys_names():
    double = pendula.Chain(masses=[1, 2], lengths=[1, 0.5])
    run = double.simulate(t=np.linspace(0, 2, 21), theta=[0.5, -0.2], events={"low": "y_2 + 1.49"})
    assert run.success and run.status == 0 and run.message
    assert run.y.shape == (4, 21) and np.allclose(run.t, np.linspace(0, 2, 21), atol=1e-15)
    assert np.array_equal(run.y[:2], run["theta"]) and np.array_equal(run.y[2:], run["theta_dot"])
    assert run["x"].shape == (2, 21) and run.nsteps > 0
    assert np.ptp(run.energy) < 1e-7  # measured 1.5e-9 J, of 35 J
    assert run.t_events["low"].size == run.y_events["low"].shape[0] > 0
    assert run.y_events["low"].shape[1] == 4
    data = run.to_xarray()
    assert data["theta"].attrs["units"] == "rad" and data["t"].attrs["units"] == "s"
    assert data["theta"].dims == ("t", "link") and np.array_equal(data["theta"].sel(link=2), run["theta_2"])
    assert data["energy"].dims == ("t",) and data["y"].shape == (21, 2)
    assert "taylor" in repr(run)
    with pytest.raises(KeyError, match="thetas: expected one of t, theta_1"):
        run["thetas"]


def test_a_solution_is_known_at_any_time():
    run = pendula.Chain(masses=[1, 2]).simulate(2.0, theta=[0.5, -0.2])
    assert np.abs(run.sol(run.t[::-1]) - run.y[:, ::-1]).max() < 1e-12  # measured 0
    fine = pendula.Chain(masses=[1, 2]).simulate(t=[0, 0.7, 2], theta=[0.5, -0.2], accuracy=1e-12)
    assert np.abs(run.sol(0.7) - fine.y[:, 1]).max() < 1e-8  # measured 1.2e-10
    assert run.sol([0.7, 0.7]).shape == (4, 2) and run.nfev >= run.nsteps > 0
    stopped = pendula.Chain(links=1).simulate(
        5.0, theta=0.5, step=0.1, events={"low": {"when": "theta_1", "stop": True}}
    )
    assert abs(stopped.sol(stopped.t[-1])[0]) < 1e-6
    for wrong in (2.5, -0.1, [[0.1]], float("nan"), "0.1"):
        with pytest.raises(pendula.InputError, match="t: expected"):
            run.sol(wrong)


def test_a_motion_is_known_beyond_its_rows():
    chain = pendula.Chain(masses=[1, 2])
    run = chain.simulate(10.0, t=[1, 2], theta=[0.5, -0.2])
    whole = chain.simulate(10.0, theta=[0.5, -0.2])
    assert np.abs(run.sol([0.0, 1.0, 9.9]) - whole.sol([0.0, 1.0, 9.9])).max() < 1e-8  # measured 0
    assert np.abs(run.sol(2.0) - run.y[:, list(run.t).index(2.0)]).max() < 1e-12
    with pytest.raises(pendula.InputError, match=r"t: expected times from 0\.0 to 10\.0 s"):
        run.sol(10.1)


# Of chains and of models: the time, coordinates, rates, and what else there is.
@pytest.mark.parametrize(
    "system",
    [pendula.Chain(links=2), pendula.Model("cart_chain", links=2), pendula.Chain(links=2, space="spatial")],
)
def test_columns_have_one_order(system):
    start = {name: 0.1 for name in system.start_names() if "dot" not in name and name[:2] != "p_"}
    run, simulation = system.simulate(0.1, start=start), pendula.Simulation(system, start)
    first = ["t", *system.coordinates, *system.rates]
    assert run.columns[: len(first)] == first and run.names == simulation.names == first[1:]
    assert simulation.columns == run.columns and run.units[1] == system.units[first[1]]


def test_links_of_a_model_are_a_dimension():
    data = pendula.Model("cart_chain", links=2).simulate(0.1, theta=0.1).to_xarray()
    assert data["theta"].dims == ("t", "link") and data["x"].dims == ("t",) and data.sizes["link"] == 2


def test_what_an_extra_brings_is_named(monkeypatch):
    run = pendula.Chain(links=1).simulate(0.1, theta=0.1)
    for module, extra, work in (
        ("xarray", "data", run.to_xarray),
        ("matplotlib.pyplot", "pictures", run.plot),
        ("matplotlib.pyplot", "pictures", run.animate),
    ):
        with monkeypatch.context() as without:
            without.setitem(__import__("sys").modules, module, None)
            with pytest.raises(
                ImportError, match=rf'expected {module}, which pip install "pendula\[{extra}\]"'
            ):
                work()


def test_a_run_is_a_mapping_by_names():
    run = pendula.Chain(links=2).simulate(0.1, theta=1.0)
    assert list(run) == run.columns and "theta_1" in run and "theta" in run
    assert "foo" not in run and 0 not in run
    for name in ("foo", 0):
        with pytest.raises(KeyError, match=f"{name}: expected one of t, theta_1, "):
            run[name]


def test_what_changes_energy_makes_no_error():
    chain = {"masses": [1, 1]}
    free = pendula.Chain(**chain).simulate(1.0, theta=1.0)
    damped = pendula.Chain(**chain, damping=0.1).simulate(1.0, theta=1.0)
    pushed = pendula.Chain(**chain).simulate(1.0, theta=1.0, inputs={"torque_1": ([0, 1], [0, 1])})
    held = pendula.Model("cart_chain", inputs={"push": 2.0}).simulate(1.0, theta=1.0)
    assert ", energy error " in repr(free)
    for run in (damped, pushed, held):
        assert ", energy change " in repr(run)


def test_columns_of_a_model_have_their_names():
    run = pendula.Model("furuta").simulate(0.5)
    assert run.y.shape[0] == 4 and run["energy"].shape == run.t.shape


def test_own_columns_are_expressions():
    double = pendula.Chain(links=2)
    run = double.simulate(1.0, theta=1.0, columns={"height": "2 - cos(theta_1) - cos(theta_2)"})
    assert np.abs(run["height"] - (2 - np.cos(run["theta"]).sum(axis=0))).max() < 1e-14  # measured 2.2e-16
    assert "height" in run.to_xarray()
    with pytest.raises(
        pendula.InputError, match=r"^columns.height: .*unknown name .thet_1. \(did you mean theta_1"
    ):
        double.simulate(1.0, theta=1.0, columns={"height": "thet_1"})


def test_an_event_may_end_a_run():
    run = pendula.Chain(links=1).simulate(10.0, theta=0.5, events={"low": {"when": "theta_1", "stop": True}})
    assert run.status == 1 and run.success and "low" in run.message
    assert abs(run.t[-1] - run.t_events["low"][0]) < 1e-15
    assert abs(run["theta_1"][-1]) < 1e-12  # measured 1.9e-16


def test_a_run_that_fails_keeps_its_rows():
    stiff = pendula.Chain(links=2, damping=[1e9, 1e9])
    with pytest.raises(pendula.RunFailed) as failed:
        stiff.simulate(1.0, theta=[1, 2], theta_dot=[1e3, -1e3], method="rk4", step=0.01)
    partial = failed.value.partial
    assert not partial.success and partial.status == -1 and partial.t.size >= 1
    assert str(failed.value) == partial.message


def test_doubts_are_warnings():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pendula.Chain(links=3).simulate(30.0, theta=2.5, step=0.02, stages=2, tolerance=1e-9)
    told = [str(one.message) for one in caught]
    assert "tolerance: has no effect with step" in told
    assert any("cannot be trusted" in sentence for sentence in told)
    assert all(one.category is pendula.TrustWarning for one in caught)
    assert all(one.filename == __file__ for one in caught)


REFUSED = [
    ({"theta": [1, 2, 3]}, "start.theta: expected .* got \\[1, 2, 3\\]"),
    ({"theta": "90 miles"}, "start.theta"),
    ({"theta": float("nan")}, "start.theta: expected a finite number.* got nan"),
    ({"theta": [0.1, float("inf")]}, "start.theta"),
    ({"thet": 1.0}, "unknown keyword thet.*did you mean theta"),
    ({"theta": 1.0, "step": -1.0}, "^step: expected"),
    ({"theta": 1.0, "method": "euler"}, '^method: expected .* got "euler"'),
    ({"theta": 1.0, "stages": 99}, "^stages: expected"),
    ({"theta": 1.0, "tolerance": -1.0}, "^tolerance: expected"),
    ({"theta": 1.0, "events": {"a": "foo + 1"}}, '^events.a.when: .*unknown name "foo"'),
    ({"theta": 1.0, "events": {"a": {"direction": "up"}}}, "when"),
    ({"theta": 1.0, "every": 0}, "^every: expected"),
    ({}, "start.theta: expected"),
]


@pytest.mark.parametrize(("given", "message"), REFUSED)
def test_wrong_arguments_are_named(given, message):
    with pytest.raises(pendula.InputError, match=message) as refused:
        pendula.Chain(links=2).simulate(1.0, **given)
    assert isinstance(refused.value, ValueError)
    assert not str(refused.value).startswith("pendula:")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pendula.Chain(masses=[1, -1]).simulate(1.0, theta=0), "^masses.*: expected"),
        (lambda: pendula.Chain(masses=[1, 1], lengths=[1, 1, 1]).simulate(1.0, theta=0), "^lengths"),
        (lambda: pendula.Chain(space="plane").simulate(1.0, theta=0), "^space: expected"),
        (
            lambda: pendula.Chain(drives=[{"link": 3}], links=2).simulate(1.0, theta=0),
            r"^drives\[0\].link: expected",
        ),
        (lambda: pendula.Model("no_such_model").simulate(1.0), "^model: expected"),
        (lambda: pendula.Model("no_such_file.py").simulate(1.0), "^model: expected"),
        (lambda: pendula.Model("furuta", nothing=1.0).simulate(1.0), "nothing"),
        (lambda: pendula.Chain(links=1).simulate(-1.0, theta=0), "^duration: expected"),
        (lambda: pendula.Chain(links=1).simulate(t=[0, 2, 1], theta=0), r"^t\[2\]: expected"),
    ],
)
def test_wrong_systems_are_named(make, message):
    with pytest.raises(pendula.InputError, match=message):
        make()


@pytest.mark.parametrize(
    "given",
    [
        {"start": {"theta": 1.0, "theta_dot = 5.0 #": 0.0}},
        {"start": {"theta = 1.0\n[[event]]\nname='z'\nwhen='t-.5'\n#": 3}},
        {"theta": 1.0, "events": {"a": {"when": "t", "stop = true\n#": 1}}},
        {"start": {"theta": 1.0, "": 1.0}},
        {"start": {"theta": 1.0, "θ": 1.0}},
        {"start": {"theta": 1.0, "a b": 1.0}},
        {"start": {"theta": 1.0}, "theta": 2.0},
        {"theta": 1.0, "accuracy": 0.0},
        {"theta": 1.0, "events": {"a": 5}},
        {"theta": 1.0, "events": ["theta_1"]},
        {"start": [1.0]},
        {"theta": "\U0001f600"},
    ],
)
def test_keys_are_keys(given):
    with pytest.raises(pendula.InputError, match=r"expected .* got |given twice|unknown key"):
        pendula.Chain(links=2).simulate(1.0, **given)


def test_arrays_are_kept_as_they_were():
    masses = np.ones(2)
    chain = pendula.Chain(masses=masses)
    before = chain.simulate(1.0, theta=0.5).y
    masses[1] = 100
    run = chain.simulate(1.0, theta=0.5)
    assert np.array_equal(run.y, before)
    for array in (run.t, run.y, run.energy, run["theta_1"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 7
    with pytest.raises(pendula.InputError, match="set: expected a key"):
        pendula.Scenario("a.toml", {"run.step=0.1\n#": 0.01})


def test_units_are_those_of_the_numbers():
    run = pendula.Chain(links=1, units="natural").simulate(1.0, theta=0.5)
    assert run.units[0] != "s" and run.units[run.columns.index("x_1")] != "m"
    assert run.units[run.columns.index("theta_1")] == "rad"


def test_failures_can_be_pickled():
    failed = pickle.loads(pickle.dumps(pendula.RunFailed("no", None)))
    assert str(failed) == "no" and failed.partial is None


def test_what_is_no_value_is_named():
    with pytest.raises(pendula.InputError, match=r"start\.theta: expected a number, .* got complex"):
        pendula.Chain(links=1).simulate(1.0, theta=1j)
    with pytest.raises(TypeError, match="duration= or t=, got neither"):
        pendula.Chain(links=1).simulate(theta=1.0)
    with pytest.raises(ValueError, match=r"t: expected a vector of times, got an array of shape \(1, 2\)"):
        pendula.Chain(links=1).simulate(t=[[0, 1]], theta=1.0)
