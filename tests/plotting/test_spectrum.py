"""`pendula plot` of what `pendula lyapunov -o` writes: exponents as they converge."""

import sys

import numpy as np
import pytest
from conftest import DOUBLE
from pendula_plot.__main__ import main
from pendula_plot.drawing import draw, read
from pendula_plot.figure import Choice


@pytest.fixture
def history(pendula, tmp_path):
    """How the four exponents of a double pendulum converge."""
    (tmp_path / "double.toml").write_text(DOUBLE)
    assert pendula("lyapunov", "double.toml", "-o", "history.csv").returncode == 0
    assert pendula("lyapunov", "double.toml", "--count", 2, "-o", "leading.csv").returncode == 0
    return tmp_path / "history.csv"


def test_exponents_are_shown_over_time(history):
    (axes,) = draw([read(history)], Choice()).axes
    rows = np.loadtxt(history, delimiter=",", skiprows=1)
    *curves, zero = axes.lines
    assert len(curves) == 4
    for k, curve in enumerate(curves, start=1):
        assert curve.get_label() == f"$λ_{{{k}}}$"
        assert np.array_equal(np.column_stack(curve.get_data()), rows[:, [0, k]])
    assert list(zero.get_ydata()) == [0, 0]
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "$t$ [s]" and axes.get_ylabel() == "exponents [1/s]"


def test_exponents_and_times_are_chosen(history):
    late = read(history).between(1.0, np.inf)
    (axes,) = draw([late], Choice(coordinates=("lambda_4",))).axes
    curve, _ = axes.lines
    assert np.min(curve.get_xdata()) >= 1.0 and axes.get_ylabel() == "$λ_{4}$ [1/s]"
    assert np.array_equal(curve.get_ydata(), late.rows.columns["lambda_4"])


def test_of_several_files_the_exponents_that_all_have(history):
    (axes,) = draw([read(history), read(history.with_name("leading.csv"))], Choice()).axes
    *curves, _ = axes.lines
    assert len(curves) == 4 and len({curve.get_color() for curve in curves}) == 2
    assert [text.get_text().rpartition("/")[2] for text in axes.get_legend().get_texts()] == [
        "history.csv",
        "leading.csv",
    ]


def test_many_exponents_have_a_scale_of_colours(tmp_path):
    names = ",".join(f"lambda_{k}" for k in range(1, 21))
    row = ",".join(str(10 - k) for k in range(1, 21))
    (tmp_path / "many.csv").write_text(f"t,{names}\n1,{row}\n2,{row}\n")
    axes, bar = draw([read(tmp_path / "many.csv")], Choice()).axes
    assert len(axes.lines) == 21 and len({line.get_color() for line in axes.lines}) == 21
    assert bar.get_ylabel() == "exponent" and axes.get_legend() is None


def test_the_program_draws_it(history, pendula):
    plot = pendula("plot", "history.csv", "leading.csv", "-o", "history.png")
    assert (plot.returncode, plot.stdout, plot.stderr) == (0, "picture            history.png\n", "")
    assert (history.parent / "history.png").read_bytes().startswith(b"\x89PNG")


def test_what_is_wrong_is_told(history, monkeypatch, capsys):
    monkeypatch.chdir(history.parent)
    (history.parent / "header.csv").write_text("t,lambda_1,lambda_2\n")
    (history.parent / "torn.csv").write_text("t,lambda_1,lambda_2\n1,2\n")
    (history.parent / "run.csv").write_text("t,s,s_dot,energy\n0,1,2,3\n")
    for arguments, expected in [
        (["header.csv"], "header.csv: expected rows, got none"),
        (["torn.csv"], "torn.csv:2: expected a number in each of the 3 columns"),
        (
            ["history.csv", "leading.csv", "--coordinates", "lambda_3"],
            "leading.csv: expected an exponent, lambda_1 to lambda_2, got lambda_3",
        ),
        (
            ["history.csv", "run.csv"],
            "run.csv: expected Lyapunov exponents, as history.csv is, got a trajectory",
        ),
    ]:
        monkeypatch.setattr(sys, "argv", ["pendula_plot", "plot", *arguments, "--output", "a.svg"])
        assert main() == 2
        assert capsys.readouterr().err == f"pendula: {expected}\n"
