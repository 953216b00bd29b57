"""Taylor series of models: ends, rows within steps, events, drives and damping, against Gauss steps."""

import json

import h5py
import numpy as np
import pytest
from conftest import ROOT

EXAMPLES = ("cart_chain", "furuta", "joint_springs", "rods", "spring_pendulum", "swinging_atwood", "driven_chain")


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(scenario, *settings) -> rows as columns, and the summary."""

    def run(scenario, *settings) -> tuple[dict[str, np.ndarray], dict]:
        file = tmp_path / "rows.csv"
        keys = [f"--set={key}" for key in settings]
        ended = pendula("simulate", f"examples/{scenario}.toml", "--json", "-o", file, *keys, cwd=ROOT)
        assert ended.returncode == 0, ended.stderr
        names, *rows = (line.split(",") for line in file.read_text().splitlines())
        columns = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
        return columns, json.loads(ended.stdout)

    return run


def apart(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> float:
    assert np.array_equal(a["t"], b["t"])
    return max(np.abs(a[name] - b[name]).max() / max(1.0, np.abs(b[name]).max()) for name in a)


SHORT = ("run.duration=2.0", "output.interval=0.1", "run.accuracy=", "run.estimate=false")


@pytest.mark.parametrize("example", EXAMPLES)
def test_series_go_where_gauss_steps_go(example, moved):
    """Rows lie within steps: dense output is as good as steps are."""
    true, _ = moved(example, *SHORT, "run.tolerance=1e-14")
    rows, summary = moved(example, *SHORT, "run.method=taylor", "run.tolerance=1e-13")
    assert apart(rows, true) < 1e-10  # measured MEASURED
    assert summary["method"] == "taylor" and summary["steps"] > 2
