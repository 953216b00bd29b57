"""The package as it is imported from the build, beside the program of the same build."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def command_line() -> Callable[..., dict]:
    """Runs `pendula simulate` and gives its summary, and the rows of its file."""

    def run(scenario: Path, rows: Path, *words: str) -> dict:
        done = subprocess.run(
            [os.environ["PENDULA_PROGRAM"], "simulate", scenario, "--json", "-o", rows, *words],
            capture_output=True,
            text=True,
            check=False,
        )
        return json.loads(done.stdout)

    return run
