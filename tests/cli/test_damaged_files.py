"""Files that are damaged: whoever goes on from one is told so, or gets what the whole file gives, to the last bit.

Nothing hangs, dies of a signal, or takes long to say so. tests/campaign/damages.py draws more damages.
"""

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from conftest import DOUBLE, program, settings
from damage import damaged, draws

OFTEN_KEPT = """
[output]
every = 4000
checkpoint = 0.4
"""
ENDLESS = DOUBLE.replace("5e-3", "2e-5").replace("duration = 1.0", "duration = 1e6") + OFTEN_KEPT

AXIS = """
[[ensemble.axis]]
key   = "start.theta[1]"
from  = -1.0
to    = 1.0
count = 64

[[event]]
name = "down"
when = "theta_1"
"""
ENSEMBLE = DOUBLE.replace("theta = 1.5707963267948966", "theta = [0.0, 2.0]") + AXIS


def contents(file: Path) -> dict[str, object]:
    """All data sets and what is said of them, but for places to go on from, and times and wall times."""
    found: dict[str, object] = {}

    def add(name: str, item: h5py.Group | h5py.Dataset) -> None:
        left_out = ("DIMENSION_LIST", "REFERENCE_LIST", "history", "checksum")
        found[name] = {key: str(value) for key, value in item.attrs.items() if key not in left_out}
        if isinstance(item, h5py.Dataset) and name not in ("run/checkpoint", "run/summary"):
            found[f"{name}: "] = item[()] if item.dtype.kind == "O" else item[()].tobytes()

    with h5py.File(file) as opened:
        add("", opened)
        opened.visititems(add)
    return found


def ends_in_order(command: list[str], folder: Path) -> bool:
    """Whether it was done; else it said in one line what was wrong with its input, and soon: 0.7 s measured, where HDF5
    does not end."""
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="strict", timeout=30)
    assert ended.returncode in (0, 2), ended.stderr
    if ended.returncode == 0:
        return True
    assert ended.stderr.startswith("pendula: ") and ended.stderr.count("\n") == 1, ended.stderr
    return False


def check_damages(few: int, file: Path, others: list[Path], go_on: Callable[[], bool], made: Path) -> None:
    """go_on() makes the file `made` from the whole `file`, and the same or nothing from each that is damaged."""
    before = {path: path.read_bytes() for path in [file, *others]}

    def is_done(data: bytes) -> bool:
        for path, kept in before.items():
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data if path == file else kept)
        return go_on()

    assert is_done(before[file])
    whole = contents(made)
    for number, draw in draws(few):
        data = damaged(draw, before[file])
        if is_done(data):
            assert contents(made) == whole, f"draw {number}"
        else:
            assert file.read_bytes() == data and not list(made.parent.glob("*.part")), f"draw {number}"


def finished(folder: Path) -> str:
    (folder / "run.toml").write_text(DOUBLE)
    assert ends_in_order([program(), "simulate", "run.toml", "-o", "run.h5", "--quiet"], folder)
    return "2"


def killed(folder: Path) -> str:
    """With rows that were written before their block was full, and marked as being written."""
    (folder / "run.toml").write_text(ENDLESS)
    run = subprocess.Popen([program(), "simulate", "run.toml", "-o", "run.h5", "--quiet"], cwd=folder)
    time.sleep(2.5)
    run.send_signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    with h5py.File(folder / "run.h5") as left:
        assert left["t"].shape[0] > 1
        return str(left["t"][-1] + 0.1)


@pytest.mark.parametrize(("made", "few"), [(finished, 40), (killed, 10)])
def test_a_run_goes_on_from_what_was_written_or_not_at_all(made, few, tmp_path):
    duration = made(tmp_path)
    command = [
        program(),
        "simulate",
        "--resume",
        "run.h5",
        *settings(f"run.duration={duration}"),
        "--quiet",
    ]
    file = tmp_path / "run.h5"
    check_damages(few, file, [], lambda: ends_in_order(command, tmp_path), file)


def test_an_ensemble_goes_on_from_what_was_written_or_not_at_all(tmp_path):
    (tmp_path / "run.toml").write_text(ENSEMBLE)
    command = [program(), "ensemble", "run.toml", "-o", "out.h5", "--json"]
    half = subprocess.run([*command, "--shard", "1/2"], cwd=tmp_path, capture_output=True, text=True)
    assert half.returncode == 3, half.stderr
    [journal] = (tmp_path / "out.h5.parts").glob("*.journal")

    def go_on() -> bool:
        return ends_in_order([*command, "--resume"], tmp_path)

    check_damages(20, journal, [tmp_path / "out.h5"], go_on, tmp_path / "out.h5")


def test_an_ensemble_that_is_damaged_is_moved_again_or_left_alone(tmp_path):
    """Its numbers are not looked at: whether the file is complete is in what HDF5 has checksums for."""
    (tmp_path / "run.toml").write_text(ENSEMBLE)
    command = [program(), "ensemble", "run.toml", "-o", "out.h5", "--json"]
    assert ends_in_order(command, tmp_path)
    file = tmp_path / "out.h5"
    whole, was = file.read_bytes(), contents(file)
    for _, draw in draws(20):
        data = damaged(draw, whole)
        file.write_bytes(data)
        assert ends_in_order([*command, "--resume"], tmp_path)
        assert file.read_bytes() == data or contents(file) == was
