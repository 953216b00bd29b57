"""Where rows and summaries go: files, standard output, full disks, pipes that nobody reads."""

import os
import resource
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from conftest import Trajectory, program, settings

ROWS_AT_ONCE = settings("run.duration=100", "output.every=1")  # 20001 rows, several blocks
ENDLESS = settings(
    "run.duration=1e12", "output.every=100000"
)  # steps of 5 ms, about one of them a microsecond


def wait_for(condition) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def rows_in(file: Path) -> int:
    return file.read_text().count("\n") - 1 if file.exists() else 0


@contextmanager
def started(command: list[str], **options) -> Iterator[subprocess.Popen]:
    """A run that is killed at the end, if it still goes on: also where a test fails."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes, **options) as run:
        try:
            yield run
        finally:
            run.kill()


@pytest.fixture
def endless(double, tmp_path):
    """An endless run whose rows, far apart, go to out.csv."""
    with started([program(), "simulate", str(double), "-o", "out.csv", *ENDLESS], cwd=tmp_path) as run:
        wait_for(lambda: rows_in(tmp_path / "out.csv") > 0)
        yield run


def test_a_minus_is_standard_output_and_the_summary_goes_to_standard_error(pendula, double, tmp_path):
    pendula("simulate", double, "-o", "out.csv")
    run = pendula("simulate", double, "-o", "-")
    assert (run.status, run.out) == (0, (tmp_path / "out.csv").read_text())
    assert run.err.startswith("pendula 0.1.0: ") and "trajectory         -, 201 rows\n" in run.err
    assert not (tmp_path / "-").exists()


def test_the_json_summary_goes_to_standard_error_with_the_rows_on_standard_output(pendula, double):
    run = pendula("simulate", double, "-o", "-", "--json")
    rows = run.out
    summary = type(run)(run.status, run.err, "").json  # alone there, too
    assert (summary["trajectory"], summary["rows"], rows.count("\n")) == ("-", 201, 202)
    assert pendula("simulate", double, "-o", "-", "--quiet").err == ""


def test_an_empty_name_is_no_file(pendula, double):
    run = pendula("simulate", double, "-o", "")
    assert (run.status, run.out) == (2, "")
    assert run.err.startswith("pendula simulate: --output: expected the name of a file, got an empty text\n")


@pytest.mark.parametrize("room", [200_000, 10, 0])
def test_a_disk_that_fills_up_keeps_whole_rows(double, tmp_path, room):
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    command = [program(), "simulate", str(double), "-o", "out.csv", "--json", *ROWS_AT_ONCE]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=60, preexec_fn=limit, check=False
    )
    assert done.returncode == 1
    assert done.stderr == "pendula: out.csv: could not be written: File too large\n"
    text = (tmp_path / "out.csv").read_text()
    assert len(text) > room - 300 and (text == "" or text.endswith("\n"))
    if room >= 1000:
        rows = Trajectory.read(tmp_path / "out.csv").rows
        assert all(len(row) == 10 for row in rows)
        assert f'"rows":{len(rows)},' in done.stdout
    else:
        assert '"rows":0,' in done.stdout


def test_what_there_is_can_be_read_while_it_grows(endless, tmp_path):
    """Rows that come slowly do not wait until they are many, which would take minutes."""
    wait_for(lambda: rows_in(tmp_path / "out.csv") > 3)
    text = (tmp_path / "out.csv").read_text()
    assert endless.poll() is None
    assert text.endswith("\n")
    assert len(text) < 60_000  # less than a block


def test_two_runs_do_not_write_one_file(pendula, double, tmp_path, endless):
    run = pendula("simulate", double, "-o", "out.csv")
    assert run.status == 2
    reason = "expected a file that can be written, got: one that another run writes"
    assert run.err == f"pendula: out.csv: {reason}\n"
    assert endless.poll() is None


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_stops_at_once_and_keeps_its_last_state(double, tmp_path, which):
    never = settings("run.duration=1e12", "output.every=1000000000000")
    command = [program(), "simulate", str(double), "-o", "out.csv", *never]
    with started(command, cwd=tmp_path) as run:
        wait_for(lambda: rows_in(tmp_path / "out.csv") > 0)
        time.sleep(0.1)
        run.send_signal(which)
        out, err = run.communicate(timeout=60)  # measured 0.002 s
    assert run.returncode == 1
    start, last = Trajectory.read(tmp_path / "out.csv").rows
    assert last[0] > start[0] == 0
    go_on = "to go on: pendula simulate --resume out.resume.h5"
    assert err == f"pendula: interrupted at t = {last[0]!r}".removesuffix(".0") + f"; {go_on}\n"
    assert "out.csv, 2 rows" in out


def test_a_signal_that_was_ignored_stays_ignored(double, tmp_path):
    def nohup() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    command = [program(), "simulate", str(double), "-o", "out.csv", "--quiet", *ENDLESS]
    with started(command, cwd=tmp_path, preexec_fn=nohup) as run:
        wait_for(lambda: rows_in(tmp_path / "out.csv") > 0)
        run.send_signal(signal.SIGHUP)
        before = rows_in(tmp_path / "out.csv")
        wait_for(lambda: rows_in(tmp_path / "out.csv") > before)
        assert run.poll() is None, run.stderr.read()
        run.send_signal(signal.SIGINT)
        assert run.wait(timeout=60) == 1


@pytest.mark.parametrize("ignored", [False, True])
def test_a_reader_that_goes_away_ends_the_run(double, ignored):
    """As with any filter: by the signal, or by an error where that is ignored."""

    def ignore() -> None:
        signal.signal(signal.SIGPIPE, signal.SIG_IGN if ignored else signal.SIG_DFL)

    command = [program(), "simulate", str(double), "-o", "-", "--quiet", *ENDLESS]
    with started(command, restore_signals=False, preexec_fn=ignore) as run:
        assert run.stdout.readline().startswith("t,theta_1,")
        run.stdout.close()
        assert run.wait(timeout=60) == (1 if ignored else -signal.SIGPIPE)
        reason = "pendula: standard output: could not be written: Broken pipe\n" if ignored else ""
        assert run.stderr.read() == reason


def test_a_closed_standard_output_does_not_put_the_summary_into_the_trajectory(double, tmp_path):
    command = [program(), "simulate", str(double), "-o", "out.csv"]
    run = subprocess.run(
        command,
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        preexec_fn=lambda: os.close(1),
        check=False,
    )
    assert (run.returncode, run.stderr) == (1, "pendula: standard output could not be written\n")
    assert len(Trajectory.read(tmp_path / "out.csv").rows) == 201
