"""Feedback: inputs that follow from the motion, continuous and sampled."""

import json

import h5py
import numpy as np
import pytest

GAINS = {"x": 1.0, "theta_1": -65.0, "x_dot": 3.0, "theta_dot_1": -19.0}
LAW = "x - 65*(theta_1 - pi) + 3*x_dot - 19*theta_dot_1"
UPRIGHT = """
[system]
model = "cart_chain"
links = 1
parameters = {{ cart_mass = 2.0, masses = 0.5 }}
{more}
[start]
x = 0.1
theta_1 = 3.0
[run]
duration = 3.0
{run}
[output]
interval = 0.05
"""


def feedback(value: str = LAW, **more: object) -> str:
    keys = "".join(
        f"{key} = {json.dumps(one)}\n" for key, one in {"input": "push", "value": value, **more}.items()
    )
    return f"[[system.feedback]]\n{keys}"


@pytest.fixture
def written(tmp_path):
    """written(table, run) -> a scenario's file."""

    def write(table: str, run: str = "", text: str = UPRIGHT):
        file = tmp_path / "upright.toml"
        file.write_text(text.format(more=table, run=run))
        return file

    return write


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(scenario, *arguments) -> rows as columns."""

    def run(scenario, *arguments) -> dict[str, np.ndarray]:
        file = tmp_path / "rows.csv"
        ended = pendula("simulate", scenario, "--quiet", "-o", file, *arguments)
        assert ended.returncode == 0, ended.stderr
        assert ended.stderr == ""
        return read(file)

    return run


def read(file) -> dict[str, np.ndarray]:
    names, *rows = (line.split(",") for line in file.read_text().splitlines())
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def fed_back(rows: dict[str, np.ndarray]) -> np.ndarray:
    return rows["x"] - 65 * (rows["theta_1"] - np.pi) + 3 * rows["x_dot"] - 19 * rows["theta_dot_1"]


FED_MODEL = """
from sympy import Rational, cos, pi, sin


def define(model, links):
    x = model.coordinate("x", "m")
    theta = model.coordinate("theta_1", "rad")
    g = model.parameter("gravity", "m/s^2", default=9.81)
    vx, w = model.rate(x), model.rate(theta)
    kinetic = vx**2 + Rational(1, 4) * ((vx + cos(theta) * w) ** 2 + (sin(theta) * w) ** 2)
    model.lagrangian = kinetic + Rational(1, 2) * g * cos(theta)
    model.force(x, x - 65 * (theta - pi) + 3 * vx - 19 * w)
"""


def test_continuous_feedback_is_a_force_of_the_model(written, moved, tmp_path):
    fed = moved(written(feedback()))
    (tmp_path / "fed.py").write_text(FED_MODEL)
    own = tmp_path / "own.toml"
    text = UPRIGHT.format(more="", run="").replace("cart_chain", "fed.py").replace("links = 1\n", "")
    own.write_text("\n".join(line for line in text.splitlines() if not line.startswith("parameters")))
    same = moved(own)
    for name in ("x", "theta_1", "x_dot", "theta_dot_1"):
        assert np.abs(fed[name] - same[name]).max() < 1e-11  # measured 4e-14
    assert abs(fed["theta_1"][-1] - np.pi) < 0.1  # it stands; it would fall within a second
    assert np.abs(fed["push"] - fed_back(fed)).max() < 1e-12  # measured 0


def test_the_kernel_with_feedback_is_checked(written, pendula):
    ended = pendula(
        "check", written(feedback("40*(theta_1 - pi) - 2*bob_1_x^2 + sin(t)*exp(-x_dot/3) + sqrt(1 + x^2)"))
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


FREE = """
def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2
    model.force(x, model.input("push", "N"))
