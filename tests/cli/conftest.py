"""Runs the program as a user does: a command line in, files, text and an exit status out."""

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

DOUBLE = """\
[chain]
space   = "planar"
masses  = [1.0, 1.0]
lengths = 1.0
gravity = 9.81

[start]
theta = 1.5707963267948966

[run]
step     = 5e-3
duration = 1.0
"""

SPHERICAL = """\
[chain]
space   = "spatial"
links   = 1
masses  = 1.0
lengths = 1.0
gravity = 9.81

[start]
theta     = 1.2
phi       = 0.3
theta_dot = 0.4
phi_dot   = 0.9

[run]
stages   = 4
step     = 1e-2
duration = 10.0
"""


@dataclass(frozen=True)
class Result:
    """What a call of the program left behind."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        """Standard output, which must be one JSON object and nothing else."""

        def reject(text: str) -> None:
            raise ValueError(f"{text} is no JSON number")

        found = json.loads(self.out, parse_constant=reject)
        if "newton_iterations" in found:  # the summary of a run
            summary_validator().validate(found)
        return found


@dataclass(frozen=True)
class Trajectory:
    """A trajectory file, parsed."""

    header: list[str]
    rows: list[list[float]]

    @staticmethod
    def read(file: Path) -> "Trajectory":
        with file.open(newline="") as stream:
            header, *rows = csv.reader(stream)
        return Trajectory(header, [[float(cell) for cell in row] for row in rows])

    def column(self, name: str) -> list[float]:
        at = self.header.index(name)
        return [row[at] for row in self.rows]


def program() -> str:
    """The program under test."""
    path = os.environ.get("PENDULA_PROGRAM")
    assert path, "PENDULA_PROGRAM must name the program to test"
    return path


@cache
def summary_validator() -> Draft202012Validator:
    """Of what the program says that its summaries are."""
    said = subprocess.run(
        [program(), "help", "summary", "--json"], capture_output=True, text=True, check=True
    )
    return Draft202012Validator(json.loads(said.stdout))


def settings(*overrides: str) -> list[str]:
    """The words `--set KEY=VALUE` for each override."""
    return [word for override in overrides for word in ("--set", override)]


@pytest.fixture(scope="session", autouse=True)
def signals_end_programs():
    """Also where the tests themselves run by nohup, or in the background of a script, which ignore some for good."""
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(which) is signal.SIG_IGN:
            signal.signal(which, signal.SIG_DFL)


@pytest.fixture
def pendula(tmp_path: Path) -> Callable[..., Result]:
    """Calls the program in a folder of its own."""

    def call(*arguments: str | Path, **environment: str) -> Result:
        command: Sequence[str] = [program(), *map(str, arguments)]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env=os.environ | environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        return Result(done.returncode, done.stdout, done.stderr)

    return call


@pytest.fixture
def double(tmp_path: Path) -> Path:
    """The double pendulum from the horizontal, at rest, for one second."""
    file = tmp_path / "double.toml"
    file.write_text(DOUBLE)
    return file


@pytest.fixture
def spherical(tmp_path: Path) -> Path:
    """One link in space, for ten seconds."""
    file = tmp_path / "spherical.toml"
    file.write_text(SPHERICAL)
    return file
