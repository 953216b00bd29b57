"""Ensembles are those of the command line, to the bit, wherever their members are moved."""

import os
import signal
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pandas
import pendula
import pytest
import xarray
from conftest import interrupted, ticks_during
from pendula import _core
from pendula._cluster import Work
from pendula._runs import places, tell

DOUBLE = pendula.Chain(masses=[1, 1])
GRID = np.linspace(-1, 1, 5)

FAST = """\
run = {duration = 2.0, tolerance = 1e-6}
event = [{name = "low", when = "theta_2"}]
"""
PLANAR = FAST + 'chain = {space = "planar", masses = [1, 1], lengths = [1, 1]}\nstart = {theta = [0, 0]}\n'
SCENARIOS = {
    "axes": PLANAR
    + """\
[[ensemble.axis]]
key = "start.theta[1]"
from = -3.0
to = 3.0
count = 7
[[ensemble.axis]]
key = "chain.lengths[2]"
values = [0.5, 2.0, 1.0]
[ensemble]
keep = ["final", "points", "energy", "energy_error", "steps", "lyapunov", "ftle", "megno", "event:low"]
""",
    "random": PLANAR
    + """\
[[ensemble.random]]
key = "start.theta[1]"
mean = 0.5
deviation = 0.2
[[ensemble.random]]
key = "chain.gravity"
from = 9.0
to = 10.0
[ensemble]
count = 300
seed = 7
method = "auto"
""",
    "list": PLANAR
    + """\
[[ensemble.list]]
key = "start.theta[2]"
values = [0.5, -2.0, 1e-3]
""",
    "failures": PLANAR
    + """\
[[ensemble.axis]]
key = "chain.masses[1]"
values = [-1.0, 1.0, 0.0, 2.0]
""",
    "natural": PLANAR.replace('"planar"', '"planar", units = "natural"')
    + """\
[[ensemble.axis]]
key = "run.duration"
values = [0.5, 2.0]
""",
    "model": FAST.replace("theta_2", "theta_1")
    + """\
system = {model = "cart_chain"}
[[ensemble.axis]]
key = "start.theta_1"
from = 0.1
to = 0.3
count = 3
""",
}


@pytest.fixture(scope="module", params=SCENARIOS)
def of_the_program(request, tmp_path_factory):
    """A scenario, and the file that the program makes of it."""
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "scenario.toml").write_text(SCENARIOS[request.param])
    file = folder / "out.h5"
    subprocess.run(
        [os.environ["PENDULA_PROGRAM"], "ensemble", folder / "scenario.toml", "-o", file],
        capture_output=True,
        check=True,
    )
    return folder / "scenario.toml", file


def without_history(data: xarray.Dataset) -> xarray.Dataset:
    """What does not tell when and by whom it was made."""
    return data.assign_attrs(history="")


def assert_same(one: xarray.Dataset, other: xarray.Dataset) -> None:
    xarray.testing.assert_identical(without_history(one), without_history(other))
    for name in one.variables:
        assert one[name].dtype == other[name].dtype
        if one[name].dtype != object:
            assert one[name].values.tobytes() == other[name].values.tobytes(), name


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
def test_a_scenario_is_that_of_the_command_line(of_the_program, tmp_path):
    scenario, file = of_the_program
    whole = pendula.open_ensemble(file)
    in_memory = pendula.Scenario(scenario).ensemble()
    assert_same(in_memory, whole)
    assert_same(pendula.Scenario(scenario).ensemble(file=tmp_path / "own.h5", threads=1), whole)
    own = xarray.open_dataset(file, engine="h5netcdf", decode_cf=False)
    assert set(own.variables) == set(whole.variables)
    for name in own.variables:
        assert own[name].dims == whole[name].dims
        assert {key: str(one) for key, one in own[name].attrs.items()} == {
            key: str(one) for key, one in whole[name].attrs.items()
        }