"""
EVERYTHING = (
    "-x^2 - (x_dot - 3 - t)/(2 + cos(t)^3) + tan(x/3)*asin(sin(t)/2) - acos(x/9) + atan(x_dot)*2^-t"
    " + sinh(x/5) - cosh(t/4) + tanh(x_dot)*exp(-x) - log(2 + t)/sqrt(5 + x) - -x^3/7"
)


def test_force_and_column_say_the_same(tmp_path, moved):
    """The generator has the force, the program the column: the rate grows by the integral of the column."""
    (tmp_path / "free.py").write_text(FREE)
    file = tmp_path / "free.toml"
    file.write_text(
        f'[system]\nmodel = "free.py"\n{feedback(EVERYTHING)}[start]\nx = 0.3\nx_dot = 0.2\n'
        "[run]\nduration = 1.0\ntolerance = 1e-13\n[output]\ninterval = 0.01\n"
    )
    rows = moved(file)
    push = rows["push"]
    simpson = 0.01 / 3 * (push[0] + push[-1] + 4 * push[1::2].sum() + 2 * push[2:-1:2].sum())
    assert np.abs(push).max() > 1
    assert abs(rows["x_dot"][-1] - rows["x_dot"][0] - simpson) < 1e-7  # measured 8e-9


def test_the_linear_system_has_it(written, pendula):
    def linear(table: str) -> dict:
        ended = pendula("linearize", written(table), "--json", "--set", "start.theta_1=3.141592653589793")
        assert ended.returncode == 0, ended.stderr
        return json.loads(ended.stdout)

    plain, fed = linear(""), linear(feedback())
    gains = np.array([[GAINS[name] for name in plain["names"]]])
    closed = np.array(plain["A"]) + np.array(plain["B"]) @ gains
    assert np.abs(closed - fed["A"]).max() < 1e-12  # measured 4e-15
    assert max(value[0] for value in fed["eigenvalues"]) < 0 < max(value[0] for value in plain["eigenvalues"])


def test_sampled_feedback_is_held_from_sample_to_sample(written, moved):
    rows = moved(written(feedback(sample=0.1, limit="0.005 kN")))
    said = np.clip(fed_back(rows), -5, 5)
    at_samples = slice(0, None, 2)
    assert np.abs(rows["push"] - said)[at_samples].max() < 1e-12  # measured 3e-15
    between = slice(1, None, 2)
    assert np.array_equal(rows["push"][between], rows["push"][at_samples][: len(rows["push"][between])])
    assert np.abs(rows["push"]).max() == 5.0
    assert np.abs(rows["push"] - said)[between].max() > 0.1


def test_many_samples_are_continuous_feedback(written, moved):
    """The input is late by half a sample, so that differences go with the sample time."""
    true = moved(written(feedback()))
    apart = []
    for sample in (0.01, 0.005):
        rows = moved(written(feedback(sample=sample)))
        apart.append(np.abs(rows["theta_1"] - true["theta_1"]).max())
    assert apart[0] / apart[1] == pytest.approx(2, rel=0.05)  # measured 2.02


@pytest.mark.parametrize(
    "run", ['method = "dopri5"', 'method = "radau"', "step = 0.01\nstages = 4", 'method = "rk4"']
)
def test_every_method_samples_alike(written, moved, run):
    """Steps of 0.01 divide samples; those of rk4 do not reach the digits of the others."""
    table = feedback(sample=0.05)
    true = moved(written(table))
    rows = moved(written(table, run))
    assert np.abs(rows["x"] - true["x"]).max() < 1e-7  # measured up to 7e-10
    assert np.array_equal(rows["t"], true["t"])


def test_a_run_goes_on_to_the_bit(written, pendula, moved, tmp_path):
    scenario = written(feedback(sample=0.07))
    whole = moved(scenario)
    part = tmp_path / "part.h5"
    for ended in (
        pendula("simulate", scenario, "--quiet", "-o", part, "--set=run.duration=1.0"),
        pendula("simulate", "--resume", part, "--quiet", "--set=run.duration=3.0"),
    ):
        assert ended.returncode == 0, ended.stderr
    with h5py.File(part) as file:
        for name in ("t", "x", "theta_1", "push"):
            assert np.array_equal(file[name][...], whole[name])


def test_members_of_ensembles_have_it(written, pendula, moved, tmp_path):
    for number, table in enumerate((feedback(), feedback(sample=0.05))):
        ensemble = '[ensemble]\n[[ensemble.list]]\nkey = "start.x"\nvalues = [0.1, 0.2]\n'
        scenario = written(table, text=UPRIGHT + ensemble)
        file = tmp_path / f"ends_{number}.h5"
        ended = pendula("ensemble", scenario, "-o", file)
        assert ended.returncode == 0, ended.stderr
        rows = moved(written(table))
        with h5py.File(file) as ends:
            assert abs(ends["x"][0] - rows["x"][-1]) < 1e-8  # measured 1e-14


CHAIN = """
[chain]
space = "{space}"
masses = [1.0, 0.5]
lengths = 1.0
[[chain.feedback]]
input = "{input}"
value = "-0.8*{rate}"
sample = 0.001
[start]
theta = [1.0, 0.5]
{phi}
[run]
duration = 2.0
[output]
interval = 0.1
"""


def test_torques_on_links_of_a_chain(moved, tmp_path):
    """A torque −λ θ̇ on the first link is its damping."""
    file = tmp_path / "chain.toml"
    file.write_text(CHAIN.format(space="planar", input="torque_1", rate="theta_dot_1", phi=""))
    fed = moved(file)
    held = tmp_path / "damped.toml"
    text = file.read_text()
    held.write_text(
        text[: text.index("[[")].rstrip() + "\ndamping = [0.8, 0.0]\n" + text[text.index("[start]") :]
    )
    true = moved(held)
    assert np.abs(fed["theta_1"] - true["theta_1"]).max() < 1e-3  # measured 1.8e-4: half a sample late
    assert (
        np.abs(fed["torque_1"] + 0.8 * fed["theta_dot_1"]).max() < 1e-12
    )  # measured 5e-16: rows are at samples


def test_torques_in_space(moved, tmp_path):
    file = tmp_path / "chain.toml"
    file.write_text(CHAIN.format(space="spatial", input="torque_z_2", rate="phi_dot_2", phi="phi_dot = 1.0"))
    rows = moved(file)
    assert np.abs(rows["torque_z_2"] + 0.8 * rows["phi_dot_2"]).max() < 1e-12  # measured 6e-17
    assert rows["energy"][-1] < rows["energy"][0]


@pytest.mark.parametrize(
    ("space", "torque", "rate", "phi"),
    [("planar", "torque_2", "theta_dot_2", ""), ("spatial", "torque_z_2", "phi_dot_2", "phi_dot = 1.0")],
)
def test_a_page_of_a_chain_has_its_torques(pendula, tmp_path, space, torque, rate, phi):
    file, page = tmp_path / "chain.toml", tmp_path / "chain.html"
    file.write_text(CHAIN.format(space=space, input=torque, rate=rate, phi=phi))
    ended = pendula("simulate", file, "--quiet", "--view", page, "--copies", "1")
    assert ended.returncode == 0, ended.stderr
    assert f'"{torque}"' in page.read_text()


def test_rows_at_samples_have_what_is_held_from_there_on(moved, tmp_path):
    """The third sample of 0.1 s is at 0.30000000000000004 s, the sixth at 0.6000000000000001 s."""
    file = tmp_path / "chain.toml"
    text = CHAIN.format(space="planar", input="torque_1", rate="theta_dot_1", phi="")
    text = text.replace("sample = 0.001", "sample = 0.1").replace("duration = 2.0", "duration = 0.6")
    file.write_text(text.replace("interval = 0.1", "times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]"))
    rows = moved(file)
    # measured 0; 0.46 where it is held from before
    assert np.abs(rows["torque_1"] + 0.8 * rows["theta_dot_1"]).max() < 1e-12


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (feedback(input="pull"), 'feedback[1].input: expected an input: push; got "pull"'),
        (feedback("40*thetta_1"), 'got the unknown name "thetta_1" (did you mean theta_1?)'),
        (feedback("2*push"), 'got the unknown name "push"'),
        (feedback("energy"), 'got the unknown name "energy"'),
        (feedback("abs(x)"), "expected smooth functions in continuous feedback"),
        (feedback("x > 0 ? 1 : 2"), "expected smooth functions in continuous feedback"),
        (feedback(limit=3.0), "feedback[1].limit: expected sample beside it"),
        (feedback(sample=0.1, limit="5 m"), "feedback[1].limit: expected"),
        (feedback(sample=0.0), "feedback[1].sample: expected a finite number > 0"),
        (feedback("x +", sample=0.1), "expected a number, a name or a parenthesis before its end"),
        (feedback(sample=0.1) + '[[event]]\nname = "e"\nwhen = "push"\n', "inputs that have feedback"),
    ],
)
def test_what_is_wrong_is_told(written, pendula, table, message):
    ended = pendula("simulate", written(table), "--quiet")
    assert ended.returncode == 2
    assert message in ended.stderr


def test_what_jumps_has_no_derivatives(written, pendula):
    scenario = written(feedback(sample=0.1))
    for arguments in (
        ["linearize", scenario],
        ["linearize", scenario, "--step", "0.1"],
        ["lyapunov", scenario],
    ):
        ended = pendula(*arguments)
        assert ended.returncode == 2, ended.stdout
        assert "feedback[1].value: expected a continuous one, got one with sample" in ended.stderr


def test_a_law_without_a_value_ends_the_run(written, pendula, tmp_path):
    file = tmp_path / "rows.csv"
    ended = pendula("simulate", written(feedback("log(0.5 - t)", sample=0.1)), "--quiet", "-o", file)
    assert ended.returncode == 1
    assert "at t = 0.5 s: a value became infinite or NaN" in ended.stderr
    assert read(file)["t"][-1] == 0.45
