"""Pages to look at a run: when they are written, and when not. What is in them: tests/view."""

import json
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from conftest import program, settings


def about(page: Path) -> dict:
    """What a page says of itself."""
    text = page.read_text()
    [data] = re.findall(r'<script type="application/json" id="scene">(.*?)</script>', text, re.DOTALL)
    return json.loads(data)


def test_a_page_shows_every_run(pendula, double, tmp_path):
    result = pendula("simulate", double, "--view", "out.html", "--copies", 3, "--apart", "5e-9", "--json")
    assert result.status == 0, result.err
    assert result.json["view"] == "out.html"
    labels = [run["label"] for run in about(tmp_path / "out.html")["runs"]]
    assert labels == ["start", *(f"theta_1 + {by} rad" for by in ("5e-09", "1e-08", "1.5e-08"))]


def test_a_page_has_rows_of_its_own_and_changes_nothing(pendula, double, tmp_path):
    """Whatever steps and rows a run has, its page moves evenly."""
    plain = settings("run.step=0.1", "output.every=7", "run.duration=3")
    for asked in plain, [*plain, *settings("output.interval=0.5")]:
        assert pendula("simulate", double, "-o", "alone.csv", *asked).status == 0
        assert pendula("simulate", double, "-o", "beside.csv", "--view", "out.html", *asked).status == 0
        assert (tmp_path / "alone.csv").read_bytes() == (tmp_path / "beside.csv").read_bytes()
        [run] = about(tmp_path / "out.html")["runs"]
        assert run["rows"] == 2001 and run["seen"] == 2001


def test_a_page_tells_how_it_was_made(pendula, double, tmp_path):
    assert pendula("simulate", double, "--view", "out.html", *settings("run.stages=3")).status == 0
    scenario = about(tmp_path / "out.html")["scenario"]
    assert scenario.startswith("[chain]")
    assert scenario.endswith("# run with --set run.stages=3\n")


def test_a_run_that_fails_leaves_its_page(pendula, double, tmp_path):
    limits = settings("run.step=1e5", "run.duration=1e6", "output.every=1")
    result = pendula("simulate", double, "--view", "out.html", *limits)
    assert result.status == 1
    assert len(about(tmp_path / "out.html")["runs"]) == 1


def test_copies_that_are_interrupted_are_missed(double, tmp_path):
    """A thousand copies take minutes: those that were run are in the page, and the rest is told."""
    command = [program(), "simulate", str(double), "--view", "out.html", "--copies", "1000"]
    run = subprocess.Popen(
        [*command, *settings("run.duration=1000", "output.every=1000")],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(2)  # the run itself takes a tenth of one
    run.send_signal(signal.SIGINT)
    _, told = run.communicate(timeout=60)
    assert run.returncode == 1
    assert "pendula: interrupted before all copies were run\n" in told
    assert 1 < len(about(tmp_path / "out.html")["runs"]) < 1001


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--view", "-"], "pendula: -: expected a file of its own for the page"),
        (["--view", "a.csv", "-o", "a.csv"], "pendula: a.csv: expected a file of its own for the page"),
        (["--view", "a.csv", "-o", "./a.csv"], "pendula: a.csv: expected a file of its own for the page"),
        (["--view", "a.txt"], "pendula: a.txt: expected a name that ends in .html"),
        (
            ["--view", "a.html", "--copies", "2", "--apart", "nan"],
            "--apart: expected a number that is finite, got nan",
        ),
        (["--view", "no/a.html"], "no/a.html: expected a file that can be written"),
        (["--copies", "2"], "--copies requires --view or --video"),
        (["--view", "a.html", "--copies", "0"], "--copies"),
    ],
)
def test_where_no_page_can_be(pendula, double, tmp_path, arguments, message):
    result = pendula("simulate", double, *arguments)
    assert result.status == 2
    assert message in result.err
    assert not list(tmp_path.glob("*.html*"))


def test_the_scenario_is_not_overwritten(pendula, double):
    before = double.read_text()
    result = pendula("simulate", double, "--view", double)
    assert result.status == 2
    assert "expected a file for the page, got the scenario itself" in result.err
    assert double.read_text() == before
