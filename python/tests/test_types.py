"""The package is typed, strictly."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pendula
import pytest


def test_mypy_finds_nothing():
    folder = Path(pendula.__file__).parent
    # What it has found of NumPy is kept beside kernels: a fourth of a minute.
    kept = Path(os.environ["XDG_CACHE_HOME"]) / "mypy" if "XDG_CACHE_HOME" in os.environ else os.devnull
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", f"--cache-dir={kept}", folder.name],
        cwd=folder.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


def test_the_package_says_that_it_is_typed():
    assert (Path(pendula.__file__).parent / "py.typed").exists()


@pytest.mark.parametrize("arguments", [["pendula"], ["--verifytypes", "pendula", "--ignoreexternal"]])
def test_pyright_finds_nothing_and_knows_all_public_types(arguments):
    folder = Path(pendula.__file__).parents[1]
    # Where it verifies types, it looks for those of other packages in no other place.
    places = f"{folder}{os.pathsep}{sysconfig.get_path('purelib')}"
    found = {**os.environ, "PYTHONPATH": places, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"}
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, *arguments]
    checked = subprocess.run(command, cwd=folder, env=found, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout
