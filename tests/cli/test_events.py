"""Events: found, written, told in the summary; what is wrong with them is told."""

import csv
import math

import pytest
from conftest import DOUBLE, settings

EVENTS = """
[[event]]
name = "below"
when = "x_1"

[[event]]
name = "below_up"
when = "x_1"
direction = "up"

[[event]]
name = "at"
when = "t - 0.7501"
"""

STOP = """
[[event]]
name = "low"
when = "y_2 + 1.5"
direction = "down"
stop = true
"""


def read(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture
def simulate(pendula, double, tmp_path):
    """Runs the double pendulum with these events; gives summary, events and rows."""

    def run(events: str, *overrides: str, out: str = "out.csv"):
        double.write_text(DOUBLE + events)
        files = ["--events", "events.csv", "-o", out]
        done = pendula("simulate", double, *settings("run.stages=6", *overrides), *files, "--json")
        assert (done.status, done.err) == (0, "")
        rows = read(tmp_path / out) if out.endswith(".csv") else None
        return done.json, read(tmp_path / "events.csv"), rows

    return run


def test_events_have_the_columns_of_rows(simulate):
    _, events, rows = simulate(EVENTS)
    assert list(events[0]) == ["name", "t", "direction", *list(rows[0])[1:]]
    times = [float(event["t"]) for event in events]
    assert times == sorted(times)
    for event in events:
        if event["name"] == "at":
            assert float(event["t"]) == pytest.approx(0.7501, abs=3e-16)  # measured 0
        else:
            assert abs(float(event["x_1"])) < 2e-15  # measured 4e-16
            assert event["direction"] == ("up" if float(event["theta_dot_1"]) > 0 else "down")
        assert float(event["energy"]) == pytest.approx(0, abs=1e-13)  # measured 2e-14


def test_the_summary_counts_them(simulate, pendula, double):
    summary, events, _ = simulate(EVENTS, "run.duration=5")
    for told in summary["events"]:
        times = [float(event["t"]) for event in events if event["name"] == told["name"]]
        assert told == {
            "name": told["name"],
            "count": len(times),
            "first": times[0],
            "last": times[-1],
        }
    counts = {told["name"]: told["count"] for told in summary["events"]}
    ups = [event for event in events if event["name"] == "below" and event["direction"] == "up"]
    assert counts == {"below": counts["below"], "below_up": len(ups), "at": 1}
    assert counts["below"] > counts["below_up"] >= 1
    text = pendula("simulate", double, *settings("run.duration=5")).out
    assert f"event below        {counts['below']} times" in text
    assert "event at           1 time        at t = 0.7501 s\n" in text


def test_what_never_happens_is_told_as_such(simulate, pendula, double):
    summary, events, _ = simulate('[[event]]\nname = "far"\nwhen = "x_1 - 3"')
    assert summary["events"] == [{"name": "far", "count": 0, "first": None, "last": None}]
    assert events == []
    assert "event far          0 times\n" in pendula("simulate", double).out
    double.write_text(DOUBLE)
    assert pendula("simulate", double, "--json").json["events"] == []


def test_small_oscillations_cross_every_half_period(pendula, tmp_path):
    """One link from 0.1 rad: its period by the elliptic integral, 4 K(sin(0.05)) / sqrt(g)."""
    scenario = tmp_path / "one.toml"
    scenario.write_text(
        '[chain]\nspace = "planar"\nmasses = [1.0]\nlengths = 1.0\ngravity = 9.81\n[start]\ntheta = 0.1\n'
        '[run]\nstages = 8\nstep = 2e-2\nduration = 60\n[[event]]\nname = "low"\nwhen = "theta_1"\n'
    )
    assert pendula("simulate", scenario, "--events", "events.csv").status == 0
    a, g = 1.0, math.cos(0.05)
    while abs(a - g) > 1e-16:
        a, g = (a + g) / 2, math.sqrt(a * g)
    quarter = math.pi / (2 * a) / math.sqrt(9.81)
    times = [float(event["t"]) for event in read(tmp_path / "events.csv")]
    assert len(times) == 60
    for k, time in enumerate(times):
        assert time == pytest.approx((2 * k + 1) * quarter, abs=1e-13)  # measured 3e-14


@pytest.mark.parametrize("rows", [[], ["output.interval=0.013"]])
@pytest.mark.parametrize("method", ["gauss", "radau", "rk4", "dopri5", "taylor"])
def test_events_do_not_change_the_motion(method, rows, simulate, pendula, double, tmp_path):
    overrides = [f"run.method={method}", *rows]
    if method == "radau":
        overrides.append("run.stages=3")
    double.write_text(DOUBLE)
    done = pendula(
        "simulate",
        double,
        *settings("run.stages=6", *overrides),
        "-o",
        "alone.csv",
        "--quiet",
    )
    assert done.status == 0
    double.write_text(DOUBLE + EVENTS)
    done = pendula(
        "simulate",
        double,
        *settings("run.stages=6", *overrides),
        "-o",
        "watched.csv",
        "--json",
    )
    assert sum(told["count"] for told in done.json["events"]) >= 2
    assert (tmp_path / "alone.csv").read_bytes() == (tmp_path / "watched.csv").read_bytes()


def test_an_event_ends_the_run(simulate, pendula, double):
    summary, events, rows = simulate(STOP)
    assert summary["outcome"] == {"status": "stopped_by_event", "event": "low"}
    assert summary["events"][0]["count"] == 1
    time = summary["events"][0]["first"]
    assert 0.1 < time < 1
    assert float(rows[-1]["t"]) == float(events[-1]["t"]) == summary["final"]["t"] == time
    assert float(rows[-1]["y_2"]) == pytest.approx(-1.5, abs=1e-14)  # measured 4e-16
    assert summary["final"]["bobs"][1][1] == float(rows[-1]["y_2"])
    done = pendula("simulate", double)
    assert done.status == 0
    assert "stopped by         event low, before the end at 1 s\n" in done.out


def test_rows_at_times_end_before_the_event(simulate):
    summary, _, rows = simulate(STOP, "output.interval=0.01")
    time = summary["events"][0]["first"]
    assert [float(row["t"]) for row in rows] == [k * 0.01 for k in range(math.floor(time / 0.01) + 1)]
    assert summary["final"]["t"] == time


def test_a_run_that_goes_on_has_the_events_of_the_whole(simulate, pendula, tmp_path):
    whole, events, _ = simulate(EVENTS, "run.duration=5")
    _, before, _ = simulate(EVENTS, "run.duration=1.234", out="run.h5")
    go_on = [
        "simulate",
        "--resume",
        "run.h5",
        "--set",
        "run.duration=5",
        "--events",
        "rest.csv",
        "--json",
    ]
    done = pendula(*go_on)
    assert (done.status, done.json["events"]) == (0, whole["events"])
    rest = read(tmp_path / "rest.csv")
    shared = len(before) + len(rest) - len(events)
    assert 0 <= shared <= 1  # in the step that the first end cut short
    assert before[: len(before) - shared] + rest == events


def test_a_run_that_an_event_ended_ends_there_again(simulate, pendula):
    first, _, _ = simulate(STOP, out="run.h5")
    again = pendula("simulate", "--resume", "run.h5", "--set", "run.duration=5", "--json")
    assert again.status == 0
    for key in ("outcome", "final", "events", "rows"):
        assert again.json[key] == first[key]


def test_any_system_has_events(pendula, tmp_path):
    scenario = tmp_path / "atwood.toml"
    scenario.write_text(
        '[system]\nmodel = "swinging_atwood"\n[start]\nr = 1.0\ntheta = "90 deg"\n[run]\nstages = 6\nstep = 5e-3\n'
        'duration = 5\n[[event]]\nname = "turn"\nwhen = "r_dot"\n[[event]]\nname = "below"\nwhen = "sin(theta)"\n'
    )
    done = pendula("simulate", scenario, "--events", "events.csv", "--json")
    assert done.status == 0, done.err
    events = read(tmp_path / "events.csv")
    assert {event["name"] for event in events} == {"turn", "below"}
    for event in events:
        value = float(event["r_dot"]) if event["name"] == "turn" else math.sin(float(event["theta"]))
        assert abs(value) < 1e-13  # measured 2e-15, compiled by Clang 1.1e-14


def test_an_expression_without_a_value_is_warned_of(pendula, double):
    double.write_text(DOUBLE + '[[event]]\nname = "root"\nwhen = "sqrt(0.5 - t) - 0.1"')
    done = pendula("simulate", double, "--json")
    assert done.json["events"][0]["count"] == 1
    assert done.json["events"][0]["first"] == pytest.approx(0.49, abs=1e-15)  # measured 1e-16
    expected = "event root: not finite before t = 0.505 s; where that is so, nothing was looked for"
    assert done.json["warnings"] == [expected]


def test_rounding_errors_are_no_events(pendula, double):
    """The energy is zero but for rounding."""
    double.write_text(DOUBLE + '[[event]]\nname = "zero"\nwhen = "energy"')
    done = pendula("simulate", double, *settings("run.stages=6"), "--json")
    assert done.json["events"][0]["count"] <= done.json["steps"]
    expected = "event zero: changes too often for the steps before t = "
    assert [sentence[: len(expected)] for sentence in done.json["warnings"]] == [expected]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (
            'name = "a"',
            ":14: event[1].when: expected an expression that crosses zero where the event is",
        ),
        (
            'when = "t"',
            ":14: event[1].name: expected a name of letters, digits, _ and -, got no such key",
        ),
        (
            'name = "a,b"\nwhen = "t"',
            ':15: event[1].name: expected a name of letters, digits, _ and -, got "a,b"',
        ),
        (
            'name = "a"\nwhen = "t"\n[[event]]\nname = "a"\nwhen = "x_1"',
            ':18: event[2].name: expected a name that no event before it has, got "a"',
        ),
        (
            'name = "a"\nwhen = "t"\nwhere = "here"',
            ':17: event[1].where: expected one of name, when, direction, stop, got the unknown key "where"',
        ),
        (
            'name = "a"\nwhen = "t"\nstop = 1',
            ":17: event[1].stop: expected true or false, got 1",
        ),
        (
            'name = "a"\nwhen = "t"\ndirection = "dwon"',
            'event[1].direction: expected "up" or "down" or "both", got "dwon" (did you mean down?)',
        ),
        (
            'name = "a"\nwhen = "cos(thta_2)"',
            ":16: event[1].when: expected an expression in t, theta_1, theta_dot_1, theta_2, theta_dot_2, x_1, y_1, "
            'x_2, y_2, energy, pi, got the unknown name "thta_2" (did you mean theta_2?)',
        ),
        (
            'name = "a"\nwhen = "cos(t"',
            ':16: event[1].when: expected an expression such as cos(theta_1) - 0.5, got "cos(t"',
        ),
        (
            'name = "a"\nwhen = "t = 3"',
            "expected an expression such as cos(theta_1) - 0.5, which sets nothing, got",
        ),
        ('name = "a"\nwhen = "t, x_1"', 'got "t, x_1", which is several'),
        (
            'name = "a"\nwhen = "log(t)"',
            "expected an expression that is finite at the start, got -inf there",
        ),
    ],
)
def test_what_is_wrong_is_told(given, expected, pendula, double):
    double.write_text(f"{DOUBLE}\n[[event]]\n{given}\n")
    run = pendula("simulate", double, "-o", "out.csv")
    assert (run.status, run.out) == (2, "")
    assert expected in run.err
    assert not double.with_name("out.csv").exists()


def test_the_file_for_events_is_its_own(pendula, double, tmp_path):
    double.write_text(DOUBLE + EVENTS)
    for name in ("-", "out.csv"):
        run = pendula("simulate", double, "-o", "out.csv", "--events", name)
        assert (run.status, run.err) == (
            2,
            f"pendula: {name}: expected a file of its own for the events\n",
        )
    run = pendula("simulate", double, "--events", double)
    assert run.status == 2
    assert "expected a file for the events, got the scenario itself" in run.err
    double.write_text(DOUBLE)
    run = pendula("simulate", double, "--events", "events.csv")
    assert run.err == "pendula: --events events.csv: expected a scenario with [[event]], got one without\n"
    assert not (tmp_path / "events.csv").exists()