def test_arguments_are_a_scenario():
    data = pendula.ensemble(
        DOUBLE,
        2.0,
        {"theta": (GRID, "90 deg")},
        axes={"chain.lengths[1]": [0.5, 2.0], "run.duration": [1.0, 2.0, 3.0]},
        keep=["final", "event:flip"],
        events={"flip": {"when": "cos(theta_2/2)", "direction": "up"}},
        accuracy=1e-6,
        method="gauss",
    )
    assert dict(data.sizes) == {"start_theta_1": 5, "chain_lengths_1": 2, "run_duration": 3}
    assert {"t", "theta_1", "event_flip", "event_flip_count", "status", "trusted"} < set(data.data_vars)
    assert data["start_theta_1"].attrs == {"long_name": "start.theta[1]", "units": "rad"}
    scenario = tomllib.loads(data.attrs["scenario"])
    assert scenario["start"]["theta"] == [0.0, "90 deg"] and scenario["chain"]["lengths"] == [1.0, 1.0]
    one = data.sel(start_theta_1=0.5, chain_lengths_1=2.0, run_duration=3.0)
    longer = pendula.Chain(masses=[1, 1], lengths=[2, 1])
    alone = longer.simulate(3.0, theta=[0.5, np.pi / 2], accuracy=1e-6, method="gauss")
    assert float(one["t"]) == 3.0 and abs(float(one["theta_2"]) - alone["theta_2"][-1]) < 1e-12  # measured 0


def test_members_at_random_are_those_of_the_seed():
    drawn = {"start.theta[1]": ("normal", 1.0, 0.1), "chain.masses[2]": ("uniform", 1, 2)}
    data = pendula.ensemble(DOUBLE, 0.1, {"theta": [0, "0.2 rad"]}, random=drawn, members=500, seed=3)
    assert data.sizes == {"member": 500} and (data["status"] == 0).all()
    assert abs(float(data["start_theta_1"].mean()) - 1) < 0.02  # measured 0.005
    assert 1 < float(data["chain_masses_2"].min()) < float(data["chain_masses_2"].max()) < 2
    again = pendula.ensemble(DOUBLE, 0.1, {"theta": [0, "0.2 rad"]}, random=drawn, members=3, seed=3)
    other = pendula.ensemble(DOUBLE, 0.1, {"theta": [0, "0.2 rad"]}, random=drawn, members=3, seed=4)
    assert (again["start_theta_1"].values == data["start_theta_1"].values[:3]).all()
    assert (again["start_theta_1"].values != other["start_theta_1"].values).all()


def test_members_are_simulations():
    starts = np.random.default_rng(3).uniform(-1, 1, (20, 2))
    data = pendula.ensemble(DOUBLE, 2.0, {"theta": starts, "theta_dot_1": 0.5}, tolerance=1e-11)
    assert data.sizes == {"member": 20} and (data["status"] == 0).all() and (data["trusted"] == 1).all()
    assert (data["start_theta_2"].values == starts[:, 1]).all()
    for k in (0, 7, 19):
        alone = pendula.Simulation(DOUBLE, {"theta": starts[k], "theta_dot": [0.5, 0]}, tolerance=1e-11)
        alone.advance_to(2.0)
        found = np.array([data[name].values[k] for name in alone.names])
        assert np.abs(found - alone.state).max() < 1e-9  # measured 1.2e-11
    for given in (pandas.DataFrame(starts), starts.tolist(), np.asfortranarray(starts)):
        other = pendula.ensemble(
            DOUBLE, 2.0, {"theta": given, "theta_dot_1": 0.5}, tolerance=1e-11, threads=2
        )
        assert_same(other, data)


def test_one_name_is_kept_as_a_list_of_one():
    start = {"theta": np.ones((3, 2))}
    one, several = (pendula.ensemble(DOUBLE, 2.0, start, keep=keep) for keep in ("lyapunov", ["lyapunov"]))
    assert one.attrs["scenario"] == several.attrs["scenario"] and "auto" not in one.attrs["scenario"]
    assert one["lyapunov"].identical(several["lyapunov"])


