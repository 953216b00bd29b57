"""Taylor series of models: ends, rows within steps, events, drives and damping, against Gauss steps."""

import json

import h5py
import numpy as np
import pytest
from conftest import EXAMPLES as EXAMPLE_FILES
from conftest import ROOT

EXAMPLES = (
    "cart_chain",
    "furuta",
    "joint_springs",
    "rods",
    "spring_pendulum",
    "swinging_atwood",
    "driven_chain",
)


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(scenario, *settings) -> rows as columns, and the summary."""

    def run(scenario, *settings) -> tuple[dict[str, np.ndarray], dict]:
        file = tmp_path / "rows.csv"
        keys = [f"--set={key}" for key in settings]
        ended = pendula("simulate", f"examples/{scenario}.toml", "--json", "-o", file, *keys, cwd=ROOT)
        assert ended.returncode == 0, ended.stderr
        names, *rows = (line.split(",") for line in file.read_text().splitlines())
        columns = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
        return columns, json.loads(ended.stdout)

    return run


def apart(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> float:
    assert np.array_equal(a["t"], b["t"])
    return max(np.abs(a[name] - b[name]).max() / max(1.0, np.abs(b[name]).max()) for name in a)


def run(method: str, tolerance: float) -> str:
    return f'run={{duration=2.0, method="{method}", tolerance={tolerance}, estimate=false}}'


@pytest.mark.parametrize("example", EXAMPLES)
def test_series_go_where_gauss_steps_go(example, moved):
    """Rows lie within steps: dense output is as good as steps are."""
    true, _ = moved(example, run("gauss", 1e-14), "output.interval=0.1")
    rows, summary = moved(example, run("taylor", 1e-13), "output.interval=0.1")
    assert apart(rows, true) < 1e-10  # measured 1e-12
    assert summary["method"] == "taylor" and summary["steps"] > 2


DRIVEN = """
[system]
model = "driven.py"
[[system.drive]]
input = "push"
constant = 0.3
amplitude = 2.0
frequency = 7.0
phase = 0.5
[[system.drive]]
input = "push"
amplitude = 0.5
frequency = 40.0
[start]
x = 0.2
x_dot = -0.1
"""
DRIVEN_MODEL = """
def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2
    model.force(x, model.input("push", "N"))
"""


@pytest.fixture
def driven(pendula, tmp_path):
    """driven(text) -> rows of the model, every 0.1 s."""
    (tmp_path / "driven.py").write_text(DRIVEN_MODEL)

    def run(text: str) -> dict[str, np.ndarray]:
        (tmp_path / "driven.toml").write_text(text)
        file = tmp_path / "rows.csv"
        ended = pendula("simulate", tmp_path / "driven.toml", "--quiet", "-o", file)
        assert ended.returncode == 0 and not ended.stderr, ended.stderr
        names, *rows = (line.split(",") for line in file.read_text().splitlines())
        return dict(zip(names, np.array(rows, dtype=float).T, strict=True))

    return run


def test_drives_have_series_of_their_own(driven):
    """A spring that sines push, against its closed form."""
    rows = driven(
        DRIVEN + '[run]\nduration = 10.0\nmethod = "taylor"\ntolerance = 1e-14\n[output]\ninterval = 0.1\n'
    )
    t, x, v = rows["t"], 0.2 - 0.3, -0.1
    found = np.full_like(t, 0.3)
    for amplitude, frequency, phase in ((2.0, 7.0, 0.5), (0.5, 40.0, 0.0)):
        swing = amplitude / (1 - frequency**2)
        found += swing * np.sin(frequency * t + phase)
        x -= swing * np.sin(phase)
        v -= swing * frequency * np.cos(phase)
    found += x * np.cos(t) + v * np.sin(t)
    assert np.abs(rows["x"] - found).max() < 1e-12  # measured 6e-15


def test_a_run_goes_on_to_the_bit(pendula, moved, tmp_path):
    long = 'run={duration=4.0, method="taylor", tolerance=1e-12}'
    whole, _ = moved("furuta", long, "output.interval=0.1")
    part = tmp_path / "part.h5"
    for ended in (
        pendula(
            "simulate",
            EXAMPLE_FILES / "furuta.toml",
            "--quiet",
            "-o",
            part,
            "--set",
            long.replace("4.0", "1.5"),
            "--set=output.interval=0.1",
        ),
        pendula("simulate", "--resume", part, "--quiet", "--set=run.duration=4.0"),
    ):
        assert ended.returncode == 0, ended.stderr
    with h5py.File(part) as file:
        for name in ("t", "alpha", "theta", "alpha_dot", "theta_dot"):
            assert np.array_equal(file[name][...], whole[name])


def test_steps_of_an_equilibrium_are_as_long_as_the_run(moved):
    still = "start={}"
    rows, summary = moved("cart_chain", 'run={duration=50.0, method="taylor"}', still, "system.drive=[]")
    assert summary["steps"] == 1
    assert np.abs(rows["x"]).max() == 0


def test_energy_drifts_by_rounding_alone(moved):
    """Ten thousand swings: rounding of steps adds up like steps of a walk."""
    _, summary = moved(
        "swinging_atwood", 'run={duration=5000.0, method="taylor", tolerance=1e-16, estimate=false}'
    )
    assert summary["energy_error_max"] < 1e-12  # measured 9e-15


def test_events_are_found_within_steps(pendula, tmp_path):
    """Of a spring that nothing pushes: zeros of a cosine."""
    (tmp_path / "driven.py").write_text(DRIVEN_MODEL)
    (tmp_path / "driven.toml").write_text(
        '[system]\nmodel = "driven.py"\n[start]\nx = 1.0\n[run]\nduration = 100.0\nmethod = "taylor"\n'
        'tolerance = 1e-15\n[[event]]\nname = "zero"\nwhen = "x"\n'
    )
    ended = pendula("simulate", tmp_path / "driven.toml", "--json")
    assert ended.returncode == 0, ended.stderr
    (zero,) = json.loads(ended.stdout)["events"]
    assert zero["count"] == 32
    assert abs(zero["first"] - np.pi / 2) < 1e-14  # measured 7e-16
    assert abs(zero["last"] - 31.5 * np.pi) < 1e-12  # measured 2e-14


BESIDE = """
[chain]
space = "planar"
masses = [1.0, 1.0]
lengths = 1.0
damping = 0.1
[start]
theta = {theta}
[run]
method = "taylor"
tolerance = 1e-9
duration = 10.0
estimate = false
"""


@pytest.mark.parametrize(
    ("theta", "most"),
    [
        ("[3.141592653589793, 0.0]", 100),
        ("[1e-150, 0.0]", 10),
    ],  # measured 29 and 1; 19357, and none at all, before
)
def test_rounding_beside_an_equilibrium_takes_no_steps(pendula, tmp_path, theta, most):
    file = tmp_path / "beside.toml"
    file.write_text(BESIDE.format(theta=theta))
    ended = pendula("simulate", file, "--json")
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["steps"] <= most
