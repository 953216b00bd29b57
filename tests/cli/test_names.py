"""One rule for names: of files by their endings, of keys that go, of numbers in every summary, of commands."""

import h5py
import pytest
from conftest import DOUBLE, settings

EVENT = '\n[[event]]\nname = "low"\nwhen = "y_2 + 1.5"\n'


@pytest.mark.parametrize("name", ["out.h5", "out.hdf5", "out.nc"])
def test_three_endings_are_one_format(pendula, double, tmp_path, name):
    assert pendula("simulate", double, "-o", name).status == 0
    with h5py.File(tmp_path / name) as run:
        assert run["theta"].shape == (201, 2)


@pytest.mark.parametrize(
    "name", ["out.npz", "out.csv.gz", "out.H5", "out.CSV", "out", "out.txt", "h5", "out.h5/"]
)
def test_any_other_ending_is_refused_with_the_list(pendula, double, tmp_path, name):
    run = pendula("simulate", double, "-o", name)
    assert (run.status, run.out) == (2, "")
    expected = "expected a name that ends in .csv, or in .h5, .hdf5 or .nc (HDF5), or - for standard output"
    assert run.err == f"pendula: {name}: {expected}\n"
    assert list(tmp_path.iterdir()) == [double]


def test_a_device_has_no_ending(pendula, double):
    assert pendula("simulate", double, "-o", "/dev/null", "--quiet").status == 0


@pytest.mark.parametrize("name", ["hits.h5", "hits.txt", "hits", "hits.csv.gz", "-"])
def test_events_go_to_csv_only(pendula, double, tmp_path, name):
    double.write_text(DOUBLE + EVENT)
    run = pendula("simulate", double, "--events", name)
    assert (run.status, run.out) == (2, "")
    assert run.err.startswith(f"pendula: {name}: expected a ")
    assert list(tmp_path.iterdir()) == [double]


@pytest.mark.parametrize("command", ["lyapunov", "ensemble"])
def test_other_commands_have_one_format_each(pendula, double, tmp_path, command):
    axis = '\n[[ensemble.axis]]\nkey = "start.theta"\nfrom = 0.1\nto = 0.2\ncount = 2\n'
    double.write_text(DOUBLE + axis)
    wrong, right = {"lyapunov": ("out.h5", "out.csv"), "ensemble": ("out.csv", "out.nc")}[command]
    run = pendula(command, double, "-o", wrong)
    assert (run.status, run.out) == (2, "")
    assert f"{wrong}: expected a name that ends in " in run.err
    assert list(tmp_path.iterdir()) == [double]
    assert pendula(command, double, "-o", right).status == 0
    assert (tmp_path / right).exists()


def test_an_ensemble_says_what_it_replaces(pendula, double):
    double.write_text(DOUBLE + '\n[[ensemble.axis]]\nkey = "start.theta"\nfrom = 0.1\nto = 0.2\ncount = 2\n')
    assert "replacing" not in pendula("ensemble", double, "-o", "out.h5").err
    assert pendula("ensemble", double, "-o", "out.h5").err == "pendula: replacing out.h5\n"
    assert "replacing" not in pendula("ensemble", double, "-o", "out.h5", "--resume").err


def test_a_run_goes_on_whatever_its_file_is_called(pendula, double, tmp_path):
    """It is no CSV file, and is not written over as one."""
    assert pendula("simulate", double, "-o", "run.h5").status == 0
    (tmp_path / "run.h5").rename(tmp_path / "run.kept")
    assert pendula("simulate", "--resume", "run.kept", *settings("run.duration=2")).status == 0
    with h5py.File(tmp_path / "run.kept") as run:
        assert run["t"][-1] == 2


def test_a_key_may_be_taken_out(pendula, double):
    chosen = pendula("simulate", double, "--json", *settings("run.step=")).json
    assert chosen["step"] is None and chosen["accuracy"] == 1e-9
    assert pendula("simulate", double, "--json", *settings("chain.gravity=", "chain.gravity=1")).status == 0
    drive = "\n[[chain.drive]]\nlink = 1\namplitude = 1.0\nfrequency = 2.0\n"
    double.write_text(DOUBLE + drive + drive)
    calm = pendula("simulate", double, "--json", *settings("chain.drive[2]=", "chain.drive[1]=")).json
    assert calm["energy_error_max"] < 1e-3  # measured 4e-9 of constant steps; 0.1 with a drive
    shorter = pendula("simulate", double, "--json", *settings("chain.masses[2]=")).json
    assert shorter["links"] == 1


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("run.stpe=", "expected a key of the scenario, to take it out, got none (did you mean run.step?)"),
        ("run.method=", "run.method: expected a key of the scenario, to take it out, got none"),
        ("chain.masses[3]=", "chain.masses[3]: expected an array of at least 3 elements, got [1.0, 1.0]"),
        ("chain.masses=", "chain.masses: expected the masses of the bobs, got no such key"),
    ],
)
def test_what_is_not_there_cannot_be_taken_out(pendula, double, change, expected):
    run = pendula("simulate", double, *settings(change))
    assert run.status == 2
    assert run.err.endswith(f"{expected}\n")