def test_members_of_space_and_of_models():
    spatial = pendula.Chain(links=2, space="spatial")
    start = {"theta": np.full((4, 2), 0.4), "phi": np.arange(8.0).reshape(4, 2)}
    data = pendula.ensemble(spatial, 0.5, start, method="gauss")
    alone = pendula.Simulation(spatial, {"theta": 0.4, "phi": [2, 3]}).advance_to(0.5)
    found = np.array([data[name].values[1] for name in alone.names])
    assert np.abs(found - alone.state).max() < 1e-11  # measured 7.6e-14
    data = pendula.ensemble(pendula.Model("cart_chain"), 0.5, {"theta": [0.1, 0.2, 0.3], "x_dot": 2})
    assert data["x"].shape == (3,)
    data = pendula.ensemble(
        DOUBLE, 0.5, {"p_theta": np.ones((3, 2))}, random={"start.theta[1]": ("normal", 0, 1)}
    )
    assert data["start_p_theta_2"].attrs["units"] == "N m s" and data.sizes == {"member": 3}


# Of models whose names interleave, or end as rates do.
def test_every_order_is_that_of_names():
    @pendula.model
    def several(model, links):
        names = ("a_1", "b_1", "a_2", "c_dot")
        model.lagrangian = 0
        for k, name in enumerate(names):
            x = model.coordinate(name, "m")
            model.lagrangian += model.rate(x) ** 2 / 2 - (k + 1) ** 2 * x**2 / 2
            model.point(f"p{k}", (x, 0 * x))

    starts = {"a_1": [1.0, 2.0], "b_1": [1.0, 2.0], "a_2": 1.0, "c_dot": 1.0}
    data = pendula.ensemble(several(), 1.0, starts)
    for name, omega in (("a_1", 1), ("b_1", 2), ("a_2", 3), ("c_dot", 4)):
        assert abs(data[name].values[0] - np.cos(omega)) < 1e-11, name  # measured 1.7e-14


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"theta": np.zeros((3, 3))}, r"start: expected \(members, 2\) for theta, got shape \(3, 3\)"),
        ({"theta": np.zeros(3)}, r"start: expected \(members, 2\) for theta, got shape \(3,\)"),
        ({"theta_1": np.zeros((3, 2))}, r"start: expected \(members,\) for theta_1"),
        (
            {"theta": np.zeros((3, 2)), "theta_dot_1": np.zeros(4)},
            "start: expected as many members of each, got 3, 4",
        ),
        ({"theta": np.zeros((3, 2)), "theta_1": 1.0}, "start: theta_1 is given twice"),
        ({"theta": [[0, float("nan")]]}, "start: theta_2: expected finite numbers, got nan"),
        ({"alpha": 1.0}, "start: expected some of theta_1, .*, got alpha"),
        (
            {"theta": ("ninety", GRID)},
            r"start.theta\[1\]: expected a finite number or a string in rad or deg",
        ),
        ({"theta": 1j}, "start: theta: expected an array of numbers, got one of complex128"),
        ({"theta": (GRID,)}, "start: expected 2 of theta, got 1"),
        (
            {"theta": (GRID, np.zeros((2, 2)))},
            r"start: theta_2: expected .* along one axis, got shape \(2, 2\)",
        ),
        ({"theta": (GRID, []), "theta_dot": 0}, r"start: theta_2: expected .* got shape \(0,\)"),
        ({"theta": (GRID, GRID), "theta_dot": np.zeros((2, 2))}, "expected axes .*, got both"),
        ({"theta": 1.0}, "expected axes of a grid, or .*, got neither"),
    ],
)
def test_wrong_starts_are_named(start, message):
    with pytest.raises(pendula.InputError, match=message):
        pendula.ensemble(DOUBLE, 1.0, start)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"steps": 3}, r"ensemble: unknown keyword steps; did you mean step\b"),
        ({"duration": -1.0}, r"^duration: expected a finite number >= 0, got -1\.0"),
        ({"duration": float("nan")}, "^duration: expected a finite number >= 0, got nan"),
        ({"duration": "1"}, r'^duration: expected a finite number >= 0 or a string in s \(a time\), got "1"'),
        ({"threads": -1}, "threads: expected how many"),
        ({"threads": True}, "threads: expected how many"),
        ({"start": [1, 2]}, "start: expected a mapping by names, got list"),
        ({"system": "furuta"}, "system: expected a Chain or a Model, got str"),
        ({"keep": ["all"]}, 'ensemble.keep: expected some of final, points, .* got "all"'),
        ({"keep": 5}, "keep: expected names of what is kept, got 5"),
        (
            {"random": {"chain.gravity": ("log", 1, 2)}},
            r'random: expected \("normal", .* got \(\'log\', 1, 2\)',
        ),
        ({"random": {"chain.gravity": ("normal", 1, -2)}}, "ensemble.random.*deviation: expected .* got -2"),
        ({"random": {"chain.gravty": ("normal", 1, 2)}}, "gravty"),
        ({"axes": {"chain.gravity": [1.0]}}, "expected axes .*, got both"),
        ({"random": {"chain.gravity": ([], 1, 2)}}, "random: expected"),
        (
            {"start": {"theta": (GRID, 0)}, "axes": {"start.theta[1]": GRID}},
            r"axes: start.theta\[1\] is given twice",
        ),
        ({"members": 3}, "ensemble.count: expected a count of each list"),
        ({"seed": -1}, "ensemble.seed: expected"),
        ({"shard": (1, 2)}, "file: expected the file that shards share"),
        ({"resume": True}, "file: expected the file .* got none"),
        ({"shard": (3, 2), "file": "x.h5"}, r"shard: expected \(I, N\) .* got \(3, 2\)"),
        ({"file": "x.csv"}, "x.csv: expected .*HDF5"),
        ({"client": 5, "file": "x.h5"}, "client: expected no file beside it"),
        ({"client": 5}, "client: expected a Client of dask.distributed that waits, got int"),
        ({"method": "euler"}, "^method: expected"),
        ({"tolerance": 0.0}, "^tolerance: expected"),
    ],
)
def test_wrong_ensembles_are_named(given, message):
    with pytest.raises(pendula.InputError, match=message):
        pendula.ensemble(**{"system": DOUBLE, "duration": 1.0, "start": {"theta": [[0.1, 0.2]]}, **given})


