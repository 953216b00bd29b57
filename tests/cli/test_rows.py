"""Rows at times: exactly there, and told in the summary; what is wrong with times is told."""

import pytest
from conftest import DOUBLE, Trajectory, settings


def simulate(pendula, double, tmp_path, *overrides):
    run = pendula("simulate", double, *settings(*overrides), "-o", "out.csv", "--json")
    assert run.status == 0, run.err
    return run.json, Trajectory.read(tmp_path / "out.csv")


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
