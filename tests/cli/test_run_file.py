"""Run files: what is in them for others to read, and runs that go on from them as if they had never stopped."""

import json
import math
import random
import re
import resource
import shlex
import shutil
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from conftest import DOUBLE, SPHERICAL, Trajectory, program, settings
from damage import draws
from old_run_file import checksum, forget_checksums

WHIP = """\
[chain]
space   = "spatial"
masses  = [1.0, 0.3, 0.1, 0.03, 0.01]
lengths = 1.0
gravity = 9.81

[start]
theta = [2.0, 2.1, 2.2, 3.0, 3.14159]
phi   = 0.0

[run]
stages   = 4
step     = 2e-3
duration = 10.0
"""

THROUGH_THE_POLE = SPHERICAL.replace("phi_dot   = 0.9", "phi_dot   = 0.0").replace(
    "theta_dot = 0.4", "theta_dot = 6"
)

ADAPTIVE = DOUBLE.replace("step     = 5e-3", 'method = "dopri5"')

EVENTS = """
[[event]]
name = "flip-over"
when = "abs(theta_2) - 3"

[[event]]
name = "low"
when = "y_2 + 1.5"
direction = "down"
"""

SCENARIOS = {
    "double": DOUBLE,
    "whip": WHIP,
    "pole": THROUGH_THE_POLE,
    "dopri5": ADAPTIVE,
    "rk4": DOUBLE.replace("step     =", 'method = "rk4"\nstep ='),
    "dense": DOUBLE.replace("step     =", 'solver = "dense"\nstages = 3\nstep ='),
    "driven": DOUBLE + "\n[[chain.drive]]\nlink = 2\namplitude = 3.0\nfrequency = 5.0\n",
}


def bits(data: np.ndarray) -> np.ndarray:
    return data.view(np.int64) if data.dtype == np.float64 else data


def arrays_of(run: h5py.File) -> set[str]:
    """Rows, events, and what stays: all but what is told of the run."""
    events = {f"events/{name}" for name in run.get("events", [])}
    return set(run) - {"run", "events"} | events


def assert_same_rows(first: Path, second: Path) -> None:
    with h5py.File(first) as one, h5py.File(second) as other:
        assert arrays_of(one) == arrays_of(other)
        for name in arrays_of(one):
            assert np.array_equal(bits(one[name][...]), bits(other[name][...])), name


def rows_of(file: Path) -> int:
    with h5py.File(file) as run:
        return run["t"].shape[0]


def read_whole(file: Path) -> None:
    with h5py.File(file) as run:
        for name in ["t", "theta", "theta_dot", "x", "y", "energy"]:
            assert run[name][...].size > 0, name


@pytest.fixture
def scenario(tmp_path):
    def write(text: str) -> Path:
        file = tmp_path / "run.toml"
        file.write_text(text)
        return file

    return write


@pytest.mark.parametrize("name", ["double", "whip"])
def test_rows_are_those_of_the_csv_file_to_the_last_bit(name, pendula, scenario, tmp_path):
    file = scenario(SCENARIOS[name])
    assert pendula("simulate", file, "-o", "run.csv").status == 0
    run = pendula("simulate", file, "-o", "run.h5", "--json")
    rows = Trajectory.read(tmp_path / "run.csv")
    assert (run.status, run.json["rows"], run.json["trajectory"]) == (0, len(rows.rows), "run.h5")
    with h5py.File(tmp_path / "run.h5") as saved:
        for column in rows.header:
            quantity, _, link = column.rpartition("_")
            data = saved[quantity][:, int(link) - 1] if link.isdigit() else saved[column][...]
            assert np.array_equal(bits(data), bits(np.array(rows.column(column)))), column


def test_quantities_have_names_units_and_axes(pendula, scenario, tmp_path):
    file = scenario(WHIP)
    pendula("simulate", file, "--set", "run.duration=0.1", "-o", "run.h5")
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as run:
        assert run["theta"].dims == ("t", "link") and run["energy"].dims == ("t",)
        assert list(run["link"].values) == [1, 2, 3, 4, 5]
        units = {name: run[name].attrs["units"] for name in ["t", "theta", "phi_dot", "z", "energy"]}
        assert units == {"t": "s", "theta": "rad", "phi_dot": "rad/s", "z": "m", "energy": "J"}
        assert run.attrs["pendula"] == "0.1.0" and run.attrs["solver"] == "chain"
        assert float(run["x"].sel(t=0.1, link=5, method="nearest")) == pytest.approx(
            float(run["x"][-1, 4]), abs=0
        )
    with h5py.File(tmp_path / "run.h5") as run:
        assert run["run/scenario"].asstr()[()] == WHIP
        assert run["run"].attrs["scenario_file"] == "run.toml"
        assert run["run/set"].asstr()[()] == '["run.duration=0.1"]'


