"""Runs that fail on the way: exit status 1, a message, and every row that was computed."""

import math
import os
import re
import subprocess
import sys

import pytest
from conftest import Trajectory, program, settings

# A torque that grows without end: after a few steps the link turns too far even in the smallest part of
# a step.
EVER_FASTER = """\
[chain]
space   = "spatial"
masses  = [1.0]
lengths = 1.0
gravity = 0.0
[[chain.drive]]
link = 1
amplitude = [0.0, 1.6e8, 0.0]
frequency = 1e-3
[start]
theta     = 1.1
[run]
solver   = "dense"
stages   = 1
step     = 0.04
duration = 1.0
[output]
every = 1
"""
FAILED_STEPS = ("wrong_root", "not_converged", "singular_mass_matrix")


@pytest.mark.parametrize("form", ["momentum", "velocity"])
def test_a_failing_step_ends_the_run_and_the_rows_stay(pendula, tmp_path, form):
    (tmp_path / "run.toml").write_text(EVER_FASTER)
    run = pendula("simulate", "run.toml", "-o", "out.csv", "--json", *settings(f"run.form={form}"))
    assert run.status == 1
    outcome, steps = run.json["outcome"], run.json["steps"]
    assert outcome["status"] in FAILED_STEPS
    assert outcome["t"] >= 0.04 * steps > 0
    trajectory = Trajectory.read(tmp_path / "out.csv")
    assert trajectory.column("t") == pytest.approx(
        [0.04 * k for k in range(steps + 1)], abs=1e-15
    )  # measured 0
    assert trajectory.rows[-1][1] == run.json["final"]["theta"][0]


def test_a_start_at_the_pole_is_refused(pendula, tmp_path):
    (tmp_path / "run.toml").write_text(EVER_FASTER)
    run = pendula(
        "simulate",
        "run.toml",
        "-o",
        "out.csv",
        "--json",
        *settings("start.theta=0.0"),
    )
    assert run.status == 1
    assert run.json["outcome"]["status"] == "singular_mass_matrix"
    assert (run.json["steps"], run.json["final"]["t"]) == (0, 0)
    assert len(Trajectory.read(tmp_path / "out.csv").rows) == 1


@pytest.mark.parametrize("solver", ["chain", "dense"])
def test_a_step_that_is_far_too_large(pendula, double, tmp_path, solver):
    """Steps of a thousand seconds find no solution, or none that is the motion; nor do their parts."""
    given = settings(
        f"run.solver={solver}", "run.stages=3", "run.step=1e3", "run.duration=1e9", "output.every=1"
    )
    run = pendula("simulate", double, "-o", "out.csv", "--json", *given)
    assert run.status == 1
    outcome, rows = run.json["outcome"], Trajectory.read(tmp_path / "out.csv").rows
    assert outcome["status"] in ("not_converged", "wrong_root", "not_finite")
    assert outcome["iterations"] > 0
    assert outcome["message"] in run.err
    assert run.json["rejected_steps"] > 0
    assert len(rows) == run.json["rows"] == run.json["steps"] + 1
    assert rows[-1][0] == run.json["final"]["t"] <= outcome["t"]  # the parts of a step that failed are undone


def test_the_last_state_of_a_failing_run_is_a_row_between_rows_too(pendula, tmp_path):
    (tmp_path / "run.toml").write_text(EVER_FASTER)
    run = pendula("simulate", "run.toml", "-o", "out.csv", *settings("output.every=1000"))
    assert run.status == 1
    start, end = Trajectory.read(tmp_path / "out.csv").column("t")
    assert start == 0 and 0 < end < 1
    assert "ended early" in run.out


def test_a_failing_run_says_so_even_when_quiet(pendula, tmp_path):
    (tmp_path / "run.toml").write_text(EVER_FASTER)
    run = pendula("simulate", "run.toml", "--quiet")
    assert (run.status, run.out) == (1, "")
    assert run.err.startswith("pendula: at t = 0.")