def test_a_duration_may_have_a_unit():
    plain, unit = (pendula.ensemble(DOUBLE, one, {"theta": [[0.1, 0.2]]}) for one in (0.5, "500 ms"))
    assert np.array_equal(plain["theta_2"], unit["theta_2"])


def test_chaos_is_told_of_members():
    with pytest.warns(
        pendula.TrustWarning, match="of 2 members that were looked at again 1 cannot be"
    ) as told:
        data = pendula.ensemble(DOUBLE, 60.0, {"theta": [[0.1, 0.1], [2.5, 2.5]]})
    assert "the first, member 1: start.theta[1]=2.5" in str(told[0].message)
    assert told[0].filename == __file__
    assert data["trusted"].values.tolist() == [1, 0]
    data = pendula.ensemble(DOUBLE, 1.0, {"theta": [[0.1, 0.1]]}, estimate=False)
    assert data["trusted"].values.tolist() == [-1]


def test_members_that_fail_stop_nobody():
    masses = {"chain.masses[1]": [-1.0, 1.0]}
    with pytest.warns(
        pendula.TrustWarning, match=r"1 of 2 members failed; the first, member 0: .*masses\[1\]"
    ):
        data = pendula.ensemble(DOUBLE, 1.0, {"theta": 0.5}, axes=masses)
    assert data["status"].values.tolist() == [8, 0] and np.isnan(data["theta_1"].values[0])
    assert data["failed_member"].values.tolist() == [0.0] and "masses" in str(data["message"].values[0])
    assert data["status"].attrs["flag_meanings"].split()[1 + 8] == "wrong_input"
    stiff = pendula.Chain(links=2, damping=[1e9, 1e9])
    with (
        pytest.warns(pendula.TrustWarning),
        pytest.raises(pendula.RunFailed, match="all 1 members") as failed,
    ):
        pendula.ensemble(stiff, 1.0, {"theta": [[1, 2]], "theta_dot": [[1e3, -1e3]]}, method="rk4", step=0.01)
    assert failed.value.partial["status"].values[0] > 1


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
def test_shards_share_a_file_or_are_merged(tmp_path):
    start = {"theta": (np.linspace(-1, 1, 12), np.linspace(-1, 1, 8))}
    whole = pendula.ensemble(DOUBLE, 1.0, start)
    one = pendula.ensemble(DOUBLE, 1.0, start, file=tmp_path / "a.h5", shard=(1, 2))
    assert one.attrs["complete"] == 0 and (one["status"] == -1).any()
    with pytest.raises(pendula.InputError, match="files: expected all 96 members, got"):
        pendula.merge(tmp_path / "a.h5")
    other = pendula.ensemble(DOUBLE, 1.0, start, file=tmp_path / "b.h5", shard=(2, 2))
    assert_same(pendula.merge([tmp_path / "a.h5", tmp_path / "b.h5"]), whole)
    assert_same(pendula.merge([tmp_path / "b.h5", tmp_path / "a.h5"]), whole)
    assert other.attrs["members_done"] + one.attrs["members_done"] == 96
    last = pendula.ensemble(DOUBLE, 1.0, start, file=tmp_path / "a.h5", shard=(2, 2))
    assert_same(last, whole)
    assert not (tmp_path / "a.h5.parts").exists()
    again = pendula.ensemble(DOUBLE, 1.0, start, file=tmp_path / "a.h5", shard=(2, 2))
    assert_same(again, whole)
    pendula.ensemble(DOUBLE, 1.5, start, file=tmp_path / "c.h5", shard=(1, 2))
    with pytest.raises(
        pendula.InputError, match=r"c\.h5: expected a part of the ensemble that .*b\.h5 is of"
    ):
        pendula.merge([tmp_path / "b.h5", tmp_path / "c.h5"])


