"""Ensembles: the same bytes whoever moves the members, and nothing lost whatever ends them."""

import os
import random
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from conftest import Result, program
from damage import draws

MAP = """\
[chain]
space   = "planar"
masses  = [1.0, 1.0]
lengths = [1.0, 1.0]

[start]
theta = [0.0, 0.0]

[run]
duration  = 4.0
tolerance = 1e-6

[[event]]
name      = "flip"
when      = "abs(theta_2) - pi"
direction = "up"

[[ensemble.axis]]
key   = "start.theta[1]"
from  = -3.0
to    = 3.0
count = 31

[[ensemble.axis]]
key   = "start.theta[2]"
from  = -2.9
to    = 2.9
count = 17
"""

DRAWN = """\
[chain]
space   = "spatial"
masses  = [1.0, 1.0]
lengths = 1.0

[start]
theta = [1.0, 2.0]
phi   = [0.0, 0.5]

[run]
duration = 1.0

[[ensemble.random]]
key  = "start.theta[2]"
from = 1.0
to   = 3.0

[[ensemble.random]]
key       = "chain.masses[1]"
mean      = 1.0
deviation = 0.1

[ensemble]
count = 300
seed  = 7
keep  = ["final", "points", "energy", "energy_error", "steps"]
"""

MEMBERS = 31 * 17


def command(folder: Path, *arguments: str, scenario: str = MAP) -> list[str]:
    (folder / "scenario.toml").write_text(scenario)
    return [program(), "ensemble", "scenario.toml", "-o", "out.h5", *arguments]


def run(folder: Path, *arguments: str, scenario: str = MAP, before: tuple = (), **options) -> Result:
    done = subprocess.run(
        [*before, *command(folder, *arguments, scenario=scenario)],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False, **options,
    )  # fmt: skip
    return Result(done.returncode, done.stdout, done.stderr)


def contents(file: Path) -> dict[str, bytes]:
    """The bytes of every data set."""
    with h5py.File(file) as opened:
        assert opened.attrs["complete"] == 1
        return {name: opened[name][...].tobytes() for name in opened}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    done = run(folder, "--threads", "1", "--json")
    assert done.status == 0, done.err
    assert done.json["members_done"] == MEMBERS
    assert not (folder / "out.h5.parts").exists()
    return contents(folder / "out.h5")


def test_threads_do_not_matter(whole, tmp_path):
    assert run(tmp_path, "--threads", "3").status == 0
    assert contents(tmp_path / "out.h5") == whole


def test_shards_share_a_file(whole, tmp_path):
    for shard in ("2/3", "3/3"):
        done = run(tmp_path, "--shard", shard)
        assert done.status == 3
        assert "are missing; to go on, say the same with --resume" in done.err
        with h5py.File(tmp_path / "out.h5") as opened:
            assert opened.attrs["complete"] == 0
            assert (opened["status"][...] == -1).sum() == MEMBERS - opened.attrs["members_done"]
    assert run(tmp_path, "--shard", "1/3").status == 0
    assert contents(tmp_path / "out.h5") == whole


@pytest.mark.skipif(not shutil.which("mpirun"), reason="no mpirun here")
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_do_not_matter(whole, tmp_path, ranks):
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    mpirun = ("mpirun", "--oversubscribe", "-n", str(ranks))
    done = run(tmp_path, "--json", before=mpirun, env=os.environ | allowed)
    assert done.status == 0, done.err
    assert done.json["ranks"] == ranks
    assert contents(tmp_path / "out.h5") == whole


