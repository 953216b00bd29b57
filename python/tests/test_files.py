"""Run files of the package are those of the program, and each goes on with the other's."""

import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pendula
import pytest
import xarray

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENARIOS = sorted(file.name for file in EXAMPLES.glob("*.toml"))
# What tells when and by what a file was written.
OF_WRITING = ("history", "checksum")


def contents(file: Path) -> dict[str, object]:
    """Bytes of all data sets and attributes by name, but for the summary."""
    found: dict[str, object] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        for key, value in item.attrs.items():
            is_reference = key in ("REFERENCE_LIST", "DIMENSION_LIST")
            if not is_reference and key not in OF_WRITING:
                found[f"{name}@{key}"] = (
                    np.asarray(value).tobytes() if isinstance(value, np.ndarray) else value
                )
        if isinstance(item, h5py.Dataset) and name != "run/summary":
            value = item[()]
            if (
                name == "run/checkpoint"
            ):  # two are written in turn: the last one, without its number and checksum
                value = value[value[:, 1].argmax(), 2:]
            found[name] = value.tobytes() if isinstance(value, np.ndarray) else value

    with h5py.File(file) as opened:
        visit("", opened)
        opened.visititems(visit)
    return found


def quick(name: str, duration: float = 0.5) -> dict[str, object]:
    few: dict[str, object] = {"run.duration": duration, "run.estimate": False}
    if "every" not in (EXAMPLES / name).read_text():
        few["output.every"] = 1
    return few


def words(few: dict[str, object]) -> list[str]:
    return [word for key, one in few.items() for word in ("--set", f"{key}={str(one).lower()}")]


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_file_is_that_of_the_command_line(name, command_line, tmp_path):
    few = quick(name)
    told = command_line(EXAMPLES / name, tmp_path / "theirs.h5", *words(few))
    run = pendula.Scenario(EXAMPLES / name, few).run()
    run.save(tmp_path / "ours.h5")
    ours, theirs = contents(tmp_path / "ours.h5"), contents(tmp_path / "theirs.h5")
    assert ours.keys() == theirs.keys()
    for key, value in theirs.items():
        assert ours[key] == value, key
    opened = pendula.open(tmp_path / "theirs.h5")
    assert np.array_equal(opened.y, run.y) and opened.columns == run.columns and opened.units == run.units
    assert opened.summary["steps"] == told["steps"] and opened.status == run.status
    for event, times in run.t_events.items():
        assert np.array_equal(opened.t_events[event], times)
        assert np.array_equal(opened.y_events[event], run.y_events[event])
    again = pendula.open(tmp_path / "ours.h5")
    assert again.message == run.message and again.summary["trajectory"] == "ours.h5"
    again.save(tmp_path / "again.h5")
    assert contents(tmp_path / "again.h5") == ours


def program(command: str, *more: object) -> subprocess.CompletedProcess:
    return subprocess.run([command, *map(str, more)], capture_output=True, text=True, check=False)


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
@pytest.mark.parametrize(
    "name", ["adaptive_method.toml", "poincare.toml", "spring_pendulum.toml", "whip.toml"]
)
def test_each_goes_on_with_the_others_run(name, command_line, tmp_path):
    run_it = os.environ["PENDULA_PROGRAM"]
    half = quick(name, 0.25)
    command_line(EXAMPLES / name, tmp_path / "theirs.h5", *words(half))
    gone_on = pendula.open(tmp_path / "theirs.h5").go_on(0.5)
    run = pendula.Scenario(EXAMPLES / name, half).run()
    run.save(tmp_path / "ours.h5")
    assert np.array_equal(run.go_on(0.5).y, gone_on.y)
    gone_on.save(tmp_path / "gone_on.h5")
    for file in ("ours.h5", "theirs.h5"):
        done = program(
            run_it, "simulate", "--resume", tmp_path / file, "--set", "run.duration=0.5", "--quiet"
        )
        assert done.returncode == 0, done.stderr
    expected = contents(tmp_path / "theirs.h5")
    for file in ("gone_on.h5", "ours.h5"):
        found = contents(tmp_path / file)
        for key, value in expected.items():
            assert found[key] == value, (file, key)


def test_a_run_goes_forwards():
    run = pendula.Chain(links=2).simulate(1.0, theta=1.0, step=0.01)
    with pytest.raises(pendula.InputError, match=r"^duration: expected at least 0.99.* got 0.1"):
        run.go_on(0.1)
    for wrong in ("1 s", float("nan"), None):
        with pytest.raises(pendula.InputError, match=r"^duration: expected a finite number, got"):
            run.go_on(wrong)


MODEL = """
def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2 - 2 * x**2
    model.point("mass", (x, 0 * x))
"""