def test_shards_with_failures_are_merged(tmp_path):
    given = {"start": {"theta": 0.5}, "axes": {"chain.masses[1]": np.linspace(-1, 1, 100)}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        whole = pendula.ensemble(DOUBLE, 0.1, **given)
        parts = [tmp_path / f"{k}.h5" for k in range(3)]
        for k, part in enumerate(parts):
            pendula.ensemble(DOUBLE, 0.1, **given, file=part, shard=(k + 1, 3))
    assert_same(pendula.merge(parts), whole)


def test_files_that_are_none_are_named(tmp_path):
    (tmp_path / "text.h5").write_text("no")
    for name in ("text.h5", "none.h5"):
        with pytest.raises(
            pendula.InputError, match=f"{name}: expected a file of an ensemble that can be read"
        ):
            pendula.open_ensemble(tmp_path / name)
    with pytest.raises(pendula.InputError, match="files: expected one file or more"):
        pendula.merge([])


def test_a_file_that_is_replaced_is_told(tmp_path, capsys):
    for told in ("", f"pendula: replacing {tmp_path / 'x.h5'}\n"):
        pendula.ensemble(DOUBLE, 1.0, {"theta": np.ones((4, 2))}, file=tmp_path / "x.h5")
        assert capsys.readouterr().err == told


def test_an_interrupt_ends_it():
    def work():
        pendula.ensemble(DOUBLE, 1e6, {"theta": np.ones((64, 2))})

    assert interrupted(work) < 60  # of many minutes; measured 0.03


def test_an_interrupt_loses_nothing(tmp_path):
    def work(**more):
        return pendula.ensemble(
            DOUBLE,
            20.0,
            {"theta": (np.linspace(-1, 1, 40), np.linspace(-1, 1, 50))},
            file=tmp_path / "x.h5",
            estimate=False,
            method="radau",
            **more,
        )

    interrupted(work)
    part = pendula.open_ensemble(tmp_path / "x.h5")
    done = part["status"].values == 0
    assert done.sum() < 2000 and part.attrs["complete"] == 0
    with pytest.raises(pendula.InputError, match="expected resume=True"):
        work()
    interrupted(lambda: work(resume=True))
    more = pendula.open_ensemble(tmp_path / "x.h5")
    assert more.attrs["members_done"] >= done.sum()  # a busy machine has done none
    assert (more["theta_1"].values[done] == part["theta_1"].values[done]).all()


def test_other_threads_go_on_meanwhile():
    def work():
        pendula.ensemble(DOUBLE, 20.0, {"theta": np.full((4000, 2), 0.5)}, estimate=False)

    assert ticks_during(work) > 5  # measured 300 and more


def test_progress_is_shown(capsys, monkeypatch):
    start = {"theta": np.full((200, 2), 0.5)}
    pendula.ensemble(DOUBLE, 5.0, start, progress=True)
    assert "200/200" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    pendula.ensemble(DOUBLE, 5.0, start, progress=True)
    assert "200 of 200 members" in capsys.readouterr().err
    pendula.ensemble(DOUBLE, 5.0, start)
    assert capsys.readouterr().err == ""


# Members over time are runs by themselves, on grids, in lists and drawn.
def test_members_have_rows():
    times = np.linspace(0, 1, 6)
    data = pendula.ensemble(DOUBLE, t=times, theta=(GRID, 0.3), threads=2)
    assert data["theta_2"].dims == ("start_theta_1", "t") and data["theta_2"].shape == (GRID.size, 6)
    assert data["energy"].attrs["units"] == "J" and [*data.data_vars][:2] == ["status", "trusted"]
    for k, theta in enumerate(GRID):
        run = DOUBLE.simulate(t=times, theta=[theta, 0.3], tolerance=1e-9)
        for name in run.columns[1:]:
            assert np.array_equal(data[name].values[k], run[name]), name
    assert (data["status"] == 0).all() and (data["trusted"] == 1).all()
    event = {"low": {"when": "theta_1 - 0.05", "stop": True}}
    data = pendula.ensemble(
        DOUBLE, 2.0, {"theta": [[0.1, 0.0], [-0.04, 0.01]]}, t=times, events=event, keep="theta"
    )
    assert data["theta_1"].dims == ("member", "t") and "theta_dot_1" not in data
    assert data["status"].values.tolist() == [1, 0]
    assert np.isnan(data["theta_1"].values[0, -1]) and np.isfinite(data["theta_1"].values[1]).all()
    assert data["start_theta_2"].values.tolist() == [0.0, 0.01]
    drawn = pendula.ensemble(
        DOUBLE, t=times, theta=0.1, random={"chain.lengths[2]": ("uniform", 0.5, 2.0)}, members=3, seed=1
    )
    for k, length in enumerate(drawn["chain_lengths_2"].values):
        run = pendula.Chain(masses=[1, 1], lengths=[1, length]).simulate(t=times, theta=0.1, tolerance=1e-9)
        assert np.array_equal(drawn["x_2"].values[k], run["x_2"])
    with pytest.raises(pendula.InputError, match="t: expected neither file"):
        pendula.ensemble(DOUBLE, t=times, theta=[[0.1, 0.0]], file="a.h5")
    with pytest.raises(
        pendula.InputError, match="keep: expected columns of rows beside t, got thetas; did you mean"
    ):
        pendula.ensemble(DOUBLE, t=times, theta=[[0.1, 0.0]], keep="thetas")
    with pytest.raises(pendula.RunFailed, match="all 1 members failed"):
        pendula.ensemble(DOUBLE, t=times, theta=[[0.1, np.pi / 2]], theta_dot=[[1e200, 0]])


# As many numbers as links, as simulate takes them, are those of all members.
def test_a_start_of_each_link_is_that_of_all_members():
    axes = {"chain.lengths[1]": [1.0, 2.0]}
    data = pendula.ensemble(DOUBLE, 0.0, theta=[0.1, 0.2], axes=axes)
    assert data["theta_2"].values.tolist() == [0.2, 0.2]


def test_what_is_missing_is_named(monkeypatch, tmp_path):
    for name, extra, work in (
        ("xarray", "data", lambda: pendula.ensemble(DOUBLE, 0.1, {"theta": [[0, 0]]})),
        ("h5py", "data", lambda: pendula.open_ensemble(tmp_path / "x.h5")),
    ):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, name, None)
            with pytest.raises(
                ImportError, match=rf'expected {name}, which pip install "pendula\[{extra}\]"'
            ):
                work()


