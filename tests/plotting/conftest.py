"""Pictures of runs: the program is PENDULA_PROGRAM, the package pendula_plot of this checkout."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "plotting"), str(ROOT / "tests/support")]

DOUBLE = """\
[chain]
space   = "planar"
masses  = [1.0, 0.5]
lengths = 1.0

[start]
theta = [2.5, 3.0]

[run]
stages   = 4
step     = 5e-3
duration = 3.0

[output]
every = 2
"""
SPACE = DOUBLE.replace("planar", "spatial").replace("[run]", "phi = [0.0, 0.5]\nphi_dot = 1.5\n\n[run]")


@pytest.fixture
def pendula(tmp_path):
    """pendula(*arguments, **variables) -> the finished process, in a folder of its own."""

    def run(*arguments, **variables) -> subprocess.CompletedProcess:
        return subprocess.run(
            [os.environ["PENDULA_PROGRAM"], *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PENDULA_PYTHON": sys.executable, **variables},
            timeout=300,
            check=False,
        )

    return run


@pytest.fixture
def runs(pendula, tmp_path):
    """Runs of a double pendulum, as CSV and as HDF5, and of a chain in space."""
    (tmp_path / "double.toml").write_text(DOUBLE)
    (tmp_path / "space.toml").write_text(SPACE)
    for scenario, output in [("double", "double.csv"), ("double", "double.h5"), ("space", "space.h5")]:
        assert pendula("simulate", f"{scenario}.toml", "-o", output).returncode == 0
    return tmp_path
