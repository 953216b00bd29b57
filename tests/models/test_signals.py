"""Inputs from measured numbers, drives that are expressions of time, and motions that somebody prescribes."""

import json

import h5py
import numpy as np
import pytest

FREE = """
def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2
    model.force(x, model.input("push", "N"))
"""
SCENARIO = """
[system]
model = "free.py"
{tables}
[start]
x = 0.3
[run]
duration = 2.0
{run}
[output]
interval = 0.05
"""
KNOTS = np.array([[0.1, 0.0], [0.25, 2.0], [0.7, -1.0], [0.7001, 3.0], [1.6, 0.5]])


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(tables, run, *arguments, model=…) -> rows as columns."""

    def run(tables: str, run: str = "", *arguments: str, model: str = FREE) -> dict[str, np.ndarray]:
        (tmp_path / "free.py").write_text(model)
        scenario, file = tmp_path / "free.toml", tmp_path / "rows.csv"
        scenario.write_text(SCENARIO.format(tables=tables, run=run))
        ended = pendula("simulate", scenario, "--quiet", "-o", file, *arguments)
        assert ended.returncode == 0, ended.stderr
        names, *rows = (line.split(",") for line in file.read_text().splitlines())
        return dict(zip(names, np.array(rows, dtype=float).T, strict=True))

    return run


def signal(folder, rows=KNOTS, **keys: object) -> str:
    lines = "".join(f"{t!r}, {push!r}\r\n" for t, push in rows.tolist())
    (folder / "push.csv").write_text(f"t, push\r\n{lines}\n")
    table = {"input": "push", "file": "push.csv", **keys}
    return "[[system.signal]]\n" + "".join(f"{key} = {json.dumps(one)}\n" for key, one in table.items())


def moments(times: np.ndarray, at: np.ndarray, is_held: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Of unit mass that a table pushes: rates and ways, by integrals of its pieces."""
    knots = np.unique([0.0, *times[:, 0], 2.0])
    value = np.interp(knots, *times.T)
    if is_held:
        value = times[np.maximum(np.searchsorted(times[:, 0], knots, side="right") - 1, 0), 1]
    rates, ways = [], []
    for end in at:
        v = x = 0.0
        for k in range(len(knots) - 1):
            h = min(end, knots[k + 1]) - knots[k]
            if h <= 0:
                break
            slope = 0 if is_held else (value[k + 1] - value[k]) / (knots[k + 1] - knots[k])
            x += v * h + value[k] * h**2 / 2 + slope * h**3 / 6
            v += value[k] * h + slope * h**2 / 2
        rates.append(v)
        ways.append(x)
    return np.array(rates), np.array(ways)


@pytest.mark.parametrize("is_held", [False, True])
@pytest.mark.parametrize("run", ["", 'method = "radau"', 'method = "dopri5"', "step = 0.03\nstages = 2"])
def test_a_table_pushes(moved, tmp_path, run, is_held):
    """Between knots steps are exact: a step of 0.03 s over the jump at 0.7 s would err by 1e-2."""
    rows = moved(signal(tmp_path, hold=is_held), run)
    rates, ways = moments(KNOTS, rows["t"], is_held)
    assert np.abs(rows["x_dot"] - rates).max() < 1e-12  # measured 1.3e-15
    assert np.abs(rows["x"] - 0.3 - ways).max() < 1e-12  # measured 1.8e-15
    if not is_held:
        assert np.abs(rows["push"] - np.interp(rows["t"], *KNOTS.T)).max() < 1e-13  # measured 0


def test_arrays_are_tables(moved, tmp_path):
    table = f'[[system.signal]]\ninput = "push"\ntimes = {KNOTS[:, 0].tolist()}\nvalues = {KNOTS[:, 1].tolist()}\n'
    by_file, by_arrays = moved(signal(tmp_path)), moved(table)
    assert all(np.array_equal(by_file[name], by_arrays[name]) for name in by_file)


def test_a_column_may_have_another_name(moved, tmp_path):
    named = moved(signal(tmp_path))
    table = signal(tmp_path, column="force")
    (tmp_path / "push.csv").write_text((tmp_path / "push.csv").read_text().replace("push", '"force"'))
    assert np.array_equal(moved(table)["x"], named["x"])