def test_units_of_a_nondimensional_run(pendula, scenario, tmp_path):
    file = scenario(DOUBLE.replace("gravity = 9.81", 'gravity = 9.81\nunits = "natural"'))
    assert pendula("simulate", file, "-o", "run.h5").status == 0
    with h5py.File(tmp_path / "run.h5") as run:
        own = {
            "t": "sqrt(l_1/g)",
            "x": "l_1",
            "theta_dot": "rad / sqrt(l_1/g)",
            "energy": "M_1 g l_1",
            "masses": "M_1",
        }
        assert {name: run[name].attrs["natural_unit"] for name in own} == own
        assert {run[name].attrs["units"] for name in own} == {"1"}  # others, udunits does not know
        assert run["theta"].attrs["units"] == "rad" and "natural_unit" not in run["theta"].attrs


ROWS = (
    "output.every=3"  # those that nobody asks for depend on the end that a run begins with: see test_rows.py
)


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_run_goes_on_as_if_it_had_never_stopped(name, pendula, scenario, tmp_path):
    """Its ends fall between steps and rows: the last step of each part is cut, and its last row is extra."""
    draw = random.Random(name)
    file = scenario(SCENARIOS[name])
    whole = pendula("simulate", file, *settings("run.duration=8", ROWS), "-o", "whole.h5", "--json")
    assert whole.status == 0
    ends = sorted(draw.uniform(0, 8) for _ in range(19))
    assert pendula("simulate", file, *settings(f"run.duration={ends[0]}", ROWS), "-o", "part.h5").status == 0
    for end in [*ends[1:], 8]:
        resumed = pendula("simulate", "--resume", "part.h5", "--set", f"run.duration={end}", "--json")
        assert (resumed.status, resumed.err) == (0, ""), resumed.err
    assert_same_rows(tmp_path / "whole.h5", tmp_path / "part.h5")
    # How far rows can be trusted is estimated anew, of those that are new.
    assert 0 < resumed.json["expected_error"] < 1e-3
    different = {"scenario", "trajectory", "wall_seconds", "expected_error"}
    assert {**resumed.json, **dict.fromkeys(different)} == {**whole.json, **dict.fromkeys(different)}


def test_a_run_that_is_killed_leaves_a_file_that_opens_and_goes_on(scenario, tmp_path):
    """By SIGKILL and by signals that it hears, at random times; tests/campaign/damages.py draws more."""
    file = scenario(DOUBLE + EVENTS)
    long = settings("run.step=1e-3", "run.duration=1500", "output.every=3", "output.checkpoint=0.1")
    run = partial(subprocess.run, cwd=tmp_path, check=True, capture_output=True)
    run([program(), "simulate", file, *long, "-o", "whole.h5"])
    anew = [program(), "simulate", file, *long, "-o", "part.h5"]
    command, opened = anew, []
    for _, draw in draws(20):
        part = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            part.wait(timeout=draw.choice([0.02, 0.1, 0.3]) * draw.random())
            assert part.returncode == 0
            assert_same_rows(tmp_path / "whole.h5", tmp_path / "part.h5")
            (tmp_path / "part.h5").unlink()
            command = anew
        except subprocess.TimeoutExpired:
            part.send_signal(draw.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP]))
            part.wait()
        if (tmp_path / "part.h5").exists():
            command = [program(), "simulate", "--resume", "part.h5"]
            read_whole(tmp_path / "part.h5")
        opened.append(command != anew)
    run(command)
    assert sum(opened) > 3 or len(opened) < 20
    assert_same_rows(tmp_path / "whole.h5", tmp_path / "part.h5")
    assert not list(tmp_path.glob("part.h5.*"))


