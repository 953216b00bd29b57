"""Expressions as columns: in every file, by every method, with names that are new."""

import csv
import math

import h5py
import numpy as np
import pytest
from conftest import DOUBLE, SPHERICAL, Trajectory, settings

COLUMNS = """
[output]
every = 1
columns = { height = "2 - cos(theta_1) - cos(theta_2)", twice = "2*energy + y_2" }
"""


def test_they_are_columns_of_tables(pendula, double, tmp_path):
    plain = pendula("simulate", double, *settings("output.every=1"), "-o", "plain.csv", "--json")
    double.write_text(DOUBLE + COLUMNS)
    run = pendula("simulate", double, "-o", "out.csv", "--json")
    assert run.status == 0, run.err
    before, rows = Trajectory.read(tmp_path / "plain.csv"), Trajectory.read(tmp_path / "out.csv")
    assert rows.header == [*before.header, "height", "twice"]
    assert run.json["final"] == plain.json["final"]  # the motion is the same to the bit
    column = {name: np.array(rows.column(name)) for name in rows.header}
    height = 2 - np.cos(column["theta_1"]) - np.cos(column["theta_2"])
    assert np.abs(column["height"] - height).max() < 1e-15  # measured 0
    assert np.array_equal(column["twice"], 2 * column["energy"] + column["y_2"])


def test_they_are_quantities_of_run_files_and_go_on(pendula, double, tmp_path):
    double.write_text(DOUBLE + COLUMNS)
    assert pendula("simulate", double, "--quiet", "-o", "whole.h5").status == 0
    assert pendula("simulate", double, "--quiet", "-o", "part.h5", "--set", "run.duration=0.5").status == 0
    assert pendula("simulate", "--resume", "part.h5", "--quiet", "--set", "run.duration=1.0").status == 0
    with h5py.File(tmp_path / "whole.h5") as whole, h5py.File(tmp_path / "part.h5") as part:
        assert whole["height"].attrs["long_name"] == "2 - cos(theta_1) - cos(theta_2)"
        for name in ("height", "twice"):
            assert np.array_equal(whole[name][...], part[name][...])


def test_events_hold_them_and_have_them(pendula, double, tmp_path):
    event = '[[event]]\nname = "up"\nwhen = "height - 1"\n'
    double.write_text(DOUBLE + COLUMNS + event)
    run = pendula("simulate", double, "--quiet", "--events", "events.csv")
    assert run.status == 0, run.err
    with open(tmp_path / "events.csv") as file:
        rows = list(csv.DictReader(file))
    assert rows
    for row in rows:
        assert abs(float(row["height"]) - 1) < 1e-12  # measured 1.1e-16
        assert abs(2 - math.cos(float(row["theta_1"])) - math.cos(float(row["theta_2"])) - 1) < 1e-12


def test_ensembles_keep_them_by_name(pendula, double, tmp_path):
    ensemble = """
[ensemble]
keep = ["final", "height"]
[[ensemble.axis]]
key = "start.theta"
values = [0.5, 1.0]
"""
    double.write_text(DOUBLE + COLUMNS + ensemble)
    run = pendula("ensemble", double, "-o", "ends.h5", "--quiet")
    assert (run.status, run.out, run.err) == (0, "", "")
    with h5py.File(tmp_path / "ends.h5") as ends:
        height = 2 - np.cos(ends["theta_1"][...]) - np.cos(ends["theta_2"][...])
        assert np.abs(ends["height"][...] - height).max() < 1e-15  # measured 0


def test_torques_that_feedback_adds_stand_before_them(pendula, spherical, tmp_path):
    feedback = '[[chain.feedback]]\ninput = "torque_z_1"\nvalue = "-phi_dot_1"\nsample = 0.1\n'
    output = '[output]\ncolumns = { power = "torque_z_1 * phi_dot_1" }\n'
    spherical.write_text(SPHERICAL.replace("[start]", f"{feedback}[start]") + output)
    run = pendula("simulate", spherical, "--quiet", "-o", "out.csv")
    assert run.status == 0, run.err
    rows = Trajectory.read(tmp_path / "out.csv")
    assert rows.header[-2:] == ["torque_z_1", "power"]
    power = np.array(rows.column("torque_z_1")) * np.array(rows.column("phi_dot_1"))
    assert np.array_equal(rows.column("power"), power)


def test_points_of_chains_with_feedback_are_seen_by_events(pendula, double, tmp_path):
    """The first number of a point stood where rows without points have the torque."""
    feedback = '[[chain.feedback]]\ninput = "torque_1"\nvalue = "-0.1*theta_dot_1"\nsample = 0.1\n'
    event = '[[event]]\nname = "left"\nwhen = "x_1 - 0.5"\n'
    double.write_text(DOUBLE.replace("[start]", f"{feedback}[start]") + event)
    run = pendula("simulate", double, "--quiet", "--events", "events.csv")
    assert run.status == 0, run.err
    with open(tmp_path / "events.csv") as file:
        rows = list(csv.DictReader(file))
    assert rows
    assert all(abs(float(row["x_1"]) - 0.5) < 1e-12 for row in rows)  # measured 5.6e-17


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ('{ x_1 = "1" }', 'columns.x_1: expected a name that no column and no function has, got "x_1"'),
        ('{ theta = "1" }', 'columns.theta: expected a name that no column and no function has, got "theta"'),
        ('{ sin = "1" }', 'columns.sin: expected a name that no column and no function has, got "sin"'),
        (
            '{ a-b = "1" }',
            'columns: expected names of letters, digits and _ that begin with a letter, got "a-b"',
        ),
        ('{ up = "thetta_1" }', 'the unknown name "thetta_1" (did you mean theta_1?)'),
        ('{ up = "energy", high = "up" }', 'the unknown name "up"'),
        ("{ up = 3 }", "columns.up: expected a text, got 3"),
        ('"1"', "columns: expected a table of expressions by name"),
    ],
)
def test_what_is_wrong_is_told(pendula, double, columns, expected):
    double.write_text(f"{DOUBLE}[output]\ncolumns = {columns}\n")
    run = pendula("simulate", "double.toml", "--quiet")
    assert run.status == 2
    assert run.err.startswith("pendula: double.toml:14: output.columns")
    assert expected in run.err