def test_a_map_is_drawn(tmp_path):
    data = pendula.ensemble(DOUBLE, 1.0, {"theta": (GRID, GRID[:3])}, keep=["final", "energy"])
    axes = pendula.map(data, "final:theta_2", contour=("energy_start", -20))
    image = axes.images[1].get_array()
    assert image.shape == (3, 5)
    assert (
        abs(image[2, 4] - data["theta_2"].values[4, 2]) < 1e-14
    )  # measured 1.1e-16: full turns are taken out
    uneven = pendula.ensemble(DOUBLE, 1.0, {"theta": ([0.0, 1.0, 0.1], GRID)})
    mesh = pendula.map(uneven, "theta_1", axes=axes).collections[-1]
    assert (
        np.abs(mesh.get_array()[:, 1] - uneven["theta_1"].values[2]).max() < 1e-14
    )  # of angles within a turn; 1e-16
    assert mesh.get_coordinates()[0, :, 0].tolist() == [-0.05, 0.05, 0.55, 1.45]
    with pytest.warns(pendula.TrustWarning, match="2 of 8 members failed"):
        failing = pendula.ensemble(
            DOUBLE, 1.0, {"theta": 0.5}, axes={"chain.masses[1]": [-1, 1, 3, 4], "run.duration": [0.5, 1]}
        )
    marks, numbers = pendula.map(failing, "theta_1").collections[:2]
    assert marks.get_array()[0].tolist() == [1, 0, 0, 0] and numbers.get_array().mask[0].tolist() == [
        1,
        0,
        0,
        0,
    ]
    curve = pendula.ensemble(DOUBLE, 1.0, {"theta": (GRID, 0)})
    assert pendula.map(curve, "theta_1").lines[0].get_ydata().tolist() == curve["theta_1"].values.tolist()
    for wrong, message in (
        (lambda: pendula.map(data, "theta_3"), 'data: expected one of .*, got "theta_3"'),
        (lambda: pendula.map(data, "theta_1", scale="loga"), 'scale: expected "log" or "linear"'),
        (lambda: pendula.map(xarray.Dataset(), "x"), "data: expected the dataset of an ensemble"),
        (
            lambda: pendula.map(pendula.ensemble(DOUBLE, 0.1, {"theta": [[0, 0]]}), "theta_1"),
            "data: expected one axis or two, got member",
        ),
        (
            lambda: pendula.map(pendula.ensemble(DOUBLE, 0.1, {"theta": ([0, 1, 0], GRID)}), "theta_1"),
            "expected different values of start.theta.1., got one twice",
        ),
    ):
        with pytest.raises(pendula.InputError, match=message):
            wrong()