def test_a_file_is_read_while_it_is_written(scenario, tmp_path):
    file = scenario(DOUBLE)
    command = [
        program(),
        "simulate",
        file,
        *settings("run.duration=1e9", "output.every=20000"),
        "-o",
        "run.h5",
    ]
    part = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    rows = 0
    while rows < 3 and time.monotonic() < deadline:
        time.sleep(0.1)
        if (tmp_path / "run.h5").exists():
            rows = rows_of(tmp_path / "run.h5")
    refused = subprocess.run(
        [program(), "simulate", file, "-o", "run.h5"], cwd=tmp_path, capture_output=True, text=True
    )
    part.terminate()
    _, told = part.communicate()
    assert rows >= 3
    assert refused.returncode == 2 and "got: one that another run writes" in refused.stderr
    assert part.returncode == 1
    assert told.endswith("; to go on: pendula simulate --resume run.h5\n")


def assert_goes_on_to_the_whole(scenario: Path, arguments: list[str]) -> None:
    """run.h5 beside the scenario, resumed, ends as the run that nothing has stopped."""
    run = partial(subprocess.run, cwd=scenario.parent, check=True, capture_output=True)
    run([program(), "simulate", "--resume", "run.h5"])
    run([program(), "simulate", scenario, *arguments, "-o", "whole.h5"])
    assert_same_rows(scenario.parent / "whole.h5", scenario.parent / "run.h5")


def test_a_full_disk_leaves_what_was_written(scenario, tmp_path):
    """Here the limit of a file's size stands for it; the first rows are there, and the run goes on from them."""
    file = scenario(DOUBLE)
    long = settings("run.step=1e-3", "run.duration=300", "output.every=1")
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (4_000_000, 4_000_000))
    full = subprocess.run(
        [program(), "simulate", file, *long, "-o", "run.h5"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=limit,
    )
    assert full.returncode == 1
    assert full.stderr.endswith("pendula: run.h5: could not be written: File too large\n")
    assert rows_of(tmp_path / "run.h5") > 40000  # 64 bytes a row, and a block of 4096 is lost
    assert_goes_on_to_the_whole(file, long)


def test_a_full_disk_has_the_last_row_and_where_to_go_on_from(scenario, tmp_path):
    """A disk of four megabytes, in a name space of its own: room for the end is taken beforehand."""
    file = scenario(DOUBLE)
    long = settings("run.step=1e-3", "run.duration=300", "output.every=1")
    (tmp_path / "disk").mkdir()
    mount = "mount -t tmpfs -o size=4m tmpfs disk"
    if (
        subprocess.run(["unshare", "-rm", "sh", "-c", mount], cwd=tmp_path, capture_output=True).returncode
        != 0
    ):
        pytest.skip("no file system can be mounted here")
    command = shlex.join([program(), "simulate", str(file), *long, "-o", "disk/run.h5"])
    inside = f"{mount} && {command}; status=$?; cp disk/run.h5 . && exit $status"
    full = subprocess.run(
        ["unshare", "-rm", "sh", "-c", inside], cwd=tmp_path, capture_output=True, text=True
    )
    assert full.returncode == 1
    assert full.stderr.endswith("pendula: disk/run.h5: could not be written: No space left on device\n")
    with h5py.File(tmp_path / "run.h5") as run:
        rows, kept = run["t"].shape[0], run["run/checkpoint"][:, 3].max()
        assert f"disk/run.h5, {rows} rows\n" in full.stdout
    assert rows == kept > 40000
    assert_goes_on_to_the_whole(file, long)


def test_an_interrupted_run_without_a_run_file_leaves_one_to_go_on_from(scenario, tmp_path):
    file = scenario(DOUBLE)
    long = settings("run.step=1e-3", "run.duration=2000")
    subprocess.run(
        [program(), "simulate", file, *long, "-o", "whole.csv"], cwd=tmp_path, check=True, capture_output=True
    )
    part = subprocess.Popen(
        [program(), "simulate", file, *long, "-o", "first.csv"], cwd=tmp_path, stderr=subprocess.PIPE
    )
    time.sleep(0.2)
    part.send_signal(signal.SIGHUP)
    _, told = part.communicate()
    assert told.endswith(b"; to go on: pendula simulate --resume first.resume.h5\n")
    rest = [program(), "simulate", "--resume", "first.resume.h5", "-o", "rest.csv"]
    subprocess.run(rest, cwd=tmp_path, check=True, capture_output=True)
    whole, first, rest = (
        (tmp_path / name).read_text().splitlines() for name in ("whole.csv", "first.csv", "rest.csv")
    )
    new = rest[1:]
    assert whole == first[: len(whole) - len(new)] + new


def test_a_link_leads_to_the_file(pendula, scenario, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "run.h5").symlink_to("there/real.h5")
    file = scenario(DOUBLE)
    assert pendula("simulate", file, "-o", "run.h5", "--set", "output.every=10").status == 0
    assert pendula("simulate", "--resume", "run.h5", "--set", "run.duration=2").status == 0
    assert (tmp_path / "run.h5").is_symlink() and rows_of(tmp_path / "there/real.h5") == 41


def test_what_cannot_go_on_is_refused(pendula, scenario, tmp_path):
    file = scenario(DOUBLE)
    pendula("simulate", file, "-o", "run.h5")
    (tmp_path / "text.h5").write_text("no HDF5 file")
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["t"] = [1.0, 2.0]
    shutil.copy(tmp_path / "run.h5", tmp_path / "old.h5")
    with h5py.File(tmp_path / "old.h5", "a") as old:
        old.attrs["pendula"] = "0.0.9"
    shutil.copy(tmp_path / "run.h5", tmp_path / "kernel.h5")
    with h5py.File(tmp_path / "kernel.h5", "a") as other:
        other.attrs["kernel"] = "planar_9"
    before = (tmp_path / "run.h5").read_bytes()
    for arguments, expected in [
        (["none.h5"], "none.h5: expected a run file to go on from, got a file that is not there"),
        (["text.h5"], "text.h5: expected a run file to go on from, got one that HDF5 cannot read: "),
        (["other.h5"], 'other.h5: expected a run file to go on from, got a file without the group "run"'),
        (["kernel.h5"], "run.toml: the run began by "),
        (["old.h5"], "old.h5: expected a run of pendula 0.1.0, got one of 0.0.9"),
        (
            ["run.h5", *settings("run.duration=0.5")],
            "run.duration: expected at least 1, where the run is already, got 0.5",
        ),
        (
            ["run.h5", *settings("run.step=1e-4")],
            "--set run.step=1e-4: expected run.duration or output.checkpoint",
        ),
        (["run.h5", "-o", str(tmp_path)], f"{tmp_path}: expected a file that can be written"),
    ]:
        run = pendula("simulate", "--resume", *arguments)
        assert (run.status, run.out) == (2, "")
        assert run.err.startswith(f"pendula: {expected}"), run.err
    assert (tmp_path / "run.h5").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "kernel.h5",
        "old.h5",
        "other.h5",
        "run.h5",
        "run.toml",
        "text.h5",
    ]


