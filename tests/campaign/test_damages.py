"""The campaign of damages: it goes on where it was, and tells what failed."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("damages.py")


def campaign(program: Path, folder: Path, *more: str) -> tuple[int, str]:
    command = [sys.executable, SCRIPT, "scenarios", "--seed", "3", "--program", program, "--folder", folder]
    done = subprocess.run([*command, *more], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_it_goes_on_where_it_was(program, tmp_path):
    assert campaign(program, tmp_path, "--count", "4") == (0, "scenarios, seed 3: 4 of 4, failed: none\n")
    assert (tmp_path / "draw_scenarios_3").read_text() == "3"
    assert campaign(program, tmp_path, "--count", "4") == (0, "")
    (tmp_path / "scenarios_3.json").write_text('{"next": 3, "failed": []}')
    assert campaign(program, tmp_path, "--count", "5")[0] == 0
    assert json.loads((tmp_path / "scenarios_3.json").read_text()) == {"next": 5, "failed": []}


def test_it_tells_what_failed_and_goes_on(tmp_path):
    silent = tmp_path / "silent"
    silent.write_text("#!/bin/sh\nexit 1\n")
    silent.chmod(0o755)
    status, told = campaign(silent, tmp_path, "--count", "2")
    assert status == 1 and told.endswith("2 of 2, failed: [0, 1]\n")
    assert "draw 1, status 1" in (tmp_path / "failed_scenarios_3_1.txt").read_text()