def test_a_worker_that_dies_loses_nothing():
    distributed = pytest.importorskip("distributed")
    start = {"theta": np.random.default_rng(1).uniform(-2, 2, (1500, 2))}
    given = {"tolerance": 1e-11, "estimate": False, "seed": 1}
    whole = pendula.ensemble(DOUBLE, 10.0, start, **given)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        victim = next(iter(client.run(os.getpid).values()))
        killed = []

        class Telling:
            """A client whose first worker dies when the first results are there."""

            def __getattr__(self, name):
                return getattr(client, name)

            def submit(self, *words, **more):
                future = client.submit(*words, **more)
                future.add_done_callback(
                    lambda _: killed or (killed.append(1), os.kill(victim, signal.SIGKILL))
                )
                return future

        assert_same(pendula.ensemble(DOUBLE, 10.0, start, client=Telling(), **given), whole)
        assert killed and victim not in client.run(os.getpid).values()
        with pytest.raises(pendula.InputError, match=r"expected workers with pendula .* for another, got"):
            client.submit(Work.make, Work("", "", (), "", ("0", "another"))).result()


def test_workers_need_no_file_of_a_model(tmp_path):
    file = tmp_path / "osc.py"
    text = "def define(model, links):\n    x = model.coordinate('x', 'm')\n"
    text += "    model.lagrangian = model.rate(x)**2/2 - 2*x**2\n    model.point('p', (x, 0*x))\n"
    file.write_text(text)
    scenario = (
        f'system = {{model = "{file}"}}\nrun = {{duration = 1.0}}\nensemble = {{list = [{{key = "start.x", '
    )
    scenario += "values = [1, 2]}]}\n"
    made = _core.Ensemble(scenario, "pendula", [], "", *places(), tell)
    beginning = Work.of(made, scenario, "pendula", [])
    file.unlink()
    rows, messages = beginning.make().chunk(0)
    here, _ = made.chunk(0)
    assert rows.tobytes() == here.tobytes() and not messages


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
def test_examples_are_ensembles():
    scenario = Path(__file__).parents[2] / "examples/flip_map.toml"
    few = {"run.duration": 3.0, "ensemble.axis[1].count": 9, "ensemble.axis[2].count": 5}
    data = pendula.Scenario(scenario, few).ensemble()
    assert data["event_flip"].shape == (9, 5) and data["event_flip"].attrs["units"] == "s"