def test_another_instruction_set_is_refused(pendula, scenario):
    available = pendula("--version").out
    pendula("simulate", scenario(DOUBLE), "-o", "run.h5")
    other = "sse2" if "sse2" not in available else "avx2"
    run = pendula("simulate", "--resume", "run.h5", PENDULA_ARCH=other)
    if "PENDULA_ARCH" in run.err and "got one on" not in run.err:
        pytest.skip("this build or this processor has one instruction set only")
    assert run.status == 2
    assert f"run.h5: expected a run on {other}, got one on" in run.err


def test_a_file_that_is_replaced_is_told(pendula, scenario, tmp_path):
    file = scenario(DOUBLE)
    for name in ["run.h5", "run.csv"]:
        assert "replacing" not in pendula("simulate", file, "-o", name).err
        assert pendula("simulate", file, "-o", name).err == f"pendula: replacing {name}\n"
        assert pendula("simulate", file, "-o", name, "--quiet").err == ""
    assert "replacing" not in pendula("simulate", "--resume", "run.h5").err
    run = pendula("simulate", file, "-o", "run.toml")
    assert run.status == 2 and file.read_text() == DOUBLE


CHANGES = {
    "masses": ("run/scenario", DOUBLE.replace("[1.0, 1.0]", "[1.0, 2.0]")),
    "stages": ("run/scenario", DOUBLE.replace("step     =", "stages = 5\nstep =")),
    "settings": ("run/set", '["run.duration=2.0", "chain.gravity=1.62"]'),
    "model": ("run/model", "import os"),
}
ANOTHER_RUN = "one whose scenario, settings or model are not what it was written with"