def test_counting_begins_at_one(pendula, double):
    run = pendula("simulate", double, *settings("chain.masses[0]=2"))
    assert run.status == 2
    assert run.err.endswith("(elements of arrays count from 1)\n")


def test_the_beginning_of_a_name_is_understood(pendula, double):
    run = pendula("simulate", double, *settings("chain.mass=2"))
    assert run.status == 2
    assert run.err.endswith('the unknown key "mass" (did you mean masses?)\n')


def test_the_sign_for_degrees_is_a_unit(pendula, double):
    def ends(*given):
        return pendula("simulate", double, "--json", *settings(*given)).json["final"]["theta"]

    assert ends("start.theta=90°") == ends("start.theta=90 deg") == ends()
    rates = ["start.theta_dot=['10°/s', '-5 °/s']", "start.theta_dot=['10 deg/s', '-5 deg/s']"]
    assert ends(rates[0]) == ends(rates[1]) != ends()


@pytest.mark.parametrize(
    ("theta", "warned"),
    [
        ("[10, 5]", True),
        ("7", True),
        ("[0, -360]", True),
        ("6.28", False),
        ("[5, 5]", False),
        ("9.42477796076938", False),  # three half turns
        ("['10 rad', 5]", False),
    ],
)
def test_angles_that_look_like_degrees_are_warned_of(pendula, double, theta, warned):
    run = pendula("simulate", double, "--json", *settings(f"start.theta={theta}", "run.duration=0.1"))
    assert (
        any("rad is more than a turn; did you mean" in sentence for sentence in run.json["warnings"])
        == warned
    )


def test_the_estimate_is_read(pendula, double):
    assert pendula("simulate", double, *settings("run.estimate=false")).status == 0
    run = pendula("simulate", double, *settings("run.estimate=0"))
    assert run.status == 2
    assert run.err.endswith("run.estimate: expected true or false, got 0\n")


def test_every_summary_has_the_last_state_by_name(pendula, double, spherical):
    final = pendula("simulate", double, "--json").json["final"]
    assert final["q"] == {"theta_1": final["theta"][0], "theta_2": final["theta"][1]}
    assert final["v"] == {"theta_1": final["theta_dot"][0], "theta_2": final["theta_dot"][1]}
    assert final["points"] == {"bob_1": final["bobs"][0], "bob_2": final["bobs"][1]}
    final = pendula("simulate", spherical, "--json").json["final"]
    assert final["q"] == {"theta_1": final["theta"][0], "phi_1": final["phi"][0]}
    assert final["v"] == {"theta_1": final["theta_dot"][0], "phi_1": final["phi_dot"][0]}


def test_columns_of_the_table_do_not_touch(pendula, double):
    """Numbers of nine digits with a sign and an exponent: the last bob rests a nanometre to the left."""
    text = pendula("simulate", double, *settings("start.theta=-1.23456789e-9")).out
    table = text.split("\n\n")[2].splitlines()
    assert [len(line.split()) for line in table[1:]] == [4] * (len(table) - 1)
    assert any("-2.46913578e-09" in line.split() for line in table)


@pytest.mark.parametrize(
    ("duration", "interval", "times"),
    [
        ("20", "0.8", "0 4 8 12 16 20"),
        ("7", "0.1", "0 0.5 1 1.5 2 2.5 3 3.5 4 4.5 5 5.5 6 6.5 7"),
        ("1", "0.01", "0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 1"),
        ("3", "1", "0 1 2 3"),
    ],
)
def test_the_table_has_round_times(pendula, double, duration, interval, times):
    given = settings(f"run.duration={duration}", f"output.interval={interval}")
    table = pendula("simulate", double, *given).out.split("\n\n")[2].splitlines()
    assert [line.split()[0] for line in table[1:]] == times.split()


@pytest.mark.parametrize("command", ["simulate", "ensemble", "describe", "models", "new-model"])
def test_help_of_a_command(pendula, command):
    asked = pendula("help", command)
    assert (asked.status, asked.out) == (0, pendula(command, "--help").out)
    assert f"Usage: pendula {command}" in asked.out


def test_help_of_all_and_of_none(pendula):
    assert pendula("help").out == pendula("--help").out
    run = pendula("help", "simlate")
    assert (run.status, run.out) == (2, "")
    assert run.err.startswith("pendula: unknown command simlate (did you mean simulate?)\n")
