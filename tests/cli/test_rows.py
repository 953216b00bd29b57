"""Rows at times: exactly there, and told in the summary; what is wrong with times is told."""

import h5py
import numpy as np
import pytest
from conftest import DOUBLE, Trajectory, settings


def simulate(pendula, double, tmp_path, *overrides):
    run = pendula("simulate", double, *settings(*overrides), "-o", "out.csv", "--json")
    assert run.status == 0, run.err
    return run.json, Trajectory.read(tmp_path / "out.csv")


CHOSEN = ["run.step=", "run.tolerance=1e-9", "run.estimate=false"]  # steps of the method's own choice


@pytest.mark.parametrize(
    ("duration", "interval", "count"),
    [
        (1e-3, 1e-6, 1001),
        (3.0, 0.005, 601),
        (6.2831853, 0.01, 630),
        (10.0, 0.01, 1001),
        (20.0, 0.01, 2001),
        (100.0, 0.02, 5001),
    ],
)
def test_rows_that_nobody_asks_for_are_evenly_in_time(duration, interval, count, pendula, double, tmp_path):
    """And the last state is one, too, wherever it is."""
    summary, rows = simulate(pendula, double, tmp_path, *CHOSEN, f"run.duration={duration}")
    times = rows.column("t")
    assert (summary["rows"], summary["every"], summary["interval"]) == (count, None, interval)
    assert times[:-1] == [k * interval for k in range(count - 1)] and times[-1] == duration


def test_rows_that_nobody_asks_for_are_few_for_long_runs(pendula, double, tmp_path):
    """Of steps that are constant they are at the ends."""
    long = ("run.step=1e-2", "run.duration=2000", "run.estimate=false")
    summary, _ = simulate(pendula, double, tmp_path, *long)
    assert (summary["rows"], summary["every"], summary["interval"]) == (4001, 50, None)
    summary, _ = simulate(pendula, double, tmp_path, "run.step=0.03")
    assert (summary["rows"], summary["every"]) == (35, 1)  # of no step it takes more than its end


def test_a_row_a_step_is_asked_for(pendula, double, tmp_path):
    summary, _ = simulate(pendula, double, tmp_path, *CHOSEN, "output.every=1")
    assert (summary["rows"], summary["every"], summary["interval"]) == (summary["steps"] + 1, 1, None)
    even, _ = simulate(pendula, double, tmp_path, *CHOSEN)
    assert even["final"] == summary["final"]  # to the bit: rows do not change steps


def test_a_run_that_goes_on_keeps_its_rows(pendula, double, tmp_path):
    """Those that a run of the whole time would have, if it began with this interval."""
    series = (*CHOSEN, "run.method=taylor")  # which else may depend on the end
    first = pendula("simulate", double, *settings(*series, "run.duration=1.5"), "-o", "part.h5")
    assert first.status == 0, first.err
    for end in ("3.3", "40"):
        run = pendula("simulate", "--resume", "part.h5", *settings(f"run.duration={end}"))
        assert run.status == 0 and "a row every 0.002 s\n" in run.out, run.err
    whole = settings(*series, "run.duration=40", "output.interval=0.002")
    assert pendula("simulate", double, *whole, "-o", "whole.h5").status == 0
    with h5py.File(tmp_path / "part.h5") as part, h5py.File(tmp_path / "whole.h5") as whole:
        for name in ("t", "theta", "theta_dot", "energy"):
            assert np.array_equal(part[name][...], whole[name][...]), name


def test_an_event_that_ends_a_run_is_its_last_row(pendula, double, tmp_path):
    double.write_text(DOUBLE + '[[event]]\nname = "low"\nwhen = "theta_1"\nstop = true\n')
    summary, rows = simulate(pendula, double, tmp_path, *CHOSEN)
    assert summary["outcome"]["status"] == "stopped_by_event"
    assert rows.column("t")[-1] == summary["final"]["t"] < 1
    assert abs(rows.column("theta_1")[-1]) < 1e-12  # measured 6.7e-17


@pytest.mark.parametrize("method", ["gauss", "radau", "rk4", "dopri5"])
def test_an_interval_gives_rows_at_its_multiples(method, pendula, double, tmp_path):
    step = [] if method == "dopri5" else ["run.step=7e-3"]
    summary, rows = simulate(
        pendula, double, tmp_path, f"run.method={method}", *step, "output.interval=0.013"
    )
    assert rows.column("t") == [k * 0.013 for k in range(77)]
    assert (summary["rows"], summary["every"], summary["interval"]) == (77, None, 0.013)
    assert summary["final"]["t"] == 1.0  # the motion goes to its end, where no row is wanted


def test_times_are_the_rows(pendula, double, tmp_path):
    summary, rows = simulate(pendula, double, tmp_path, "output.times=[0.2, 0.2001, 0.7, 1.0]")
    assert rows.column("t") == [0.2, 0.2001, 0.7, 1.0]
    assert (summary["rows"], summary["every"], summary["interval"]) == (4, None, None)


def test_rows_do_not_change_the_motion(pendula, double, tmp_path):
    by_steps, _ = simulate(pendula, double, tmp_path)
    by_times, _ = simulate(pendula, double, tmp_path, "output.interval=0.0011")
    assert by_times["final"] == by_steps["final"] and by_times["steps"] == by_steps["steps"]


def test_times_go_before_steps(pendula, double, tmp_path):
    """So that --set can ask for them, whatever the scenario says."""
    double.write_text(f"{DOUBLE}\n[output]\nevery = 2\n")
    run = pendula("simulate", double, *settings("output.interval=0.25"), "-o", "out.csv", "--json")
    assert run.json["warnings"] == [f"{double}:15: output.every: has no effect where rows are at times"]
    assert Trajectory.read(tmp_path / "out.csv").column("t") == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_the_summary_says_when_rows_are(pendula, double):
    text = pendula("simulate", double, *settings("output.interval=0.02")).out
    assert "duration           1 s, a row every 0.02 s\n" in text
    text = pendula("simulate", double, *settings("output.times=[0.5, 1]")).out
    assert "duration           1 s, rows at 2 times\n" in text


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("interval = 0", "double.toml:15: output.interval: expected a finite number > 0, got 0"),
        (
            "times = [0.1]\ninterval = 0.1",
            "double.toml:15: output.times: expected nothing beside output.interval, got",
        ),
        ("times = []", "double.toml:15: output.times: expected times in s, one at least, got"),
        ("times = 0.5", "double.toml:15: output.times: expected times in s, one at least, got 0.5"),
        (
            "times = [0.5, 0.5]",
            "double.toml:15: output.times[2]: expected a time after the one before it, from 0 to",
        ),
        (
            "times = [-0.1]",
            "double.toml:15: output.times[1]: expected a time after the one before it, from 0 to",
        ),
        (
            "times = [1.1]",
            "double.toml:15: output.times[1]: expected a time after the one before it, from 0 to",
        ),
        (
            "interval = 1e-20",
            "double.toml:15: output.interval: expected an interval that time can tell, at least 1.1",
        ),
    ],
)
def test_what_is_wrong_is_told(given, expected, pendula, double):
    double.write_text(f"{DOUBLE}\n[output]\n{given}\n")
    run = pendula("simulate", double)
    assert (run.status, run.out) == (2, "")
    assert f"pendula: {double}".replace("double.toml", "") + expected in run.err.replace("\n", " ")