@pytest.mark.parametrize("name", CHANGES)
def test_a_file_that_tells_of_another_run_is_refused_and_stays_as_it_is(name, pendula, scenario, tmp_path):
    assert pendula("simulate", scenario(DOUBLE), "--set", "run.duration=1.0", "-o", "run.h5").status == 0
    dataset, text = CHANGES[name]
    with h5py.File(tmp_path / "run.h5", "a") as run:
        run[dataset][()] = text
    before = (tmp_path / "run.h5").read_bytes()
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=2")
    assert resumed.status == 2
    assert resumed.err == f"pendula: run.h5: expected a run file to go on from, got {ANOTHER_RUN}\n"
    assert (tmp_path / "run.h5").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "run.toml"]


def test_rows_that_are_not_those_of_the_run_are_refused(pendula, scenario, tmp_path):
    """That is found when the new file is begun already."""
    assert pendula("simulate", scenario(DOUBLE), "-o", "run.h5").status == 0
    with h5py.File(tmp_path / "run.h5", "a") as run:
        run["theta"][3, 1] = np.nextafter(run["theta"][3, 1], 0)
    before = (tmp_path / "run.h5").read_bytes()
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=2")
    expected = "expected a run file to go on from, got one whose rows are not those that were written"
    assert (resumed.status, resumed.err) == (2, f"pendula: run.h5: {expected}\n")
    assert (tmp_path / "run.h5").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "run.toml"]


def test_a_run_that_went_on_says_how_long_it_is(pendula, scenario, tmp_path):
    """The file is the one that a run of this duration would have written, so it goes on to there once more."""
    assert pendula("simulate", scenario(DOUBLE), "--set", "chain.gravity=1.62", "-o", "run.h5").status == 0
    for duration in ("2", "3"):
        assert pendula("simulate", "--resume", "run.h5", "--set", f"run.duration={duration}").status == 0
    with h5py.File(tmp_path / "run.h5") as run:
        assert run["run/set"].asstr()[()] == '["chain.gravity=1.62","run.duration=3"]'
    assert pendula("simulate", "--resume", "run.h5").status == 0


def test_a_run_that_goes_on_is_looked_at_anew(pendula, scenario, tmp_path):
    """By its accuracy the first part was right to 1e-9, which is not so of what chaos makes of it later."""
    by_itself = DOUBLE.replace("step     = 5e-3", "")
    file = scenario(by_itself.replace("theta = 1.5707963267948966", "theta = 2.0"))
    assert pendula("simulate", file, "--set", "run.duration=10", "-o", "run.h5").err == ""
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=18", "--json").json
    exact = pendula(
        "simulate", file, "--set", "run.duration=18", "--set", "run.tolerance=1e-16", "--json"
    ).json
    off = math.dist(resumed["final"]["bobs"][1], exact["final"]["bobs"][1]) / 2
    assert 1e-7 < off < resumed["expected_error"] < 1e-3  # measured 1.7e-6, 2.2e-4
    assert "may be off by more than 2e-09" in resumed["warnings"][0] and 10 < resumed["trusted_until"] < 18
    # A swing so small that its steps are as long as the method allows is right all the same.
    small = scenario(by_itself.replace("theta = 1.5707963267948966", "theta = 0.001"))
    assert pendula("simulate", small, "--set", "run.duration=1", "-o", "small.h5").err == ""
    resumed = pendula("simulate", "--resume", "small.h5", "--set", "run.duration=3", "--json").json
    assert resumed["warnings"] == [] and resumed["expected_error"] < 1e-9  # measured 7e-12


def test_a_run_that_goes_on_keeps_what_is_known_of_its_beginning(pendula, scenario, tmp_path):
    """Rows that trials have found right are not doubted for what comes after them, nor are others trusted again."""
    by_itself = DOUBLE.replace("step     = 5e-3", "").replace("theta = 1.57", "theta = 0.3  # 1.57")
    torque = '\n[[chain.signal]]\ninput = "torque_1"\ntimes = [0, 1]\nvalues = [0, 2]\n'
    file = scenario(by_itself + torque)
    begun = pendula("simulate", file, "--set", "run.duration=2", "-o", "run.h5", "--json").json
    assert begun["trusted_until"] is None
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=3", "--json").json
    assert "rows after t = 2" in resumed["warnings"][0] and resumed["trusted_until"] >= 2
    assert resumed["expected_error"] >= begun["expected_error"]

    chaotic = scenario(by_itself.replace("0.3", "2.3"))
    begun = pendula("simulate", chaotic, "--set", "run.duration=25", "-o", "run.h5", "--json").json
    assert 5 < begun["trusted_until"] < 20
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=26", "--json").json
    assert resumed["expected_error"] is None
    assert 0 <= resumed["trusted_until"] - begun["trusted_until"] < 1  # measured 0.3; once 0 s was told


