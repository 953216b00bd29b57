"""scripts/draw: a picture of a trajectory, and what it says of files that are none."""

import subprocess
import sys
from pathlib import Path

import pytest

DRAW = Path(__file__).resolve().parents[2] / "scripts/draw"


@pytest.fixture
def draw(tmp_path):
    def call(*arguments):
        command = [sys.executable, str(DRAW), *map(str, arguments)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)

    return call


@pytest.fixture
def trajectory(pendula, double, tmp_path):
    assert pendula("simulate", double, "-o", "a.csv").status == 0
    return tmp_path / "a.csv"


def test_a_trajectory_becomes_a_picture(draw, trajectory):
    run = draw("a.csv", "a.svg")
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert trajectory.with_name("a.svg").read_text().startswith("<svg ")


def test_the_trajectory_is_not_overwritten(draw, trajectory):
    text = trajectory.read_text()
    trajectory.with_name("link.csv").symlink_to(trajectory)
    for picture in ("a.csv", "./a.csv", "link.csv"):
        run = draw("a.csv", picture)
        assert run.returncode == 2
        assert (
            run.stderr
            == f"draw: {picture}: expected a file for the picture, got the trajectory itself\n".replace(
                "./", ""
            )
        )
    assert trajectory.read_text() == text


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "a.csv: expected a trajectory with columns t, x_1, y_1, …, got an empty file"),
        ("a,b\n1,2\n", "a.csv: expected a trajectory with columns t, x_1, y_1, …, got a, b"),
        ("t,x_1,y_1\n", "a.csv: expected rows, got only the header"),
        ("t,x_1,y_1\n0,1\n", "a.csv:2: expected a number in each of the 3 columns"),
        ("t,x_1,y_1\n0,1,2\n1,one,2\n", "a.csv:3: expected a number in each of the 3 columns"),
        ("t,x_1,y_1\n0,1,nan\n", "a.csv:2: expected a number in each of the 3 columns"),
        ("t,x_1,x_2,y_1\n0,1,2,3\n", "a.csv:2: expected a number in each of the 4 columns"),
    ],
)
def test_what_is_no_trajectory_is_told(draw, tmp_path, text, problem):
    (tmp_path / "a.csv").write_text(text)
    run = draw("a.csv", "a.svg")
    assert (run.returncode, run.stderr) == (2, f"draw: {problem}\n")
    assert not (tmp_path / "a.svg").exists()


def test_files_that_cannot_be_read_or_written_are_told(draw, trajectory):
    assert draw("none.csv", "a.svg").stderr.startswith(
        "draw: none.csv: expected a trajectory that can be read, got: "
    )
    assert draw(".", "a.svg").returncode == 2
    run = draw("a.csv", "none/a.svg")
    reason = "expected a file that can be written, got: No such file or directory"
    assert (run.returncode, run.stderr) == (2, f"draw: none/a.svg: {reason}\n")


def test_times_without_rows_are_told(draw, trajectory):
    run = draw("a.csv", "a.svg", "--from", "5")
    assert run.stderr == "draw: a.csv: expected rows between --from and --to, got t from 0.0 to 1.0\n"
    assert run.returncode == 2


def test_a_row_that_is_just_being_written_is_left_out(draw, trajectory):
    draw("a.csv", "a.svg")
    whole = trajectory.with_name("a.svg").read_text()
    with trajectory.open("a") as file:
        file.write("2.0,1.5,")
    assert draw("a.csv", "a.svg").returncode == 0
    assert trajectory.with_name("a.svg").read_text() == whole