MACHINE = {"r": np.array([1.0, 1.1]), "theta": np.array([0.3, 0.5])}


@pytest.mark.parametrize(
    "given",
    [
        {"start": MACHINE},
        {"start": {"r": 1.0, "theta": ([0.3, 0.5],)}},
        {"start": {"theta": 0.5}, "axes": {"start.r": [1.0, 1.1]}},
        {"start": {"theta": 0.5}, "random": {"start.r": ("uniform", 0.0, 2.0)}, "members": 2, "seed": 1},
    ],
)
def test_a_model_needs_no_start_where_all_is_zero(given):
    """A swinging Atwood machine whose thread has no length has no inertia."""
    data = pendula.ensemble(pendula.Model("swinging_atwood"), 1.0, **given)
    assert (data.status == 0).all() and data.r.size == 2


def test_members_that_differ_in_starts_alone_are_those_that_differ_in_more():
    """They are read once, others one by one."""
    double = pendula.Chain(masses=[1, 2], lengths=[1, 0.5])
    grid = {"start.theta[1]": [0.1, 0.2], "start.theta_dot[2]": [0.0, 0.5, 1.0]}
    shared = pendula.ensemble(double, 2.0, {"theta_2": 0.3}, axes=grid)
    each = pendula.ensemble(double, 2.0, {"theta_2": 0.3}, axes={**grid, "chain.gravity": [9.81]})
    for name in ("theta_1", "theta_2", "theta_dot_1", "theta_dot_2", "energy_error", "steps"):
        assert (shared[name].values == each[name].values[..., 0]).all(), name