def test_the_python_of_the_documentation_runs(pendula, scenario, tmp_path, monkeypatch):
    page = Path(__file__).parents[2] / "docs/reference/run-file.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    assert len(blocks) == 2
    assert pendula("simulate", scenario(DOUBLE), "-o", "run.h5").status == 0
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    for block in blocks:
        exec(compile(block, page, "exec"), {})


def test_a_run_file_is_what_climate_conventions_say(pendula, scenario, tmp_path):
    """CF: what each array is, in which unit; flags of the type of their variable; and where the file comes from."""
    file = scenario(DOUBLE.replace("gravity = 9.81", "damping = [0.1, 0.2]\ntorque = 0.3") + EVENTS)
    assert pendula("simulate", file, "-o", tmp_path / "run.nc", "--set", "run.duration=5").status == 0
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as run:
        assert run.attrs["Conventions"] == "CF-1.11"
        assert run.attrs["title"] == "run: 2 links in the plane"
        command = "pendula simulate run.toml -o run.nc --set run.duration=5"
        assert re.fullmatch(rf"\d{{4}}-\d\d-\d\dT\d\d:\d\d:\d\dZ: {command}", run.attrs["history"])
        assert all(data.attrs["long_name"] and data.attrs["units"] for data in run.variables.values())
        for name, unit in {"masses": "kg", "lengths": "m", "damping": "N m s/rad", "torque": "N m"}.items():
            assert (run[name].dims, run[name].attrs["units"]) == (("link",), unit)
        assert run["damping"].values.tolist() == [0.1, 0.2] and run["torque"].values.tolist() == [0.3, 0.3]
        assert (float(run["gravity"]), run["gravity"].attrs["units"]) == (9.81, "m/s^2")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf", group="events") as events:
        assert events["event_name"].attrs["flag_meanings"] == "flip-over low"
        assert events["event_direction"].attrs["flag_meanings"] == "down up"
        for name in ("event_name", "event_direction"):
            assert events[name].attrs["flag_values"].dtype == events[name].dtype
            assert set(events[name].values) <= set(events[name].attrs["flag_values"])
        assert events["x"].dims == ("event_number", "link") and events["x"].attrs["units"] == "m"


def test_the_events_of_a_run_file_are_those_of_the_csv_file(pendula, scenario, tmp_path):
    file = scenario(DOUBLE + EVENTS)
    run = pendula(
        "simulate", file, "--set", "run.duration=20", "-o", "run.h5", "--events", "events.csv", "--json"
    )
    header, *lines = (tmp_path / "events.csv").read_text().splitlines()
    lines = [dict(zip(header.split(","), line.split(","), strict=True)) for line in lines]
    assert len(lines) > 10 and {line["name"] for line in lines} == {"flip-over", "low"}
    with h5py.File(tmp_path / "run.h5") as saved:
        events = saved["events"]
        names = events["event_name"].attrs["flag_meanings"].split()
        assert [names[k - 1] for k in events["event_name"]] == [line["name"] for line in lines]
        ways = [("down", "up")[k] for k in events["event_direction"]]
        assert ways == [line["direction"] for line in lines]
        assert list(events["event_number"]) == list(range(1, len(lines) + 1))
        for column in ("t", "energy"):
            assert list(events[column]) == [float(line[column]) for line in lines]
        assert list(events["theta_dot"][:, 1]) == [float(line["theta_dot_2"]) for line in lines]
        summary = json.loads(saved["run/summary"].asstr()[0])
    assert summary["events"] == run.json["events"]
    assert {**summary, "final": run.json["final"]} == {**run.json, "scenario": "run.toml"}


def test_events_go_on_as_if_the_run_had_never_stopped(pendula, scenario, tmp_path):
    file = scenario(DOUBLE + EVENTS)
    long = settings("run.duration=20", ROWS)
    pendula("simulate", file, *long, "-o", "whole.h5")
    assert pendula("simulate", file, *settings("run.duration=0.73", ROWS), "-o", "part.h5").status == 0
    for end in ("3.3", "9.87654", "20"):
        assert pendula("simulate", "--resume", "part.h5", "--set", f"run.duration={end}").status == 0
    assert_same_rows(tmp_path / "whole.h5", tmp_path / "part.h5")
    with h5py.File(tmp_path / "part.h5") as part:
        assert len(part["events/t"]) > 10
        lines = part.attrs["history"].split("\n")
        assert [line.split(": ", 1)[1] for line in lines[1:]] == [
            f"pendula simulate --resume part.h5 --set run.duration={end}" for end in ("3.3", "9.87654", "20")
        ]
        assert json.loads(part["run/summary"].asstr()[0])["duration"] == 20