@pytest.mark.parametrize("rate", ["1e200", "1e153"])
def test_a_row_that_is_not_finite_is_not_written(pendula, double, tmp_path, rate):
    """1e200 rad/s have no finite energy at the start; 1e153 do, but no step from there is solved."""
    given = ["-o", "out.csv", *settings(f"start.theta_dot={rate}")]
    run = pendula("simulate", double, "--json", *given)
    assert run.status == 1
    assert run.json["outcome"]["status"] in ("not_finite", "not_converged", "wrong_root")
    rows = Trajectory.read(tmp_path / "out.csv").rows
    assert len(rows) == run.json["rows"] == (0 if rate == "1e200" else 1)
    assert all(math.isfinite(value) for row in rows for value in row)
    told = pendula("simulate", double, *given)
    assert told.status == 1
    assert re.search(r"\b(nan|inf)\b", told.out) is None


def test_a_start_without_finite_energy_is_told(pendula, double):
    run = pendula("simulate", double, *settings("start.theta_dot=1e200"))
    assert run.err == "pendula: at t = 0: the energy is not a finite number\n"
    assert "energy at start    - J\nenergy at end      - J\n" in run.out


@pytest.mark.skipif(sys.platform != "linux", reason="needs the device that is always full")
def test_a_full_disk_is_reported(pendula, double):
    run = pendula("simulate", double, "-o", "/dev/full", "--json")
    assert run.status == 1
    assert run.err == "pendula: /dev/full: could not be written: No space left on device\n"
    assert run.json["outcome"]["status"] == "output_failed"
    assert run.json["rows"] == 0


@pytest.mark.skipif(sys.platform != "linux", reason="needs the device that is always full")
@pytest.mark.parametrize("command", ["simulate", "kernels", "--version", "--help"])
def test_what_cannot_be_printed_is_reported(double, command):
    with open("/dev/full", "w") as full:
        run = subprocess.run(
            [program(), command, *([double] if command == "simulate" else [])],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    assert run.returncode == 1
    assert run.stderr == "pendula: standard output could not be written\n"


@pytest.mark.skipif(not hasattr(os, "O_DIRECT"), reason="needs pipes that keep writes apart")
def test_messages_are_written_a_line_at_a_time(tmp_path):
    """Ranks, and mpirun itself, write to the same stream, so that messages in pieces come mixed."""
    mine, theirs = os.pipe2(os.O_DIRECT)
    with subprocess.Popen([program(), "simulate", "missing.toml"], stderr=theirs, cwd=tmp_path) as run:
        os.close(theirs)
        writes = list(iter(lambda: os.read(mine, 4096), b""))
    os.close(mine)
    assert run.returncode == 2
    assert writes and all(text.endswith(b"\n") for text in writes), writes


def read_terminal(terminal: int) -> str:
    """What was written to a terminal until its last writer closed it."""
    chunks = []
    try:
        while chunk := os.read(terminal, 4096):
            chunks.append(chunk)
    except OSError:  # how Linux says that nobody writes any more
        pass
    return b"".join(chunks).decode()


def test_progress_is_for_terminals(double):
    """On a terminal a line says how far the run is, and goes away at the end; standard output stays pure."""
    mine, theirs = os.openpty()
    command = [program(), "simulate", str(double), "--json", *settings("run.duration=4000")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs) as run:
        os.close(theirs)
        seen = read_terminal(mine)
        out, _ = run.communicate(timeout=60)
    os.close(mine)
    assert run.returncode == 0
    assert "% " in seen and "of 4000" in seen
    last = seen.split("\r\x1b[K")[-2]
    assert re.fullmatch(r"\d+ %   t = \S+ of 4000   \S+ steps/s   \d+ s left   energy off by \S+", last), last
    assert seen.split("pendula: warning")[0].endswith("\r\x1b[K")
    assert out.count(b"\n") == 1
