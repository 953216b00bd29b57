"""The package is typed, strictly."""

import subprocess
import sys
from pathlib import Path

import pendula


def test_mypy_finds_nothing():
    folder = Path(pendula.__file__).parent
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--cache-dir=/dev/null", folder.name],
        cwd=folder.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


def test_the_package_says_that_it_is_typed():
    assert (Path(pendula.__file__).parent / "py.typed").exists()