def test_a_run_file_tells_no_folder_of_its_user(pendula, scenario, tmp_path):
    """Warnings name the scenario, too: here one of an angle that looks like degrees."""
    file = scenario(DOUBLE.replace("1.5707963267948966", "90") + EVENTS)
    assert file.is_absolute()
    run = pendula("simulate", file, "-o", tmp_path / "run.h5", "--view", tmp_path / "run.html")
    assert f"{file}:8: start.theta: 90 rad" in run.err
    assert pendula("simulate", "--resume", tmp_path / "run.h5", "--set", "run.duration=2").status == 0
    assert str(tmp_path).encode() not in (tmp_path / "run.h5").read_bytes()
    with h5py.File(tmp_path / "run.h5") as saved:
        summary = json.loads(saved["run/summary"].asstr()[0])
    assert (summary["scenario"], summary["trajectory"]) == ("run.toml", "run.h5")
    assert summary["warnings"][0].startswith("run.toml:8: start.theta: 90 rad")


def test_a_summary_stands_in_the_file_of_a_run_that_failed(pendula, scenario, tmp_path):
    spherical = SPHERICAL.replace("theta     = 1.2", "theta = 0.0").replace(
        "[run]", '[run]\nsolver = "dense"'
    )
    assert pendula("simulate", scenario(spherical), "-o", "run.h5").status == 1
    with h5py.File(tmp_path / "run.h5") as saved:
        assert json.loads(saved["run/summary"].asstr()[0])["outcome"]["status"] != "ok"


def make_old(file: Path) -> None:
    """As run files were before they had constants, events, summaries, checksums, and counts of events at places to go
    on from."""
    with h5py.File(file, "a") as run:
        for name in ["masses", "lengths", "gravity", "damping", "torque", "events", "run/summary"]:
            del run[name]
        for name in ("Conventions", "title", "history", "source"):
            del run.attrs[name]
        run["run"].attrs["scenario_file"] = str(file.with_name("run.toml"))
        forget_checksums(run)


def test_files_of_old_go_on(pendula, scenario, tmp_path):
    """They become files of today, but for events, which are told only by those that have them from the beginning."""
    file = scenario(DOUBLE + EVENTS)
    pendula("simulate", file, *settings("run.duration=8", ROWS), "-o", "whole.h5")
    pendula("simulate", file, *settings("run.duration=3.3", ROWS), "-o", "part.h5")
    make_old(tmp_path / "part.h5")
    for end in ("5.5", "8"):
        resumed = pendula("simulate", "--resume", "part.h5", "--set", f"run.duration={end}", "--json")
        assert resumed.status == 0, resumed.err
    with h5py.File(tmp_path / "whole.h5", "a") as whole:
        del whole["events"]
    assert_same_rows(tmp_path / "whole.h5", tmp_path / "part.h5")


def test_places_to_go_on_from_have_a_layout(pendula, scenario, tmp_path):
    """Their numbers mean what they mean to this version, or the file is refused."""
    pendula("simulate", scenario(DOUBLE), "-o", "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as run:
        places = run["run/checkpoint"][()]
        places[:, -1] += 1
        places[:, 0] = [checksum(place) for place in places]
        run["run/checkpoint"][...] = places
    resumed = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=8")
    assert resumed.status == 2
    assert "another version of pendula, whose places to go on from are of another layout" in resumed.err


def test_what_files_of_old_lack_is_not_a_number(pendula, scenario, tmp_path):
    """Here the energy. The last row, which the end cut short, is taken back."""
    pendula("simulate", scenario(DOUBLE + EVENTS), "-o", "run.h5")
    make_old(tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as run:
        rows = run["t"].shape[0]
        del run["energy"]
    for end in ("2", "3"):
        resumed = pendula("simulate", "--resume", "run.h5", "--set", f"run.duration={end}")
        assert (resumed.status, resumed.err) == (0, "")
    with h5py.File(tmp_path / "run.h5") as run:
        assert np.isnan(run["energy"][: rows - 1]).all() and np.isfinite(run["energy"][rows:]).all()