def test_a_file_has_its_model(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(MODEL)
    run = pendula.Model(file).simulate(1.0, x=1.0, accuracy=1e-10)
    run.save(tmp_path / "run.h5")
    file.write_text(MODEL.replace("2 *", "3 *"))
    assert np.array_equal(run.sol(run.t), run.y)
    file.unlink()
    opened = pendula.open(tmp_path / "run.h5")
    assert np.array_equal(opened.y, run.y)
    assert np.array_equal(opened.sol(run.t), run.y)
    assert abs(opened.go_on(2.0)["x"][-1] - np.cos(4.0)) < 1e-9  # measured 8e-14


def test_endings_decide(tmp_path):
    run = pendula.Chain(links=2).simulate(1.0, theta=1.0)
    run.save(tmp_path / "rows.csv")
    header, *rows = (tmp_path / "rows.csv").read_text().splitlines()
    assert sorted(header.split(",")) == sorted(run.columns)
    for column, numbers in zip(
        header.split(","), zip(*(row.split(",") for row in rows), strict=True), strict=True
    ):
        assert np.array_equal(np.array(numbers, dtype=float), run[column])
    run.to_netcdf(tmp_path / "run.nc")
    data = xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf")
    assert np.array_equal(data["theta"].values.T, run["theta"])
    with pytest.raises(pendula.InputError, match=r"rows.txt: expected a name that ends in .csv"):
        run.save(tmp_path / "rows.txt")
    with pytest.raises(pendula.InputError, match=r"file: expected a name that ends in .nc.* got .*rows.csv"):
        run.to_netcdf(tmp_path / "rows.csv")
    with pytest.raises(pendula.InputError, match="nowhere"):
        run.save(tmp_path / "nowhere" / "run.h5")


def test_a_file_without_rows_goes_on(tmp_path):
    """Where they were taken out of it; what it goes on to is rows only."""
    run = pendula.Chain(links=2).simulate(1.0, theta=1.0, step=0.01)
    run.save(tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        for name in set(file) - {"run"}:
            del file[name]
    opened = pendula.open(tmp_path / "run.h5")
    assert opened.t.size == 0
    gone_on, whole = opened.go_on(2.0), run.go_on(2.0)
    assert gone_on.t[0] == 1.0
    assert np.array_equal(gone_on.y, whole.y[:, whole.t >= 1.0])
    gone_on.save(tmp_path / "rows.csv")
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 1 + gone_on.t.size
    for rowless in (opened, gone_on):
        with pytest.raises(
            pendula.InputError, match=r"^.*more.h5: expected a CSV file, got a run file, whose"
        ):
            rowless.save(tmp_path / "more.h5")
    assert not (tmp_path / "more.h5").exists()


def test_solutions_can_be_pickled():
    run = pendula.Chain(links=2).simulate(1.0, theta=1.0, step=0.01, events={"low": "theta_1"})
    again = pickle.loads(pickle.dumps(run))
    assert np.array_equal(again.y, run.y) and again.summary == run.summary
    assert np.array_equal(again.sol(0.3), run.sol(0.3))
    assert again.t_events.keys() == run.t_events.keys()
    assert np.array_equal(again.go_on(1.5).y, run.go_on(1.5).y)


def test_a_run_that_failed_can_be_saved(tmp_path):
    stiff = pendula.Chain(links=2, damping=[1e9, 1e9])
    with pytest.raises(pendula.RunFailed) as failed:
        stiff.simulate(1.0, theta=[1, 2], theta_dot=[1e3, -1e3], method="rk4", step=0.01)
    failed.value.partial.save(tmp_path / "run.h5")
    opened = pendula.open(tmp_path / "run.h5")
    assert opened.status == -1 and opened.message == str(failed.value)
    assert str(pickle.loads(pickle.dumps(failed.value)).partial) == str(failed.value.partial)


def test_a_run_that_was_cut_off_can_be_read(tmp_path):
    scenario = tmp_path / "long.toml"
    scenario.write_text(
        "[chain]\nspace = 'planar'\nlinks = 2\nmasses = 1\nlengths = 1\n[start]\ntheta = 1\n"
        "[run]\nduration = 1e6\nstep = 1e-3\nestimate = false\n"
        "[output]\nevery = 1000\ncheckpoint = 0.2\n"
    )
    command = [os.environ["PENDULA_PROGRAM"], "simulate", scenario, "--quiet", "-o", tmp_path / "run.h5"]
    with subprocess.Popen(command) as running:
        end = time.monotonic() + 20
        while not (tmp_path / "run.h5").exists() and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(2.5)
        going = pendula.open(tmp_path / "run.h5")
        running.send_signal(signal.SIGKILL)
    cut = pendula.open(tmp_path / "run.h5")
    for run in (going, cut):
        assert run.status == -1 and "cut off" in run.message and run.t.size > 10 and "rows" in repr(run)
        assert np.array_equal(run.sol(run.t[5]), run.y[:, 5])
        with pytest.raises(RuntimeError, match="steps: expected a run that came to an end"):
            _ = run.nsteps


@pytest.mark.parametrize("wrong", ["missing", "text", "damaged"])
def test_what_is_no_run_file_is_named(wrong, tmp_path):
    file = tmp_path / "run.h5"
    if wrong == "text":
        file.write_text("t,x\n0,1\n")
    if wrong == "damaged":
        pendula.Chain(links=1).simulate(1.0, theta=1.0).save(file)
        data = bytearray(file.read_bytes())
        data[len(data) // 3 : len(data) // 2] = bytes(len(data) // 2 - len(data) // 3)
        file.write_bytes(data)
    with pytest.raises(pendula.InputError, match=r"run.h5: expected a run file.* got "):
        pendula.open(file)


def test_other_copies_of_hdf5_do_no_harm(tmp_path):
    code = (
        "import h5py, pendula, sys\n"
        "run = pendula.Chain(links=2).simulate(1.0, theta=1.0)\n"
        "with h5py.File(sys.argv[1] + '.other', 'w') as f: f['a'] = 1\n"
        "run.save(sys.argv[1]); assert (pendula.open(sys.argv[1]).y == run.y).all()\n"
        "assert h5py.File(sys.argv[1])['theta'].shape == (run.t.size, 2)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "run.h5"], check=False)
    assert done.returncode == 0