def test_killed_at_any_time_it_goes_on(whole, tmp_path):
    """Kills at random moments, some of them while the file is written; tests/campaign/damages.py draws more."""
    resume: tuple[str, ...] = ()
    for _, draw in draws(25):
        process = subprocess.Popen(
            command(tmp_path, "--threads", "2", *resume),
            cwd=tmp_path,
            stderr=subprocess.PIPE,
            text=True,
        )
        time.sleep(draw.uniform(0.005, 0.15))
        process.kill()
        process.communicate()
        if (tmp_path / "out.h5").exists() and not (tmp_path / "out.h5.parts").exists():
            assert contents(tmp_path / "out.h5") == whole  # it was done: begin anew
            (tmp_path / "out.h5").unlink()
        resume = ("--resume",) if (tmp_path / "out.h5.parts").exists() else ()
    assert run(tmp_path, *resume).status == 0
    assert contents(tmp_path / "out.h5") == whole
    assert {file.name for file in tmp_path.iterdir()} == {"scenario.toml", "out.h5"}


def test_asked_to_end_it_leaves_what_it_has(whole, tmp_path):
    process = subprocess.Popen(
        command(tmp_path, "--threads", "1", "--set", "run.duration=400"),
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    journals = (tmp_path / "out.h5.parts").glob
    while process.poll() is None and not any(file.stat().st_size > 2000 for file in journals("*.journal")):
        time.sleep(0.005)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 3
    assert "members are missing; to go on, say the same with --resume" in err
    with h5py.File(tmp_path / "out.h5") as opened:
        done = opened["status"][...] >= 0
        assert 0 < done.sum() == opened.attrs["members_done"] < MEMBERS
        assert np.isfinite(opened["theta_2"][...][done]).all()
        assert np.isnan(opened["theta_2"][...][~done]).all()
    refused = run(tmp_path, "--set", "run.duration=400")
    assert refused.status == 2
    assert "expected --resume" in refused.err
    other = run(tmp_path, "--resume")  # without --set: another ensemble
    assert other.status == 2
    assert "expected the journals of this ensemble" in other.err


def test_a_journal_that_was_cut_short_is_made_whole(whole, tmp_path):
    assert run(tmp_path, "--shard", "1/2").status == 3
    journal = max(
        (tmp_path / "out.h5.parts").glob("*.journal"),
        key=lambda file: file.stat().st_size,
    )
    text = journal.read_bytes()
    journal.write_bytes(text[:-5])
    broken = bytearray(text)
    broken[len(text) // 2] ^= 1  # a disk that lies
    journal.with_name("copy.journal").write_bytes(broken)
    assert run(tmp_path, "--resume").status == 0
    assert contents(tmp_path / "out.h5") == whole


@pytest.mark.parametrize("left", [None, b"", b"pendula jour"])
def test_killed_before_its_journal_said_anything(whole, tmp_path, left):
    (tmp_path / "out.h5.parts").mkdir()
    if left is not None:
        (tmp_path / "out.h5.parts" / "7-0.journal").write_bytes(left)
    assert run(tmp_path, "--resume").status == 0
    assert contents(tmp_path / "out.h5") == whole


def test_shards_that_end_at_once_make_one_whole_file(whole, tmp_path):
    for _ in range(5):
        # The scenario is written before the first of them begins to read it.
        commands = [command(tmp_path, "--threads", "1", "--shard", f"{k}/4") for k in range(1, 5)]
        shards = [subprocess.Popen(words, cwd=tmp_path) for words in commands]
        ends = [shard.wait(timeout=120) for shard in shards]
        assert set(ends) <= {0, 3} and 0 in ends
        assert contents(tmp_path / "out.h5") == whole
        assert not (tmp_path / "out.h5.parts").exists()
        again = run(tmp_path, "--shard", "2/4")  # a job array that is sent once more
        assert (again.status, again.out) == (0, "")
        assert contents(tmp_path / "out.h5") == whole
        (tmp_path / "out.h5").unlink()


@pytest.mark.skipif(not shutil.which("mpirun"), reason="no mpirun here")
def test_a_rank_that_fails_ends_the_job_and_loses_nothing(whole, tmp_path):
    """One of two ranks runs in a folder where it cannot make its journal. (mpirun 5.0.7 crashes where two commands make
    one job, and where a rank has a small limit on its files.)"""
    astray = tmp_path / "astray"
    astray.mkdir()
    (astray / "out.h5.parts").touch()
    go_astray = (
        'if [ "${OMPI_COMM_WORLD_RANK-$PMI_RANK}" = 1 ]; then cp *.toml astray; cd astray; fi; exec "$@"'
    )
    before = ("mpirun", "--oversubscribe", "-n", "2", "bash", "-c", go_astray, "bash")
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = run(tmp_path, before=before, env=os.environ | allowed)
    assert done.status != 0
    assert "rank 1: out.h5.parts: expected a folder for the journals, or nothing, got a file" in done.err
    assert run(tmp_path, "--resume").status == 0
    assert contents(tmp_path / "out.h5") == whole


LAUNCHED = {
    "Open MPI": {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"},
    "MPICH": {"PMI_SIZE": "2", "PMI_RANK": "0"},
    "Slurm": {"SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "0"},
    "a second rank": {"PMIX_RANK": "1"},
}


def without_mpi(folder: Path, launcher: dict[str, str], *arguments: str) -> Result:
    """What a build without MPI says, which a launcher has started."""
    words = [os.environ["PENDULA_WITHOUT_MPI"], *command(folder, *arguments)[1:]]
    done = subprocess.run(words, cwd=folder, env=os.environ | launcher, capture_output=True, text=True)
    return Result(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize("name", LAUNCHED)
def test_ranks_that_do_not_know_of_each_other_are_refused(name, tmp_path):
    refused = without_mpi(tmp_path, LAUNCHED[name])
    assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "this build of pendula does not know MPI" in refused.err
    assert (
        "build again with -DPENDULA_MPI=ON, or give each process a part of its own by --shard I/N"
        in refused.err
    )
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize("launcher", [{"OMPI_COMM_WORLD_SIZE": "1", "PMIX_RANK": "0"}, {"SLURM_NTASKS": "8"}])
def test_one_process_needs_no_mpi(launcher, whole, tmp_path):
    assert without_mpi(tmp_path, launcher).status == 0
    assert contents(tmp_path / "out.h5") == whole


def test_ranks_with_a_shard_each_need_no_mpi(tmp_path):
    assert without_mpi(tmp_path, LAUNCHED["Slurm"], "--shard", "1/8").status == 3


def test_natural_units_are_named(tmp_path):
    scenario = MAP.replace("[start]", 'units = "natural"\n\n[start]').replace(
        "start.theta[2]", "chain.masses[2]"
    )
    scenario = scenario.replace("from  = -2.9", "from  = 0.1")
    assert run(tmp_path, scenario=scenario).status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        for name, unit in {"chain_masses_2": "M_1", "t": "sqrt(l_1/g)"}.items():
            assert opened[name].attrs["natural_unit"] == unit
            assert opened[name].attrs["units"] == "1"  # what udunits knows


def test_a_complete_one_is_left_alone(tmp_path):
    assert run(tmp_path).status == 0
    before = (tmp_path / "out.h5").stat().st_mtime_ns
    again = run(tmp_path, "--resume")
    assert (again.status, (tmp_path / "out.h5").stat().st_mtime_ns) == (0, before)
    assert "has all members already" in again.err


def test_xarray_opens_it_with_names(tmp_path):
    run(tmp_path)
    opened = xarray.open_dataset(tmp_path / "out.h5", engine="h5netcdf")
    assert opened["event_flip"].dims == ("start_theta_1", "start_theta_2")
    assert opened["event_flip"].attrs["units"] == "s"
    assert opened["start_theta_1"].attrs["units"] == "rad"
    assert opened["start_theta_1"].values[[0, -1]].tolist() == [-3, 3]
    assert opened["steps"].dtype == np.int64
    meanings = opened["status"].attrs["flag_meanings"].split()
    assert meanings[:3] == ["not_run", "ok", "stopped_by_event"]
    assert len(meanings) == len(opened["status"].attrs["flag_values"])
    assert opened["trusted"].attrs["flag_meanings"] == "not_looked_at no yes"
    assert opened["trusted"].attrs["flag_values"].tolist() == [-1, 0, 1]
    assert opened["trusted"].attrs["flag_values"].dtype == opened["trusted"].dtype


STEADY = MAP.replace("tolerance = 1e-6", 'step = 5e-3\nstages = 4\nsolver = "chain"')
CHOSEN = MAP.replace("tolerance = 1e-6", 'tolerance = 1e-6\nsolver = "chain"\niteration = "fixed-point"')
DENSE = MAP.replace("tolerance = 1e-6", 'tolerance = 1e-6\nsolver = "dense"')
NEWTON = DRAWN.replace("duration = 1.0", 'duration = 1.0\ntolerance = 1e-9\niteration = "newton"')


# In lanes to rounding, seen: 3e-15 and, by chosen steps, 2e-13; without the tension of a chain that hangs, in steps
# that do not resolve it, 3e-9. Alone to the last bit.
@pytest.mark.parametrize(
    ("scenario", "within"),
    [(STEADY, 1e-12), (CHOSEN, 1e-9), (DENSE, 0), (NEWTON, 0)],
    ids=["constant steps in lanes", "chosen steps in lanes", "dense", "newton"],
)
def test_a_member_is_what_simulate_makes_of_it(tmp_path, scenario, within):
    assert run(tmp_path, scenario=scenario).status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        status = opened["status"][...]
        for member in random.Random(1).sample(range(status.size), 5):
            place = np.unravel_index(member, status.shape)
            if status.ndim == 2:
                places = dict(zip(["start_theta_1", "start_theta_2"], place, strict=True))
            else:
                places = dict.fromkeys(("start_theta_2", "chain_masses_1"), place)
            keys = {opened[name].attrs["long_name"]: opened[name][k] for name, k in places.items()}
            changes = [part for key, value in keys.items() for part in ("--set", f"{key}={float(value)!r}")]
            rows = ["simulate", "scenario.toml", "-o", "member.csv", "--quiet"]
            subprocess.run([program(), *rows, *changes], cwd=tmp_path, check=True)
            lines = (tmp_path / "member.csv").read_text().splitlines()
            last = dict(zip(lines[0].split(","), map(float, lines[-1].split(",")), strict=True))
            for name, value in last.items():
                if name in opened:
                    assert abs(opened[name][place] - value) <= within, (member, name)


def test_the_method_may_be_left_open(tmp_path):
    """Taylor series, to the same ends, whatever is looked for on the way, where nothing names another method."""
    calm = (
        MAP.replace("from  = -2.9", "from  = -0.5")
        .replace("to    = 2.9", "to    = 0.5")
        .replace("3.0", "0.5")
    )
    unwatched = calm.replace(calm[calm.index("[[event]]") : calm.index("[[ens")], "")
    for scenario in (calm, unwatched):
        found = {}
        for setting in ("run.method=gauss", "run.method=auto", "ensemble.method=auto"):
            assert run(tmp_path, "--set", setting, scenario=scenario).status == 0
            with h5py.File(tmp_path / "out.h5") as opened:
                found[setting] = {name: opened[name][...] for name in ("theta_1", "theta_2", "steps")}
            (tmp_path / "out.h5").unlink()
        gauss, chosen, told = found.values()
        assert (chosen["steps"] != gauss["steps"]).any()
        for name in ("theta_1", "theta_2"):
            # seen: 1.3e-6, of a tolerance of 1e-6
            assert np.abs(chosen[name] - gauss[name]).max() < 1e-5
            assert (chosen[name] == told[name]).all()
    assert 'ensemble.method: expected "run" or "auto"' in run(tmp_path, "--set", "ensemble.method=rk4").err


def test_draws_are_those_of_the_seed(tmp_path):
    """Uniform and normal as asked for, to three standard errors of 300; another seed gives others."""
    assert run(tmp_path, scenario=DRAWN).status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        theta, mass = opened["start_theta_2"][...], opened["chain_masses_1"][...]
        assert {"energy_start", "energy", "x_2", "steps"} <= set(opened)
        assert np.allclose(opened["energy"][...], opened["energy_start"][...], rtol=0, atol=1e-6)
    assert (theta.min(), theta.max()) == pytest.approx((1, 3), abs=0.05)
    assert theta.mean() == pytest.approx(2, abs=3 * 2 / np.sqrt(12 * 300))
    assert mass.mean() == pytest.approx(1, abs=3 * 0.1 / np.sqrt(300))
    assert mass.std() == pytest.approx(0.1, abs=3 * 0.1 / np.sqrt(600))
    assert abs(np.corrcoef(theta, mass)[0, 1]) < 3 / np.sqrt(300)
    assert run(tmp_path, "--set", "ensemble.seed=8", scenario=DRAWN).status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        assert not np.isin(theta, opened["start_theta_2"][...]).any()


def test_a_member_that_cannot_be_moved_loses_nobody_else(tmp_path):
    scenario = MAP.replace(
        'key   = "start.theta[2]"\nfrom  = -2.9',
        'key   = "chain.masses[2]"\nfrom  = -2.9',
    )
    done = run(tmp_path, scenario=scenario)
    assert done.status == 0
    assert (
        "warning: 279 of 527 members failed; the first, member 0: scenario.toml: ensemble: chain.masses[2]=-2.9"
        in done.err
    )
    with h5py.File(tmp_path / "out.h5") as opened:
        mass, status = opened["chain_masses_2"][...], opened["status"][...]
        names = opened["status"].attrs["flag_meanings"].split()
        assert (status[:, mass <= 0] == names.index("wrong_input") - 1).all()
        assert (status[:, mass > 0] == 0).all()
        assert len(opened["message"]) == 279
        assert opened["failed_member"][0] == 0
        assert b"chain.masses[2]: expected" in opened["message"][0]


def test_exponents_are_kept(pendula, tmp_path):
    scenario = MAP.replace("count = 31", "count = 3").replace("count = 17", "count = 2")
    keep = 'ensemble.keep=["lyapunov", "ftle", "megno"]'
    done = run(tmp_path, "--set", keep, "--set", "run.duration=20", scenario=scenario)
    assert done.status == 0, done.err
    with h5py.File(tmp_path / "out.h5") as opened:
        exponent, error = opened["lyapunov"][...], opened["lyapunov_error"][...]
        ftle, megno = opened["ftle"][...], opened["megno"][...]
        assert opened["lyapunov"].attrs["units"] == opened["ftle"].attrs["units"] == "1/s"
        axes = [opened[name] for name in ("start_theta_1", "start_theta_2")]
        start = [f"{axis.attrs['long_name']}={float(axis[0])!r}" for axis in axes]
    assert (error > 0).all()
    assert exponent[0].max() > 0.5  # from upside down it is chaotic
    change = [word for each in (*start, "run.duration=20") for word in ("--set", each)]
    alone = pendula("lyapunov", "scenario.toml", *change, "--count", "1", "--json").json
    assert (ftle[0, 0], megno[0, 0]) == (alone["ftle"], alone["megno"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("count = 31", "count = 0"), "ensemble.axis[1].count: expected an integer"),
        (("key   = \"start.theta[2]\"", "key   = \"start.theta[1]\""), "expected another key than start.theta[1]"),
        (("key   = \"start.theta[2]\"", "key   = \"start.theta[3]\""), "theta[3]: expected an array of at least 3"),
        (("key   = \"start.theta[2]\"", "key   = \"start.thetta\""), "start.thetta: expected one of"),
        (("from  = -2.9", "form  = -2.9"), 'got the unknown key "form"'),
        (("[[ensemble.axis]]", "[[ensemble.axes]]"), 'got the unknown key "axes"'),
        (("[run]", "[ensemble]\ncount = 5\n[run]"), "ensemble.count: expected a count of each axis"),
        (("[run]", "[ensemble]\nkeep = [\"all\"]\n[run]"), 'expected some of final, points'),
        (("start.theta[1]", "start.thetas[1]"), "scenario.toml: ensemble: start.thetas[1]="),
        (("[run]", "[run]\nmethod = \"eulr\""), 'run.method: expected "gauss" or'),
    ],
)  # fmt: skip
def test_wrong_tables_are_told(tmp_path, change, message):
    done = run(tmp_path, scenario=MAP.replace(*change))
    assert done.status == 2
    assert message in done.err
    assert "scenario.toml:" in done.err
    assert not (tmp_path / "out.h5").exists()
    assert not (tmp_path / "out.h5.parts").exists()


def test_files_that_cannot_be_written(tmp_path):
    (tmp_path / "out.h5").mkdir()
    assert "out.h5: expected a file that can be written, got: a folder" in run(tmp_path).err
    done = subprocess.run(
        [program(), "ensemble", "scenario.toml", "-o", "nowhere/out.h5"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "nowhere/ does not exist" in done.stderr


def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "out.h5")
    assert "expected a file that can be written, got: a device, a pipe or a socket" in run(tmp_path).err
    assert (tmp_path / "out.h5").is_fifo()


def test_threads_are_counted(tmp_path):
    for count in ("0", "1025", "1000000"):
        wrong = run(tmp_path, "--threads", count)
        assert wrong.status == 2 and "expected a whole number of threads, from 1 to 1024" in wrong.err


def test_an_axis_may_be_a_key_of_a_drive(tmp_path):
    driven = MAP.replace(
        "[start]",
        "[[chain.drive]]\nlink = 1\namplitude = 1.0\nfrequency = 2.0\n\n[start]",
    )
    driven = driven.replace('"start.theta[1]"\nfrom  = -3.0', '"chain.drive[1].amplitude"\nfrom  = 0.0')
    done = run(tmp_path, "--set", "start.theta=[1.0, 0.0]", scenario=driven)
    assert done.status == 0, done.err
    with h5py.File(tmp_path / "out.h5") as opened:
        amplitudes = opened["chain_drive_1_amplitude"]
        assert amplitudes.attrs["units"] == "N m"
        assert amplitudes[...].tolist() == pytest.approx(list(np.linspace(0, 3, 31)))
        ends = opened["theta_1"][...]
    assert len(np.unique(ends[:, 0])) == 31


def test_values_of_axes_and_of_members_may_be_listed(tmp_path):
    values = [0.1, 2.0, -1.5]
    assert (
        run(
            tmp_path, scenario=MAP.replace("from  = -3.0\nto    = 3.0\ncount = 31", f"values = {values}")
        ).status
        == 0
    )
    with h5py.File(tmp_path / "out.h5") as opened:
        assert opened["start_theta_1"][...].tolist() == values
        second = opened["start_theta_2"][...].tolist()
        grid = opened["theta_1"][...]
    (tmp_path / "out.h5").unlink()
    listed = MAP[: MAP.index("[[ensemble.axis]]")]
    pairs = [(a, b) for a in values for b in second]
    for k in (0, 1):
        listed += f'[[ensemble.list]]\nkey = "start.theta[{k + 1}]"\nvalues = {[pair[k] for pair in pairs]}\n'
    listed += '[[ensemble.random]]\nkey = "chain.gravity"\nmean = 9.81\ndeviation = 0\n'
    assert run(tmp_path, scenario=listed).status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        assert opened["start_theta_1"][...].tolist() == [a for a, _ in pairs]
        assert (opened["chain_gravity"][...] == 9.81).all()
        assert opened["theta_1"][...].tolist() == grid.ravel().tolist()


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ('axis = [{key = "start.theta[1]", values = []}]', "values: expected an array of finite numbers"),
        (
            'axis = [{key = "start.theta[1]", values = [1, nan]}]',
            "values[2]: expected a finite number or a string in rad or deg, got nan",
        ),
        (
            'axis = [{key = "start.theta[1]", values = [1], count = 1}]',
            "count: expected nothing beside values",
        ),
        (
            'list = [{key = "start.theta[1]", values = [1, 2]}]\ncount = 2',
            "count: expected a count of each list",
        ),
        (
            'list = [{key = "start.theta[1]", values = [1, 2]}, {key = "start.theta[2]", values = [1]}]',
            "ensemble.list[2].values: expected as many values as start.theta[1] has, 2, got 1",
        ),
        (
            'list = [{key = "start.theta[1]", values = [1]}]\n'
            'axis = [{key = "start.theta[2]", values = [1]}]',
            "expected either [[ensemble.axis]], or [[ensemble.random]] and [[ensemble.list]], got both",
        ),
    ],
)
def test_wrong_lists_are_told(tmp_path, tables, message):
    done = run(tmp_path, scenario=MAP[: MAP.index("[[ensemble.axis]]")] + "[ensemble]\n" + tables + "\n")
    assert done.status == 2
    assert message in done.err


# Chaotic, then at rest: members end after other numbers of whole turns by other tolerances.
SETTLING = """\
[chain]
space   = "planar"
masses  = [1.0, 1.0]
lengths = [1.0, 1.0]
damping = [0.05, 0.05]

[start]
theta = [2.5, 2.5]

[run]
duration  = 1500.0
tolerance = 1e-9

[[event]]
name = "high"
when = "y_2 + 0.5"

[[ensemble.axis]]
key   = "start.theta[1]"
from  = 2.2
to    = 3.0
count = 5
"""


def trusted(folder: Path, *arguments: str, scenario: str) -> tuple[np.ndarray, dict[str, np.ndarray], dict]:
    """Whether each member is, its numbers, and the summary."""
    (folder / "out.h5").unlink(missing_ok=True)
    done = run(folder, *arguments, "--json", scenario=scenario)
    assert done.status == 0, done.err
    with h5py.File(folder / "out.h5") as opened:
        numbers = {name: opened[name][...].ravel() for name in opened}
    return numbers.pop("trusted"), numbers, done.json


@pytest.mark.parametrize("method", ["gauss", "radau", "fehlberg78"])  # one by one; the last one in lanes
def test_members_that_are_wrong_are_not_trusted(tmp_path, method):
    told, found, summary = trusted(tmp_path, "--set", f"run.method={method}", scenario=SETTLING)
    _, right, _ = trusted(tmp_path, "--set", "run.tolerance=1e-13", scenario=SETTLING)
    wrong = np.abs(found["theta_2"] - right["theta_2"]) > 1
    assert wrong.any()
    assert (told[wrong] == 0).all()
    assert (summary["looked_at"], summary["untrusted"]) == (5, (told == 0).sum())
    first = np.flatnonzero(told == 0)[0]
    key = f"start.theta[1]={found['start_theta_1'][first]:.6g}"
    (warning,) = summary["warnings"]
    assert warning.startswith(f"of 5 members that were looked at again {(told == 0).sum()} cannot be trusted")
    assert f"the first, member {first}: {key}" in warning


def test_events_that_other_runs_do_not_find_are_not_trusted(tmp_path):
    """Thresholds a little below where the pendulum is let go from: it comes back there twice in each swing, and by a
    coarse tolerance not as high. Far below it does."""
    scenario = """\
event = [{name = "high", when = "theta_1 - 0.99999999"}]
chain = {space = "planar", masses = [1.0], lengths = [1.0]}
start = {theta = [1.0]}
run = {duration = 20.0, tolerance = 1e-4}
ensemble = {axis = [{key = "start.theta[1]", from = 1.0, to = 1.1, count = 2}]}
"""
    told, found, _ = trusted(tmp_path, scenario=scenario)
    _, right, _ = trusted(tmp_path, "--set", "run.tolerance=1e-12", scenario=scenario)
    assert right["event_high_count"].tolist() == [19, 19]
    assert found["event_high_count"][0] < 19
    assert found["event_high_count"][1] == 19
    # seen: 1e-5
    assert np.abs(found["theta_1"] - right["theta_1"]).max() < 1e-4
    assert told.tolist() == [0, 1]


CALM = MAP.replace("3.0", "0.3").replace("from  = -2.9", "from  = -0.2").replace("to    = 2.9", "to    = 0.2")


@pytest.mark.parametrize(
    "change",
    ["run.method=gauss", "run.step=5e-3", "ensemble.method=auto", "run.method=dopri5", "run.method=radau",
     "run.solver=dense", "run.accuracy=1e-8"],
)  # fmt: skip
def test_members_that_are_right_are_trusted(tmp_path, change):
    few = CALM.replace("count = 31", "count = 5").replace("count = 17", "count = 5")
    without = () if change.split("=")[0] not in ("run.step", "run.accuracy") else ("--set", "run.tolerance=")
    told, _, summary = trusted(tmp_path, "--set", change, *without, scenario=few)
    assert (told == 1).all()
    assert (summary["looked_at"], summary["untrusted"], summary["warnings"]) == (25, 0, [])


def test_of_many_members_some_are_looked_at_again(whole, tmp_path):
    told, _, summary = trusted(tmp_path, scenario=MAP)
    assert told.tobytes() == whole["trusted"]
    looked_at = (told >= 0).reshape(31, 17)
    assert looked_at.sum() == summary["looked_at"]
    assert 240 <= looked_at.sum() <= 272  # 256, in eights
    assert looked_at.any(axis=0).all() and looked_at.any(axis=1).all()


def test_nobody_is_looked_at_again_where_that_is_not_wanted(tmp_path):
    told, _, summary = trusted(tmp_path, "--set", "run.estimate=false", scenario=SETTLING)
    assert (told == -1).all()
    assert (summary["looked_at"], summary["untrusted"], summary["warnings"]) == (0, 0, [])


def test_second_looks_that_are_interrupted_are_taken_again(tmp_path):
    """One by one, whose second looks take about as long as the runs."""
    one_by_one = ("--threads", "1", "--set", "run.method=radau", "--set", "run.duration=200")
    began = time.monotonic()
    assert run(tmp_path, *one_by_one, scenario=SETTLING).status == 0
    taken = time.monotonic() - began
    whole = contents(tmp_path / "out.h5")
    (tmp_path / "out.h5").unlink()
    words = command(tmp_path, *one_by_one, scenario=SETTLING)
    moments = random.Random(5)
    resume: tuple[str, ...] = ()
    while True:
        process = subprocess.Popen([*words, *resume], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        time.sleep(moments.uniform(0.1, 0.5) * taken)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        if process.returncode == 0:
            break
        resume = ("--resume",) if (tmp_path / "out.h5.parts").exists() else ()
    assert contents(tmp_path / "out.h5") == whole


def test_what_failed_is_neither_trusted_nor_not(tmp_path):
    scenario = SETTLING.replace("start.theta[1]", "chain.masses[1]").replace("2.2", "-1.0")
    told, found, _ = trusted(tmp_path, "--set", "run.duration=1", scenario=scenario)
    assert (found["chain_masses_1"] <= 0).tolist() == (told == -1).tolist() == [True] * 2 + [False] * 3


def test_a_full_disk_loses_nothing(whole, tmp_path):
    """A limit on the size of files stands for it; what the journal has by then is there when there is room again."""
    limit = 20_000

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = run(tmp_path, "--threads", "1", preexec_fn=limited)
    assert done.status == 1
    assert "could not be written: File too large" in done.err
    kept = sum(file.stat().st_size for file in (tmp_path / "out.h5.parts").glob("*.journal"))
    assert kept >= limit - 2000
    assert run(tmp_path, "--resume").status == 0
    assert contents(tmp_path / "out.h5") == whole


def test_no_member_within_the_curve_flips(tmp_path):
    """Two equal links at rest within 2 cos θ₁ + cos θ₂ = 1 have no energy for the second one to go over the top."""
    assert run(tmp_path, "--set", "run.duration=20").status == 0
    with h5py.File(tmp_path / "out.h5") as opened:
        first, second = (opened[f"start_theta_{k}"][...] for k in (1, 2))
        flips = np.isfinite(opened["event_flip"][...])
    within = 2 * np.cos(first)[:, None] + np.cos(second)[None] > 1
    assert 100 < within.sum() < MEMBERS - 100
    assert not flips[within].any()
    assert flips[~within].mean() > 0.8
