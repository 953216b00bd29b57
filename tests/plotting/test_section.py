"""`pendula plot` of an events file: a Poincaré section."""

import sys

import numpy as np
import pytest
from conftest import DOUBLE
from pendula_plot import section
from pendula_plot.__main__ import main
from pendula_plot.drawing import draw, read
from pendula_plot.figure import Choice

EVENTS = """
[[event]]
name      = "section"
when      = "sin(theta_1)"
direction = "up"

[[event]]
name = "flip"
when = "cos(theta_2 / 2)"
"""


@pytest.fixture
def events(pendula, tmp_path):
    """An events file of a double pendulum that swings over."""
    (tmp_path / "events.toml").write_text(
        DOUBLE.replace("2.5, 3.0", "1.4, 2.6").replace("duration = 3.0", "duration = 60.0") + EVENTS
    )
    simulate = pendula("simulate", "events.toml", "--events", "hits.csv", "-o", "run.csv")
    assert simulate.returncode == 0, simulate.stderr
    return tmp_path / "hits.csv"


def points(axes):
    """What is drawn, (x, y) by name."""
    return {line.get_label(): np.column_stack(line.get_data()) for line in axes.lines}


def test_a_section_shows_every_event_by_name_and_direction(events):
    (axes,) = draw([read(events)], Choice()).axes
    rows = [line.split(",") for line in events.read_text().splitlines()]
    place = {name: rows[0].index(name) for name in rows[0]}
    expected = {}
    for row in rows[1:]:
        angle = float(row[place["theta_2"]])
        expected.setdefault(f"{row[0]}, {row[2]}", []).append((angle, float(row[place["theta_dot_2"]])))
    assert set(expected) == {"section, up", "flip, up", "flip, down"} == set(points(axes))
    for name, shown in points(axes).items():
        wanted = np.array(expected[name])
        assert np.max(np.abs(shown[:, 0])) <= np.pi  # within one turn
        assert np.allclose(np.exp(1j * shown[:, 0]), np.exp(1j * wanted[:, 0]), atol=1e-13)  # measured: 3e-15
        assert np.array_equal(shown[:, 1], wanted[:, 1])
    colours = {line.get_label(): line.get_color() for line in axes.lines}
    assert colours["flip, up"] == colours["flip, down"] != colours["section, up"]
    assert axes.get_xlabel() == "$θ_{2}$ [rad]" and axes.get_ylabel() == r"$\dot{θ}_{2}$ [rad/s]"


@pytest.mark.parametrize(
    ("coordinates", "columns"),
    [
        (("theta_1",), ("theta_1", "theta_dot_1")),
        (("x_2", "y_2"), ("x_2", "y_2")),
    ],
)
def test_columns_are_chosen(events, coordinates, columns):
    hits = read(events)
    assert section.chosen([hits], Choice(coordinates=coordinates)) == columns
    (axes,) = draw([hits], Choice(coordinates=coordinates)).axes
    assert np.array_equal(
        points(axes)["section, up"][:, 1], hits.states.columns[columns[1]][hits.events == "section"]
    )


def test_the_coordinate_shown_is_one_that_events_leave_free(events):
    hits = read(events)
    held = {
        (event, name): section.is_held(hits.states, name, hits.events == event)
        for event in ("section", "flip")
        for name in ("theta_1", "theta_2")
    }
    assert held == {
        ("section", "theta_1"): True,  # 0 and π
        ("section", "theta_2"): False,
        ("flip", "theta_1"): False,
        ("flip", "theta_2"): True,
    }
    assert np.sum(hits.events == "section") > np.sum(hits.events == "flip")
    assert section.chosen([hits], Choice()) == ("theta_2", "theta_dot_2")
    assert section.chosen([hits.only(hits.events == "flip")], Choice()) == ("theta_1", "theta_dot_1")


def test_one_event_can_be_shown_alone(events, pendula):
    (axes,) = draw([read(events)], Choice(event="section")).axes
    assert set(points(axes)) == {"section, up"}
    plot = pendula("plot", events.name, "-o", "section.svg", "--event", "flop")
    assert plot.returncode == 2
    assert plot.stderr == "pendula: hits.csv: expected an event, one of section, flip, got flop\n"


def test_two_files_lie_over_each_other(events, pendula):
    simulate = pendula(
        "simulate", "events.toml", "--set", "start.theta=[1.4,2.5]", "--events", "other.csv", "-o", "o.csv"
    )
    assert simulate.returncode == 0
    (axes,) = draw([read(events), read(events.with_name("other.csv"))], Choice()).axes
    assert len({line.get_color() for line in axes.lines}) == 4  # two events of two files
    assert all(".csv, " in name for name in points(axes))


def test_of_a_model_the_first_coordinate_and_its_rate(tmp_path):
    (tmp_path / "model.csv").write_text(
        "name,t,direction,s,s_dot,energy\nturn,1,up,0.5,4,1\nturn,2,down,0.7,-7,1\nturn,3,up,0.6,2,1\n"
    )
    (axes,) = draw([read(tmp_path / "model.csv").between(0.5, 2.5)], Choice()).axes
    assert {name: shown.tolist() for name, shown in points(axes).items()} == {
        "turn, up": [[0.5, 4.0]],
        "turn, down": [[0.7, -7.0]],
    }


def test_the_program_draws_it(events, pendula):
    plot = pendula("plot", events.name, "-o", "section.svg", "--coordinates", "theta_2", "--from", "10")
    assert (plot.returncode, plot.stdout, plot.stderr) == (0, "picture            section.svg\n", "")
    assert (events.parent / "section.svg").read_text().startswith("<?xml")


def test_what_is_wrong_is_told(events, monkeypatch, capsys):
    monkeypatch.chdir(events.parent)
    header = events.read_text().splitlines()[0]
    for name, text in [
        ("none.csv", f"{header}\n"),
        ("torn.csv", "name,t,direction,s,s_dot,energy\na,1,up,2,3,4\na,2,up,2,oops,4\n"),
        ("sideways.csv", "name,t,direction,s,s_dot,energy\na,1,left,2,3,4\n"),
        ("bare.csv", "name,t,direction,s,energy\na,1,up,2,4\n"),
    ]:
        (events.parent / name).write_text(text)
    there = ", ".join(["t", *header.split(",")[3:]])
    for arguments, expected in [
        (["none.csv"], "none.csv: expected events, got none"),
        (["torn.csv"], "torn.csv:3: expected a number in each of the 4 columns"),
        (["sideways.csv"], "sideways.csv:2: expected an event: its name, a time, up or down, …"),
        (["bare.csv"], "bare.csv: expected a coordinate and its rate among the columns, got none"),
        (["hits.csv", "--coordinates", "s,energy"], f"hits.csv: expected a column, one of {there}, got s"),
        (
            ["hits.csv", "--coordinates", "x_1"],
            "hits.csv: expected a coordinate, one of theta_1, theta_2, got x_1",
        ),
        (
            ["hits.csv", "--coordinates", "x_1,x_2,y_2"],
            "hits.csv: expected one coordinate or two columns, got x_1, x_2, y_2",
        ),
        (["hits.csv", "run.csv"], "run.csv: expected events, as hits.csv is, got a trajectory"),
        (["run.csv", "hits.csv"], "hits.csv: expected a trajectory, as run.csv is, got events"),
    ]:
        monkeypatch.setattr(sys, "argv", ["pendula_plot", "plot", *arguments, "--output", "a.svg"])
        assert main() == 2
        assert capsys.readouterr().err == f"pendula: {expected}\n"
    assert not (events.parent / "a.svg").exists()
