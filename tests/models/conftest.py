"""Runs of the program on models; PENDULA_PROGRAM names it, XDG_CACHE_HOME where kernels are kept between runs."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
sys.path.insert(0, str(ROOT / "tests/support"))


@pytest.fixture(scope="session")
def environment(tmp_path_factory) -> dict[str, str]:
    kept = os.environ.get("XDG_CACHE_HOME") or str(tmp_path_factory.mktemp("cache"))
    return {**os.environ, "XDG_CACHE_HOME": kept}


@pytest.fixture
def pendula(environment):
    """pendula(*arguments, cwd=…, **variables) -> the finished process."""

    def run(*arguments, cwd=None, **variables) -> subprocess.CompletedProcess:
        return subprocess.run(
            [os.environ["PENDULA_PROGRAM"], *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=cwd,
            env={**environment, **variables},
            timeout=300,
        )

    return run


@pytest.fixture
def simulate(pendula):
    """simulate(scenario, **overrides) -> the summary; `run__step` is the key run.step."""

    def run(scenario, **overrides) -> dict:
        settings = [f"--set={key.replace('__', '.')}={value}" for key, value in overrides.items()]
        ended = pendula("simulate", EXAMPLES / scenario, "--json", *settings)
        assert ended.returncode == 0, ended.stderr
        return json.loads(ended.stdout)

    return run


@pytest.fixture
def rows(pendula, tmp_path):
    """rows(scenario, **overrides) -> the trajectory as a dictionary of columns."""

    def run(scenario, **overrides) -> dict[str, list[float]]:
        file = tmp_path / "out.csv"
        settings = [f"--set={key.replace('__', '.')}={value}" for key, value in overrides.items()]
        ended = pendula("simulate", EXAMPLES / scenario, "--quiet", "-o", file, *settings)
        assert ended.returncode == 0, ended.stderr
        header, *lines = file.read_text().splitlines()
        columns = zip(*([float(x) for x in line.split(",")] for line in lines), strict=True)
        return {name: list(column) for name, column in zip(header.split(","), columns, strict=True)}

    return run
