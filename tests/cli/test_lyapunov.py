"""Lyapunov exponents: what is printed, what goes to the file, what is told of options that make no sense."""

import csv

import pytest
from conftest import settings


def test_the_spectrum_is_told(pendula, double, tmp_path):
    arguments = settings("run.duration=50")
    run = pendula("lyapunov", double, *arguments, "--json", "-o", "convergence.csv")
    assert run.status == 0, run.err
    found = run.json
    assert len(found["exponents"]) == len(found["exponents_error"]) == 4
    assert found["exponents"] == sorted(found["exponents"], reverse=True)
    margin = found["exponents_error"][0]  # measured 0.13
    assert found["exponents"][0] + found["exponents"][3] == pytest.approx(0, abs=margin)  # measured 0.064
    assert found["sum"] == pytest.approx(0, abs=1e-10)  # measured 2e-12
    assert (found["duration"], found["steps"]) == (50, 10000)
    with (tmp_path / "convergence.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["t", "lambda_1", "lambda_2", "lambda_3", "lambda_4"]
    times = [float(row[0]) for row in rows]
    assert times == sorted(times)
    assert 20 < len(rows) < 10000
    # The file averages from the start on, to the very end; the spectrum leaves out the first tenth.
    assert (times[-1], found["averaged_from"]) == (50, 5)
    assert float(rows[-1][1]) == pytest.approx(found["ftle"], rel=1e-12)  # measured 2.3e-15


def test_the_leading_ones_alone_are_those_of_all(pendula, double):
    whole, part = (
        pendula("lyapunov", double, *settings("run.duration=50"), "--json", *count).json
        for count in ([], ["--count", "2"])
    )
    assert len(part["exponents"]) == 2
    margin = max(whole["exponents_error"])
    assert part["exponents"][0] == pytest.approx(whole["exponents"][0], abs=margin)


def test_the_table_has_them_all(pendula, double):
    run = pendula("lyapunov", double)
    assert run.status == 0, run.err
    rows = [line.split()[0] for line in run.out.splitlines() if line.startswith("    ")]
    assert rows[1:] == ["1", "2", "3", "4"]
    assert "averaged           from 0.1 s on, when tangents have found their directions\n" in run.out
    assert "of one tangent from the start on, as the last row of -o has it\n" in run.out


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--set", "run.method=rk4"], "expected method = gauss or radau in momentum form"),
        (["--set", "run.form=velocity", "--set", "run.solver=dense"], "in momentum form"),
        (["--count", "5"], "expected 1 to 4 exponents, got 5"),
    ],
)
def test_what_has_none_is_refused(arguments, said, pendula, double):
    run = pendula("lyapunov", double, *arguments)
    assert run.status == 2
    assert said in run.err