def test_a_run_with_a_table_goes_on_to_the_bit(moved, pendula, tmp_path):
    """Without its file: a run file has the numbers."""
    whole = moved(signal(tmp_path), "tolerance = 1e-10")
    part = tmp_path / "part.h5"
    for ended in (
        pendula("simulate", tmp_path / "free.toml", "--quiet", "-o", part, "--set=run.duration=0.5"),
        pendula("simulate", "--resume", part, "--quiet", "--set=run.duration=2.0"),
    ):
        assert ended.returncode == 0, ended.stderr
        (tmp_path / "push.csv").unlink(missing_ok=True)
    with h5py.File(part) as file:
        for name in ("t", "x", "x_dot", "push"):
            assert np.array_equal(file[name][...], whole[name])


def test_the_summary_names_signals(moved, pendula, tmp_path):
    moved(signal(tmp_path))
    ended = pendula("simulate", tmp_path / "free.toml", "--json")
    assert json.loads(ended.stdout)["signals"] == ["push"]


CHAIN = """
[chain]
space = "{space}"
masses = [1.0, 0.5]
lengths = 1.0
{table}
[start]
theta = [1.0, 0.5]
[run]
duration = 2.0
tolerance = 1e-12
[output]
interval = 0.1
"""


@pytest.mark.parametrize(
    ("space", "link", "input_"), [("planar", 1, "torque_1"), ("spatial", 2, "torque_y_2")]
)
def test_torques_on_links_of_a_chain(pendula, tmp_path, space, link, input_):
    """A sine in 4000 pieces against a drive: they differ by a ten millionth."""
    times = np.linspace(0, 2, 4001)
    numbers = f"times = {times.tolist()}\nvalues = {(2 * np.sin(3 * times)).tolist()}\n"
    amplitude = "2.0" if space == "planar" else "[0, 2.0, 0]"
    tables = {
        "signal": f'[[chain.signal]]\ninput = "{input_}"\n{numbers}',
        "drive": f"[[chain.drive]]\nlink = {link}\namplitude = {amplitude}\nfrequency = 3\n",
    }
    rows = {}
    for name, table in tables.items():
        file = tmp_path / f"{name}.toml"
        file.write_text(CHAIN.format(space=space, table=table))
        ended = pendula("simulate", file, "--quiet", "-o", tmp_path / f"{name}.h5")
        assert ended.returncode == 0, ended.stderr
        with h5py.File(tmp_path / f"{name}.h5") as found:
            rows[name] = found["theta"][...]
    assert np.abs(rows["signal"] - rows["drive"]).max() < 1e-6  # measured 1.1e-7


@pytest.mark.parametrize(
    ("keys", "text", "message"),
    [
        ({}, "t,push\n0,1\n0,2\n", "push.csv:3: t: expected a time after 0, got 0"),
        ({}, "t,push\n0,1\n1,x\n", 'push.csv:3: push: expected a finite number, got "x"'),
        ({}, "t,push\n0,1\n1\n", "push.csv:3: expected 2 numbers, as the first line has names, got 1"),
        (
            {},
            "t,pusch\n0,1\n",
            "push.csv:1: expected the column push in the first line, got t, pusch (did you mean pusch?)",
        ),
        ({}, "t,push\n", "push.csv: expected names in the first line, and rows; got none"),
        (
            {"file": "none.csv"},
            "",
            "none.csv: expected a CSV file that can be read, got: No such file or directory",
        ),
        ({"times": [0, 1]}, "t,push\n0,1\n", "signal[1].times: expected nothing beside file"),
        (
            {"input": "pull", "column": "push"},
            "t,push\n0,1\n",
            'signal[1].input: expected an input: push; got "pull"',
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_told(pendula, tmp_path, keys, text, message):
    (tmp_path / "free.py").write_text(FREE)
    scenario = tmp_path / "free.toml"
    scenario.write_text(SCENARIO.format(tables=signal(tmp_path, **keys), run=""))
    (tmp_path / "push.csv").write_text(text)
    ended = pendula("simulate", scenario, "--quiet")
    assert ended.returncode == 2
    assert message in ended.stderr


def test_what_cannot_have_tables_says_so(moved, pendula, tmp_path):
    moved(signal(tmp_path))
    ended = pendula("export", tmp_path / "free.toml", "--as", "c", "-o", tmp_path / "out")
    assert ended.returncode == 2
    assert "signal[1].input: export: expected no signal in what is exported" in ended.stderr
    assert "--set system.signal= (of a chain chain.signal=) leaves it out" in ended.stderr


def drive(value: str, input_: str = "push") -> str:
    return f'[[system.drive]]\ninput = "{input_}"\nvalue = "{value}"\n'


def test_a_drive_steps_ramps_and_pulses(moved):
    """A pulse of a millisecond is not stepped over."""
    value = "(t < 1 ? 0.5 : 0) + (t > 0.5 ? min(t - 0.5, 0.2) : 0) + (t > 1.7 && t < 1.701 ? 100 : 0)"
    rows = moved(drive(value))
    t = rows["t"]

    def rise(begin: float, end: float) -> np.ndarray:
        """Of a push of one from begin to end."""
        return np.clip(t, begin, end) - begin

    rates = 0.5 * rise(0, 1) + rise(0.5, 0.7) ** 2 / 2 + 0.2 * rise(0.7, 2) + 100 * rise(1.7, 1.701)
    assert np.abs(rows["x_dot"] - rates).max() < 1e-12  # measured 2.2e-14


def test_a_drive_may_repeat(moved):
    """A square wave of 20 Hz."""
    rows = moved(drive("sin(40*pi*t) > 0 ? 3 : -1"))
    half = np.floor(rows["t"] / 0.025 + 1e-9)
    on = (half + half % 2) / 2 * 0.025 + np.where(half % 2 == 0, rows["t"] - half * 0.025, 0)
    assert np.abs(rows["x_dot"] - (4 * on - rows["t"])).max() < 1e-12  # measured 2.9e-15


def test_a_smooth_drive_is_a_force_of_the_model(moved):
    rows = moved(drive("exp(-t) + t^2"))
    assert (
        np.abs(rows["x_dot"] - (1 - np.exp(-rows["t"]) + rows["t"] ** 3 / 3)).max() < 1e-12
    )  # measured 4.4e-16
    assert np.abs(rows["push"] - (np.exp(-rows["t"]) + rows["t"] ** 2)).max() < 1e-14  # measured 0


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (drive("x"), 'drive[1].value: expected an expression in t, pi, got the unknown name "x"'),
        (drive("floor(t)"), "drive[1].value: expected functions that are smooth between pieces in drives"),
        (drive("t", "pull"), "drive[1].input: expected an input of the model: push; got pull"),
        (drive("t +"), "drive[1].value: expected an expression such as"),
    ],
)
def test_what_is_wrong_with_a_drive_is_told(pendula, tmp_path, table, message):
    (tmp_path / "free.py").write_text(FREE)
    scenario = tmp_path / "free.toml"
    scenario.write_text(SCENARIO.format(tables=table, run=""))
    ended = pendula("simulate", scenario, "--quiet")
    assert ended.returncode == 2
    assert message in ended.stderr


HANGING = """
from sympy import cos, sin


def define(model, links):
    theta = model.coordinate("x", "rad")  # the scenarios here call it x
    pivot = model.motion("pivot", "m")
    x, y = pivot + sin(theta), -cos(theta)
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - 9.81 * y
    model.point("pivot_at", (pivot, 0), kind="pivot")
    model.force(theta, model.input("push", "N m"))
"""
WRITTEN_OUT = HANGING.replace('model.motion("pivot", "m")', "sin(3 * model.time) / 5")


def test_a_motion_is_prescribed(moved):
    """As a pivot that the Lagrangian shakes itself."""
    same = moved("", model=WRITTEN_OUT)
    rows = moved(drive("0.2*sin(3*t)", "pivot"), model=HANGING)
    for name in ("x", "x_dot", "pivot_at_x"):
        assert np.abs(rows[name] - same[name]).max() < 1e-12  # measured 3.3e-16
    assert np.abs(rows["pivot"] - 0.2 * np.sin(3 * rows["t"])).max() < 1e-15  # measured 0


def test_a_motion_may_change_its_acceleration_at_once(moved):
    """From rest to a speed that stays: what an observer who moves along sees is a swing that begins there."""
    value = "t < 0.5 ? t^2 : t - 0.25"
    rows = moved(drive(value, "pivot"), model=HANGING)
    later = rows["t"] > 0.6
    energy = (rows["x_dot"] ** 2 / 2 - 9.81 * np.cos(rows["x"]))[later]
    assert np.ptp(energy) < 1e-8  # measured 3.4e-10


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("t < 1 ? 0 : 1", "drive[1].value: "),
        ("theta", 'drive[1].value: expected an expression in t, pi, got the unknown name "theta"'),
    ],
)
def test_a_motion_that_jumps_is_told(pendula, tmp_path, value, message):
    (tmp_path / "free.py").write_text(HANGING)
    scenario = tmp_path / "free.toml"
    scenario.write_text(SCENARIO.format(tables=drive(value, "pivot"), run=""))
    ended = pendula("simulate", scenario)
    assert ended.returncode == 2
    assert message in ended.stderr
    assert ended.stderr.count("\n") == 1  # nothing is said to be derived before
